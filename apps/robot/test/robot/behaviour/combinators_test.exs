defmodule Robot.Behaviour.CombinatorsTest do
  use ExUnit.Case, async: true
  alias Hal.{Pose, Profile}
  alias Robot.{Body, Percept}
  alias Robot.Behaviour.{Fsm, Goto, Move, Once, Parallel, Rest, Sequence, Wander}
  alias Robot.Behaviour.Decorator.{Every, Until}

  defp percept(at_ms), do: %Percept{robot: :mag1, at_ms: at_ms, profile: Profile.magellan()}

  # Ticks each 100 ms until it ends; gives the outcome, when, and who wished.
  defp run(behaviour, at_ms \\ 0, by \\ [])
  defp run(_behaviour, at_ms, by) when at_ms > 5000, do: {:never, at_ms, Enum.reverse(by)}

  defp run(behaviour, at_ms, by) do
    case Robot.Behaviour.tick(behaviour, percept(at_ms)) do
      {:running, wish, behaviour} -> run(behaviour, at_ms + 100, [wish && wish.by | by])
      {:done, outcome, _wish} -> {outcome, at_ms, Enum.reverse(by)}
    end
  end

  defp move(for_ms), do: Move.new(linear: 0.1, turn: 0.0, for_ms: for_ms)
  defp once(outcome), do: Once.new(run: fn _percept -> outcome end)

  test "once ends at once" do
    assert {7, 0, []} = run(once(7))
  end

  test "every starts again each period, and never ends" do
    assert {:never, _, by} =
             run(Every.new(start: {Move, linear: 0.1, turn: 0.0, for_ms: 200}, period_ms: 1000))

    assert Enum.slice(by, 0, 13) ==
             [:move, :move, :move] ++ List.duplicate(nil, 7) ++ [:move, :move, :move]
  end

  test "until ends by condition, by time, or with its inner one" do
    assert {2, 1000, _} = run(Until.new(inner: Rest.new([]), stop?: &(&1.at_ms >= 1000)))
    assert {5, 600, _} = run(Until.new(inner: Rest.new([]), after_ms: 600, outcome: 5))
    assert {1, 300, _} = run(Until.new(inner: move(300), after_ms: 600))
    assert_raise ArgumentError, ~r/after_ms is missing/, fn -> Until.new(inner: Rest.new([])) end
  end

  test "a sequence runs one after another; the outcome is the last one's" do
    assert {9, 500, _} = run(Sequence.new(steps: [move(200), move(300), once(9)]))
    assert {0, 0, _} = run(Sequence.new(steps: [once(0), move(300)], while: 1))
    assert {1, 300, _} = run(Sequence.new(steps: [once(1), move(300)], while: 1))
  end

  test "parallel parts end all or any, and the heaviest wish counts" do
    assert {1, 400, by} = run(Parallel.new(parts: [move(200), move(400), once(3)]))
    assert Enum.uniq(by) == [:move]
    assert {3, 0, _} = run(Parallel.new(parts: [move(200), once(3)], ends: :any))
    assert {:never, _, [:rest | _]} = run(Parallel.new(parts: [Rest.new([]), once(3)]))
  end

  test "outcomes pick the transition of a machine" do
    states = %{
      a: {Move, linear: 0.1, turn: 0.0, for_ms: 200},
      b: {Once, run: &div(&1.at_ms, 400)}
    }

    machine = Fsm.new(start: :a, states: states, next: %{{:a, 1} => :b, {:b, 0} => :a})
    assert {1, 400, _} = run(machine)
    assert Fsm.at(machine) == :a
    any = Fsm.new(start: :a, states: states, next: %{{:a, :any} => :b})
    assert {0, 200, _} = run(any)
    # A machine that turns in circles holds up nobody.
    spin = Fsm.new(start: :b, states: %{b: {Once, run: fn _ -> 0 end}}, next: %{{:b, 0} => :b})
    assert {:never, _, _} = run(spin)

    assert_raise ArgumentError, ~r/:c, which is not a state/, fn ->
      Fsm.new(start: :a, states: states, next: %{{:a, 1} => :c})
    end
  end

  test "a robot can be sent from place to place" do
    route =
      Sequence.new(steps: [Goto.new(x: 1, y: 0), Goto.new(x: 1, y: 1), Goto.new(x: 0, y: 0)])

    body = Body.new(Pose.new(0, 0))

    controller =
      Robot.Control.Controller.goal(
        body.controller,
        :route,
        {Sequence, steps: elem(route, 1).steps}
      )

    assert {{:route, 1}, body} = Body.run(%{body | controller: controller}, 400)
    assert Pose.distance(body.pose, {0.0, 0.0}) < 0.11
  end

  test "wandering turns away from a wall and goes on" do
    wall = fn p -> %{p | sonar: List.replace_at(p.sonar, 11, max(0.0, 1.5 - p.pose.x))} end
    body = Body.new(Pose.new(0, 0))

    {nil, body} =
      Body.run(
        %{body | controller: Robot.Control.Controller.goal(body.controller, 1, {Wander, []})},
        60,
        wall
      )

    assert body.pose.x < 1.5
    assert abs(body.pose.heading) > 0.2
  end
end
