defmodule Missions.Teleop do
  @moduledoc """
  Lets a person drive a robot, by keyboard or gamepad. It stands until a person says `move`, drives while
  that is said again, and stands again when that has not been said for `dead_man` seconds, whatever is gone: the hand, the
  window, its machine or the network. Pure; written with the interface of `Robot.Mission` alone.

  Options: `speed` (m/s) and `turn` (rad/s), its upper limits, and `dead_man` (s). The limits of the body,
  sonars and bumpers, and all stops are not its business: they hold besides.

  Its phases are `:wait` and `:driven`. Without this mission a `move` ends the mission that a robot has; within it the robot
  stays, and waits for the next hand.
  """

  @behaviour Robot.Mission

  @enforce_keys [:speed, :turn, :dead_man_ms]
  defstruct @enforce_keys ++ [phase: :idle, words: 0, twist: nil]

  @type t :: %__MODULE__{
          speed: float(),
          turn: float(),
          dead_man_ms: pos_integer(),
          phase: :idle | :wait | :driven,
          words: non_neg_integer(),
          twist: {linear :: float(), turn :: float()} | nil
        }

  @impl Robot.Mission
  def phases, do: [:idle, :wait, :driven]

  @impl Robot.Mission
  def option_table do
    [
      speed: [{:number, 0.05, 2, "m/s"}, default: 0.5],
      turn: [{:number, 0.1, 3, "rad/s"}, default: 1.0],
      dead_man: [{:number, 0.1, 1, "s"}, default: 0.5]
    ]
  end

  @impl Robot.Mission
  def messages, do: {1, []}

  @impl Robot.Mission
  def commands, do: [:move]

  @impl Robot.Mission
  def init(_robot, options) do
    dead_man_ms = round(options[:dead_man] * 1_000)

    mission = %__MODULE__{
      speed: options[:speed],
      turn: options[:turn],
      dead_man_ms: dead_man_ms
    }

    {:idle, mission, []}
  end

  @impl Robot.Mission
  def handle({:command, :start}, mission), do: wait(mission)

  # The robot drives no longer than the dead man's time without a new command.
  def handle({:command, {:move, linear, turn}}, %{dead_man_ms: ms} = mission),
    do: handle({:command, {:move, linear, turn, ms / 1_000}}, mission)

  def handle({:command, {:move, linear, turn, for_s}}, %{phase: phase} = mission)
      when phase != :idle do
    twist = {within(linear, mission.speed), within(turn, mission.turn)}
    words = mission.words + 1
    mission = %{mission | phase: :driven, words: words, twist: twist}
    for_ms = min(for_s * 1_000, mission.dead_man_ms)
    move = {Robot.Behaviour.Move, linear: elem(twist, 0), turn: elem(twist, 1), for_ms: for_ms}
    {:driven, mission, [{:goal, {:word, words}, move}, {:look, 0.0}, {:claim, claim(mission)}]}
  end

  def handle({:outcome, {:word, words}, _outcome}, %{words: words} = mission), do: wait(mission)
  def handle(_event, mission), do: {mission.phase, mission, []}

  @impl Robot.Mission
  def halted(mission), do: %{mission | phase: :idle, words: 0, twist: nil}

  @impl Robot.Mission
  def explain(%{twist: nil} = mission), do: [{"words heard", "#{mission.words}"}]

  def explain(mission),
    do: [{"words heard", "#{mission.words}"}, {"driven", driven(mission.twist)}]

  defp wait(mission) do
    mission = %{mission | phase: :wait, twist: nil}
    stand = {:goal, :stand, {Robot.Behaviour.Stop, []}}
    {:wait, mission, [stand, {:claim, claim(mission)}]}
  end

  defp within(value, most), do: value |> max(-most) |> min(most)

  defp claim(%{phase: :wait}), do: %{phase: :wait, standing: true, says: "waits for a hand"}

  defp claim(%{phase: :driven, twist: twist}),
    do: %{phase: :driven, standing: false, says: "driven: #{driven(twist)}"}

  defp driven({linear, turn}), do: "#{decimals(linear)} m/s, #{decimals(turn)} rad/s"
  defp decimals(number), do: :erlang.float_to_binary(number * 1.0, decimals: 2)
end
