defmodule Hal.Create.Readings do
  @moduledoc false
  # Turns the reports of a Create 2 into readings. Pure; times are whole milliseconds.
  alias Hal.{Create, SerialBase}
  import Bitwise

  # 508.8 counts a turn of a wheel of 72 mm.
  @metres_per_count 4.44565e-4
  @wheel_base 0.235
  @max_wheel 0.5
  # Frames come every 15 ms, without a time of their own: a speed is that of some of them.
  @speed_ms 60
  # After so long without a frame the counters may be those of a base that was switched off and on.
  @gone_ms 500
  @safe 2

  @enforce_keys [:odometry, :bumpers]
  defstruct @enforce_keys ++ [report: nil, heard_ms: nil]

  @type t :: %__MODULE__{}

  @doc "The state before the first frame; `bumpers` is how many the body has round it, `before` the odometry of the same base."
  @spec new(bumpers :: non_neg_integer(), SerialBase.Odometry.t() | nil) :: t()
  def new(bumpers, before) do
    odometry = before || SerialBase.Odometry.new(16, @metres_per_count, @wheel_base, @max_wheel)

    %__MODULE__{odometry: odometry, bumpers: bumpers}
  end

  @doc "Takes a report."
  @spec report(t(), Create.report(), integer()) :: {[Hal.Drive.reading()], t()}
  def report(%__MODULE__{} = senses, report, at_ms) do
    senses = %{senses | report: report, heard_ms: at_ms}
    {wheels, senses} = wheels(senses, at_ms - elem(senses.odometry.last || {0, 0, 0}, 2), at_ms)
    {wheels, senses}
  end

  defp wheels(%{odometry: %{last: last}} = senses, since_ms, _at_ms)
       when last != nil and since_ms < @speed_ms,
       do: {[], senses}

  defp wheels(%{report: report} = senses, since_ms, at_ms) do
    counters = %{
      left: report.left,
      right: report.right,
      at_ms: at_ms,
      elapsed_ms: nil,
      turn: nil,
      restarted?: since_ms >= @gone_ms
    }

    {odometry, counted} = SerialBase.Odometry.report(senses.odometry, counters)
    wheels = if odometry, do: [odometry: odometry], else: []

    {wheels ++ bumpers(senses) ++ [power: report.millivolts / 1_000],
     %{senses | odometry: counted}}
  end

  defp bumpers(%{bumpers: 0}), do: []

  # One bumper with a switch at either side; both are pressed in front.
  defp bumpers(%{bumpers: count, report: %{bumps_drops: bits}}) do
    eighth = round(count / 8)

    case bits &&& 3 do
      0 -> [bumpers: []]
      1 -> [bumpers: [rem(count - eighth, count)]]
      2 -> [bumpers: [eighth]]
      3 -> [bumpers: [0]]
    end
  end

  @doc "Whether the base may have power for its wheels: nothing is in the way of the safe mode."
  @spec clear?(t()) :: boolean()
  def clear?(%__MODULE__{report: nil}), do: false
  def clear?(%__MODULE__{} = senses), do: danger(senses) == :ok

  @doc "Whether its wheels have power."
  @spec safe?(t()) :: boolean()
  def safe?(%__MODULE__{report: report}), do: report != nil and report.mode == @safe

  @doc "Whether the wheels may turn."
  @spec able(t()) :: :ok | {:error, line :: String.t()}
  def able(%__MODULE__{report: nil}), do: {:error, "it has not reported its sensors yet"}

  def able(%__MODULE__{report: %{mode: mode}} = senses) do
    cond do
      danger(senses) != :ok -> danger(senses)
      mode == @safe -> :ok
      true -> {:error, "it has left the mode in which it drives (#{mode(mode)})"}
    end
  end

  defp danger(%{report: report}) do
    drops =
      for {bit, name} <- [{8, "left"}, {4, "right"}, {16, "caster"}],
          (report.bumps_drops &&& bit) != 0,
          do: name

    cliffs =
      for {key, name} <- [
            cliff_left: "left",
            cliff_front_left: "front left",
            cliff_front_right: "front right",
            cliff_right: "right"
          ],
          report[key] != 0,
          do: name

    strained =
      for {bit, name} <- [{16, "left"}, {8, "right"}], (report.overcurrent &&& bit) != 0, do: name

    cond do
      drops != [] ->
        {:error, "a wheel hangs in the air (#{Enum.join(drops, ", ")}): put it down"}

      cliffs != [] ->
        {:error, "there is no floor under it (#{Enum.join(cliffs, ", ")}): take it from there"}

      report.charger != 0 ->
        {:error, "it is on its charger: take it off"}

      strained != [] ->
        {:error, "a wheel draws too much current (#{Enum.join(strained, ", ")}): free it"}

      true ->
        :ok
    end
  end

  defp mode(0), do: "off"
  defp mode(1), do: "passive"
  defp mode(3), do: "full"
  defp mode(other), do: "#{other}"
end
