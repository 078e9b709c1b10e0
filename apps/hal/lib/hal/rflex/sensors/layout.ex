defmodule Hal.RFlex.Sensors.Layout do
  @moduledoc false
  # Works out which sensors a base has on which boards: from the options and, for what they leave out, from
  # what is usual for its body. Pure; the options are those of `Hal.RFlex.Options`.
  alias Hal.{Options, Profile}
  alias Hal.RFlex.Conversions
  alias Hal.RFlex.Sensors.{Bumpers, Infrared}

  @doc "The bumpers; the error says what is wrong with the options."
  @spec bumpers(keyword(), Profile.t()) :: {:ok, Bumpers.t()} | {:error, String.t()}
  def bumpers(options, profile) do
    style = options[:style] || :bit
    count = options[:count] || profile.bumpers
    segments = options[:segments] || Bumpers.default_segments(style, count)
    base = options[:base] || 0x40

    if length(segments) == count,
      do: {:ok, %Bumpers{style: style, base: base, count: count, segments: segments}},
      else: refuse([:bumpers, :segments], segments, "a segment for each of the #{count} bumpers")
  end

  @doc """
  The options with boards, times and order filled in; `own?` says that the options have a profile.
  """
  @spec sensors(keyword(), Conversions.t(), own? :: boolean()) ::
          {:ok, keyword()} | {:error, String.t()}
  def sensors(given, conversions, own?) do
    given = Keyword.merge(given, usual(given))
    count = Enum.sum(given[:ir_banks])

    with :ok <- fits(:sonar_banks, given, length(given[:profile].sonars), own?),
         :ok <- fits(:ir_banks, given, length(given[:profile].irs), own?),
         :ok <- order(given[:ir_order], count),
         :ok <- each([:conversions, :ir_a], conversions.ir_a, count),
         :ok <- each([:conversions, :ir_b], conversions.ir_b, count),
         do: {:ok, given}
  end

  defp usual(given) do
    profile = given[:profile]
    irs = given[:ir_banks] || eights(length(profile.irs))
    count = Enum.sum(irs)
    # The pause after each ping that is published for a Magellan; an ATRV mini has none.
    ping = if profile.name == :magellan, do: 1250, else: 0

    order =
      if profile.name == :magellan and count == 16,
        do: Infrared.magellan_order(),
        else: Enum.to_list(0..(count - 1)//1)

    [
      sonar_banks: given[:sonar_banks] || eights(length(profile.sonars)),
      sonar_times: given[:sonar_times] || {30_000, ping, 0},
      ir_banks: irs,
      ir_order: given[:ir_order] || order
    ]
  end

  defp eights(0), do: []
  defp eights(n) when n <= 8, do: [n]
  defp eights(n), do: [8 | eights(n - 8)]

  defp fits(key, given, poses, own?) do
    if own? and Enum.sum(given[key]) != poses,
      do: refuse([key], given[key], "#{poses} together, as many as the body has poses for,"),
      else: :ok
  end

  defp order(order, count) do
    if Enum.sort(order) == Enum.to_list(0..(count - 1)//1),
      do: :ok,
      else: refuse([:ir_order], order, "a list of #{count} places, each once, counted from 0,")
  end

  defp each(path, values, count) when is_list(values) and length(values) != count,
    do: refuse(path, values, "one for each of #{count} infrareds")

  defp each(_path, _values, _count), do: :ok

  defp refuse(path, value, allowed), do: Options.refuse("rflex", path, value, allowed)
end
