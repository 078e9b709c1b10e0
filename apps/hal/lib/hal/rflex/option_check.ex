defmodule Hal.RFlex.OptionCheck do
  @moduledoc false
  # Judges a base by its options alone, before its line is opened: whether it may be armed, what it
  # reads, and which allowed values are unusual. The driver and `mix robot.check` use it. Pure.
  alias Hal.RFlex.{Commands, Conversions, Options}

  @baud 115_200
  # Robots of one kind differ by some percent; no two public ones differ by this factor.
  @factor 1.5

  @doc """
  Whether the drive may be armed; the error names the missing conversions. Infrareds without their
  law are not read, and do not prevent it.

      iex> {:ok, options} = Hal.RFlex.Options.new(port: "/dev/ttyR0", conversions: [range: 1474.0])
      iex> Hal.RFlex.OptionCheck.ready(options)
      {:error, "conversions are missing: distance (units per metre), angle (units per radian)"}
  """
  @spec ready(Options.t()) :: :ok | {:error, line :: String.t()}
  def ready(%Options{} = options),
    do: Conversions.ready(options.conversions, Commands.senses(options))

  @doc """
  Options that are allowed but unusual, one line each, with the usual number; `given` holds the
  options as they were written.

      iex> given = [port: "/dev/ttyR0", conversions: [distance: 31.387]]
      iex> {:ok, options} = Hal.RFlex.Options.new(given)
      iex> Hal.RFlex.OptionCheck.odd(options, given)
      ["conversions.distance: 31.387 units a metre is odd; 31387.0 is usual"]
  """
  @spec odd(Options.t(), keyword()) :: [String.t()]
  def odd(%Options{} = options, given) do
    Enum.filter([baud(options.speed) | boards(options, given) ++ conversions(options)], & &1)
  end

  defp baud(@baud), do: nil
  defp baud(speed), do: "speed: #{speed} baud is odd; #{@baud} is usual"

  # Boards are taken for full unless the options say otherwise.
  defp boards(options, given) do
    for key <- [:sonar_banks, :ir_banks], given[key] == nil do
      banks = Map.fetch!(options, key)
      count = Enum.sum(banks)

      if rem(count, 8) != 0,
        do:
          "#{key}: is not given, and #{count} poses are not full boards of 8 " <>
            "(#{count - rem(count, 8)} or #{count - rem(count, 8) + 8} would be); " <>
            "taken for #{inspect(banks, charlists: :as_lists)}"
    end
  end

  defp conversions(%{conversions: conversions, profile: profile}) do
    usual = Conversions.published(profile.rflex) ++ [range: Conversions.range()]
    words = [distance: "units a metre", angle: "units a radian", range: "units a metre of sonar"]

    for {key, usual} <- usual, value = Map.fetch!(conversions, key) do
      if value > usual * @factor or value * @factor < usual,
        do: "conversions.#{key}: #{number(value)} #{words[key]} is odd; #{number(usual)} is usual"
    end
  end

  # Writes 190000.0, not 1.9e5.
  defp number(value), do: :erlang.float_to_binary(value, [:compact, decimals: 6])
end
