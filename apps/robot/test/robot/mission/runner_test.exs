defmodule Robot.Mission.RunnerTest do
  @moduledoc "A mission begins, hears, is halted and resumed; idle it hears nothing."
  use ExUnit.Case, async: true
  alias Robot.Localiser.Anchors
  alias Robot.Mission.Runner

  defmodule Count do
    @moduledoc "Counts what it hears, and claims it."
    @behaviour Robot.Mission

    @impl Robot.Mission
    def init(robot, options),
      do: {:fresh, options[:from], [{:stage, :begun, %{robot: robot}}]}

    @impl Robot.Mission
    def handle({:command, {:order, order}}, n), do: {:counting, n, [order]}

    def handle(_event, n),
      do: {:counting, n + 1, [{:claim, %{heard: n + 1}}, {:send, :all, %{n: n}}]}

    @impl Robot.Mission
    def halted(0), do: nil
    def halted(n), do: -n
  end

  test "idle, there is nothing to hear, to halt or to resume" do
    idle = Runner.new(:mag1)
    assert Runner.state(idle) == :idle
    assert Runner.handle(idle, {:command, :go}) == {idle, []}
    assert Runner.halt(idle) == idle
    assert Runner.resume(idle) == {:error, :idle}
  end

  test "a start, events, a stop and what it leaves" do
    assert {runner, [{:stage, :begun, %{robot: :mag1}}]} =
             Runner.start(Runner.new(:mag1), Count, from: 3)

    assert Runner.state(runner) == {Count, :fresh}
    {runner, effects} = Runner.handle(runner, {:message, %{}})
    assert effects == [{:claim, %{heard: 4}}, {:send, :all, %{n: 3}}]
    assert {Runner.state(runner), runner.claim} == {{Count, :counting}, %{heard: 4}}

    stopped = Runner.halt(runner)
    assert {Runner.state(stopped), stopped.claim} == {:idle, %{}}
    assert Runner.handle(stopped, {:command, :go}) == {stopped, []}
    assert Runner.halt(stopped) == stopped

    assert {:ok, resumed} = Runner.resume(stopped)
    assert {resumed.module, resumed.mission, resumed.halted} == {Count, -4, nil}
    assert Runner.resume(resumed) == {:error, :idle}

    # Another start forgets what was left.
    {fresh, _} = Runner.start(stopped, Count, from: 0)
    assert {fresh.mission, fresh.claim, fresh.halted} == {0, %{}, nil}
    assert Runner.resume(Runner.halt(fresh)) == {:error, :idle}
  end

  test "an order that is not one is the mission's fault" do
    {runner, _} = Runner.start(Runner.new(:mag1), Count, from: 0)
    give = fn order -> Runner.handle(runner, {:command, {:order, order}}) end

    for order <- [
          {:goal, :t, {No.Such.Behaviour, []}},
          {:goal, :t, {Robot.Behaviour.Goto, [1 | 2]}},
          {:goal, :t},
          {:look, :left},
          {:look, Bitwise.bsl(1, 80_000)},
          {:anchors, %{}}
        ],
        do: assert_raise(ArgumentError, fn -> give.(order) end)

    assert_raise ArgumentError, ~r/option x: expected .*, got :far/, fn ->
      give.({:goal, :t, {Robot.Behaviour.Goto, x: :far, y: 2.0}})
    end

    for order <- [{:goal, :t, nil}, {:look, nil}, {:look, 1}, {:anchors, %Anchors{}}],
        do: assert({_runner, [^order]} = give.(order))
  end
end
