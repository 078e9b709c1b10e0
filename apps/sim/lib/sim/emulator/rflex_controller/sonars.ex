defmodule Sim.Emulator.RFlexController.Sonars do
  @moduledoc false
  # Fires the sonars one after the other: each listens for the echo delay and rests for the ping
  # delay, and each sweep is followed by the set delay (fact sheet rFLEX, section 5). Pure; times in
  # microseconds.
  #
  # The echo of a sonar is what the body sensed last when its listening ends.

  # Sound travels at 343 m/s, there and back.
  @metre_per_us 343 / 2 / 1.0e6

  # With delays of 0 the loop would never end.
  @least_us 1_000

  @enforce_keys [:echo_us, :each_us, :set_us, :next_us]
  defstruct @enforce_keys ++ [place: 0, echoes: []]

  @type t :: %__MODULE__{}

  @doc "Sonars that start to fire now, with the delays of the command."
  @spec start({non_neg_integer(), non_neg_integer(), non_neg_integer()}, integer()) :: t()
  def start({echo_us, ping_us, set_us}, at_us) do
    each_us = max(echo_us + ping_us, @least_us)
    %__MODULE__{echo_us: echo_us, each_us: each_us, set_us: set_us, next_us: at_us + each_us}
  end

  @doc """
  The ids of the sonars, in the order of the profile: 16 for each board, whether fitted or not.

      iex> Sim.Emulator.RFlexController.Sonars.ids([2, 1])
      [0, 1, 16]
  """
  @spec ids([0..16]) :: [non_neg_integer()]
  def ids(banks) do
    for {fitted, bank} <- Enum.with_index(banks), slot <- 0..(fitted - 1)//1, do: 16 * bank + slot
  end

  @doc """
  The reports that are due: lists of `{id, raw}`, one per report. `ranges` are the body's, in
  metres; without them no sonar fires.
  """
  @spec run(t(), [float()], map(), integer()) :: {[[{byte(), 0..0xFFFF}]], t()}
  def run(%__MODULE__{} = sonars, ranges, options, at_us) do
    ids = ids(options.sonar_banks)
    count = min(length(ids), length(ranges))
    # After a delay of more than a sweep it does not make up for it.
    late_us = at_us - sonars.next_us - count * sonars.each_us - sonars.set_us
    sonars = if late_us > 0, do: %{sonars | next_us: sonars.next_us + late_us}, else: sonars

    if count == 0,
      do: {[], %{sonars | next_us: max(sonars.next_us, at_us + sonars.each_us)}},
      else: fire(sonars, {List.to_tuple(ids), List.to_tuple(ranges), count}, options, at_us, [])
  end

  defp fire(%{next_us: next_us} = sonars, _all, _options, at_us, told) when next_us > at_us,
    do: {Enum.reverse(told), sonars}

  defp fire(sonars, {ids, ranges, count} = all, options, at_us, told) do
    place = rem(sonars.place, count)
    echo = {elem(ids, place), raw(elem(ranges, place), sonars, options)}
    last? = place == count - 1
    echoes = [echo | sonars.echoes]
    next_us = sonars.next_us + sonars.each_us + if(last?, do: sonars.set_us, else: 0)
    sonars = %{sonars | place: if(last?, do: 0, else: place + 1), next_us: next_us}

    if last? or length(echoes) >= options.sonar_per_report,
      do: fire(%{sonars | echoes: []}, all, options, at_us, [Enum.reverse(echoes) | told]),
      else: fire(%{sonars | echoes: echoes}, all, options, at_us, told)
  end

  defp raw(range, sonars, options) do
    heard_m = min(options.sonar_max, sonars.echo_us * @metre_per_us)

    if range < heard_m,
      do: min(trunc(range * options.conversions[:range]), 0xFFFF),
      else: options.missed_echo
  end
end
