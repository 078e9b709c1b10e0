defmodule Sim.PlainBase do
  @moduledoc "A base that obeys lines `v LINEAR TURN` at once and for ever, and reports its pose ten times a second."
  @behaviour Sim.Emulator.Core
  alias Hal.{Pose, Twist}

  @period_ms 100

  @impl Sim.Emulator.Core
  def new([], at_ms),
    do: {:ok, %{rest: "", twist: Twist.zero(), pose: Pose.new(0, 0), at_ms: at_ms}}

  @impl Sim.Emulator.Core
  def hear(core, bytes, _at_ms) do
    {lines, [rest]} = (core.rest <> bytes) |> String.split("\n") |> Enum.split(-1)
    Enum.reduce(lines, %{core | rest: rest}, &obey/2)
  end

  defp obey("v " <> numbers, core) do
    with [{linear, " " <> turn}] <- [Float.parse(numbers)],
         {turn, ""} <- Float.parse(turn),
         do: %{core | twist: Twist.new(linear, turn)},
         else: (_noise -> core)
  end

  defp obey(_noise, core), do: core

  @impl Sim.Emulator.Core
  def feel(core, _reading, _at_ms), do: core

  @impl Sim.Emulator.Core
  def run(core, at_ms) when at_ms < core.at_ms + @period_ms, do: {"", [], core}

  def run(%{twist: twist} = core, at_ms) do
    seconds = (at_ms - core.at_ms) / 1_000
    pose = Pose.compose(core.pose, Pose.new(twist.linear * seconds, 0, twist.turn * seconds))
    report = "o #{pose.x} #{pose.y} #{pose.heading} #{twist.linear} #{twist.turn}\n"
    {report, [], %{core | pose: pose, at_ms: at_ms}}
  end

  @impl Sim.Emulator.Core
  def next_ms(core), do: core.at_ms + @period_ms

  @impl Sim.Emulator.Core
  def restart(_core, at_ms), do: [] |> new(at_ms) |> elem(1)

  @impl Sim.Emulator.Core
  def wheels(core, _at_ms), do: core.twist
end
