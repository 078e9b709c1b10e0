defmodule Robot.TraceTest do
  @moduledoc "What the processes do is what the functions say: recorded inputs, fed to both."
  use Robot.Case, async: true
  alias Hal.{Odometry, Pose}
  alias Robot.Role
  @moduletag :realtime

  test "gate, executive and pilot do what the pure functions do on the same input" do
    start = Pose.new(1, 2)
    roll = fn v -> {:goal, :roll, {Acts.Roll, twist: Twist.new(v, 0.1)}} end

    table = :ets.new(__MODULE__, [:ordered_set, :public])

    id =
      robot(:trace1,
        start: start,
        ptz: {Hal.FakePtz, test: self(), device: :ptz},
        mission: {Acts.Mission, test: self(), effects: [roll.(0.3), {:look, 0.5}]},
        trace: {__MODULE__, :record, [table]}
      )

    drive = Names.whereis(id, :drive)
    free = List.duplicate(5.1, 16)
    odometry = fn x -> {:odometry, %Odometry{pose: Pose.new(x, 0), twist: Twist.zero()}} end

    send(drive, {:readings, [odometry.(0.0), {:sonar, free}]})
    :ok = Pilot.start(id)
    two_ticks()
    send(drive, {:readings, [odometry.(0.1), {:sonar, List.replace_at(free, 11, 0.4)}]})
    two_ticks()
    :ok = Pilot.command(id, {:do, :ready, [roll.(0.2), {:stage, :faster, %{}}]})
    two_ticks()
    send(drive, {:readings, [odometry.(0.2), {:bumpers, [0, 1]}, {:sonar, free}]})
    Pilot.hear(id, {:message, %{hello: 1}})
    two_ticks()
    :ok = Gate.estop(id)
    two_ticks()
    :ok = Gate.reset(id)
    goal = {:goal, :end, {Acts.Roll, outcome: 5, twist: Twist.zero()}}
    :ok = Pilot.command(id, {:do, :ready, [goal, {:look, nil}]})
    assert_receive {:mission, {:outcome, :end, 5}}
    two_ticks()
    stop_supervised!(id)

    entries = for {_order, entry} <- :ets.tab2list(table), do: entry

    assert compare(entries, :gate, begun(entries, :gate), handle(Gate)) > 20
    assert compare(entries, :executive, begun(entries, :executive), handle(Executive)) > 20
    assert compare(entries, :pilot, begun(entries, :pilot), handle(Pilot)) > 6
  end

  @doc false
  def record(table, entry), do: :ets.insert(table, {System.unique_integer([:monotonic]), entry})

  defp two_ticks do
    for _ <- 1..2, do: assert_receive({:mission, {:tick, _}})
  end

  # Plays the role's recorded inputs to the function, and compares. The robot was switched off in
  # the middle of something, so its last effects may be missing.
  defp compare(entries, role, state, step) do
    inputs = for {^role, :input, what, at_ms} <- entries, do: {what, at_ms}
    effects = for {^role, :effect, what, _} <- entries, do: what

    {expected, _state} =
      Enum.flat_map_reduce(inputs, state, fn {what, at_ms}, state -> step.(what, at_ms, state) end)

    assert List.starts_with?(expected, effects)
    assert length(expected) - length(effects) < 4
    length(effects)
  end

  # Its wheels are armed, or an order would not be recorded.
  defp handle(role) do
    board = %{arming: {%{state: :armed, why: nil}, 0}}

    fn input, at_ms, state ->
      {state, effects} = role.handle(input, at_ms, state, board)
      {for(e <- effects, Role.recorded?(e), do: Role.recorded(e)), state}
    end
  end

  defp begun(entries, role) do
    assert [state] = for({^role, :begin, state, _at_ms} <- entries, do: state)
    state
  end
end
