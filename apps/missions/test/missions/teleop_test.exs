defmodule Missions.TeleopTest do
  use ExUnit.Case, async: true
  alias Missions.Teleop
  alias Robot.Behaviour.{Move, Stop}
  alias Robot.Mission.Runner

  defp started(options \\ []) do
    {:ok, options} = Robot.Mission.check_options(Teleop, options, nil)
    {runner, []} = Runner.start(Runner.new(:mag1, nil), Teleop, options)
    Runner.handle(runner, {:command, :start})
  end

  defp goal(effects), do: for({:goal, tag, goal} <- effects, do: {tag, goal})
  defp says(effects), do: for({:claim, %{says: says}} <- effects, do: says)

  test "it stands, drives by words, each a new one, and stands when they end" do
    {runner, effects} = started()
    assert goal(effects) == [{:stand, {Stop, []}}]
    assert says(effects) == ["waits for a hand"]

    {runner, effects} = Runner.handle(runner, {:command, {:move, 0.3, -0.2, 0.3}})
    assert goal(effects) == [{{:word, 1}, {Move, linear: 0.3, turn: -0.2, for_ms: 300.0}}]
    assert says(effects) == ["driven: 0.30 m/s, -0.20 rad/s"]
    assert Runner.state(runner) == {Teleop, :driven}

    {runner, [_goal | _]} = Runner.handle(runner, {:command, {:move, 0.3, 0.0, 0.3}})
    # The end of a word that another has followed is none.
    {runner, []} = Runner.handle(runner, {:outcome, {:word, 1}, 1})
    assert Runner.state(runner) == {Teleop, :driven}
    {runner, effects} = Runner.handle(runner, {:outcome, {:word, 2}, 1})
    assert goal(effects) == [{:stand, {Stop, []}}]
    assert Runner.state(runner) == {Teleop, :wait}
  end

  test "nobody drives for longer or faster than it allows" do
    {runner, _effects} = started(speed: 0.2, turn: 0.5, dead_man: 0.4)

    for {command, ms} <- [{{:move, 9.0, -9.0}, 400}, {{:move, 9.0, -9.0, 60.0}, 400}] do
      {_runner, effects} = Runner.handle(runner, {:command, command})
      assert [{_tag, {Move, linear: 0.2, turn: -0.5, for_ms: for_ms}}] = goal(effects)
      assert round(for_ms) == ms
    end
  end

  test "words before a start and after a stop move nothing" do
    {:ok, options} = Robot.Mission.check_options(Teleop, [], nil)
    {runner, []} = Runner.start(Runner.new(:mag1, nil), Teleop, options)
    assert {runner, []} = Runner.handle(runner, {:command, {:move, 0.3, 0.0, 0.3}})
    {runner, _effects} = Runner.handle(runner, {:command, :start})
    {:ok, runner} = runner |> Runner.halt() |> Runner.resume()
    assert {_runner, []} = Runner.handle(runner, {:command, {:move, 0.3, 0.0, 0.3}})
  end
end
