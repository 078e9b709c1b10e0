defmodule Robot.Mission.ManualTest do
  use ExUnit.Case, async: true
  doctest Robot.Mission.Manual
  alias Hal.{Pose, Profile, Twist}
  alias Robot.Behaviour.{Follow, Goto, Stop}
  alias Robot.{Command, Percept}
  alias Robot.Mission.Manual

  defp percept(at_ms, peers),
    do: %Percept{robot: :mag1, at_ms: at_ms, profile: Profile.magellan(), peers: peers}

  defp tell(mission, text) do
    {:ok, command} = Command.parse(text, [:mag2])
    Manual.handle({:command, command}, mission)
  end

  defp new do
    {:ready, mission, _claim} = Manual.init(:mag1, [])
    mission
  end

  test "a command that it does not know, or nobody could drive, changes nothing" do
    mission = new()

    for command <- [:junk, {:move, :fast, 0.0}, {:goto, 1.0e300, 0.0, nil}, {:find_blob, [1 | 2]}],
        do: assert({:ready, ^mission, []} = Manual.handle({:command, command}, mission))
  end

  test "the camera looks where it was told, also while another command is carried out" do
    {:ready, mission, [{:look, 0.5}]} = tell(new(), "look:0.5")
    {:goto, mission, effects} = tell(mission, "goto:2:1")
    assert {:look, 0.5} in effects
    assert {:goto, mission, [{:look, -1.0}]} = tell(mission, "look:-1")
    {:move, _mission, effects} = tell(mission, "move:0.1:0")
    assert {:look, -1.0} in effects
    assert {:ready, _mission, []} = Manual.handle({:command, {:look, :left}}, new())
  end

  test "each command is a goal of its own, and its outcome ends it" do
    {:goto, mission, [{:goal, tag, {Goto, x: 2.0, y: 1.0}} | _]} = tell(new(), "goto:2:1")
    {:goto, mission, [{:goal, next, _} | _]} = tell(mission, "goto:2:1")
    assert next != tag
    assert {:goto, ^mission, []} = Manual.handle({:outcome, tag, 1}, mission)

    assert {:done, _mission, [{:claim, %{standing: true}}]} =
             Manual.handle({:outcome, next, 1}, mission)
  end

  test "a robot that does not know where it is on its plan has not arrived, and says why" do
    for {state, why} <- [
          {:lost, "lost: a third of what it hears fits the plan"},
          {:ambiguous, "two places fit: here, or 6.2,3.1"}
        ] do
      astray = %{percept(100, %{}) | uncertainty: %{radius: 0.1, place: {state, why}}}
      {:goto, mission, [{:goal, tag, _} | _]} = tell(new(), "goto:2:1")
      {:done, mission, _claim} = Manual.handle({:outcome, tag, 1}, mission)

      assert {:given_up, mission, [{:stage, :given_up, stage}, {:claim, claim}]} =
               Manual.handle({:tick, astray}, mission)

      assert stage == %{x: 2.0, y: 1.0, blocked_by: why}
      assert %{blocked_by: ^why, standing: true} = claim
      # It has said it once.
      assert {:given_up, ^mission, []} = Manual.handle({:tick, astray}, mission)
    end
  end

  test "says of a place that it may be elsewhere, if it is not sure of its pose" do
    unsure = fn radius -> %{percept(100, %{}) | uncertainty: %{radius: radius}} end
    {:goto, mission, [{:goal, tag, _} | _]} = tell(new(), "goto:2:1")
    {:done, mission, _claim} = Manual.handle({:outcome, tag, 1}, mission)
    assert {:done, ^mission, []} = Manual.handle({:tick, unsure.(0.4)}, mission)
    assert {:done, mission, [{:claim, claim}]} = Manual.handle({:tick, unsure.(1.24)}, mission)
    assert claim.says == "there by its own estimate, which may be 1.2 m off"
    assert {:done, ^mission, []} = Manual.handle({:tick, unsure.(1.24)}, mission)
  end

  test "whether a colour was found is its phase, and not only that it is done" do
    for {outcome, phase} <- [{1, :found}, {0, :not_found}] do
      {:find_blob, mission, [{:goal, tag, _} | _]} = tell(new(), "findblob:Red")

      assert {^phase, mission, [{:claim, %{standing: true}}]} =
               Manual.handle({:outcome, tag, outcome}, mission)

      assert {^phase, _mission, []} = Manual.handle({:tick, percept(100, %{})}, mission)
    end
  end

  test "every command that moves a robot has the options of its behaviour" do
    for text <- ~w(goto:1:2 goto:1:2:3 move:0.1:0 findblob findblob:Red lead follow:1:2:0) do
      assert {_phase, _, [{:goal, {:command, 1}, {module, options}}, {:look, _}, {:claim, claim}]} =
               tell(new(), text)

      assert {^module, _} = module.new(options)
      assert claim.phase == :idle
    end
  end

  test "follows what the other tells, a metre behind, and stands when it falls silent" do
    {:follow_the_leader, mission, [{:goal, _, {Stop, []}}, _, {:claim, %{leader: :mag2}}]} =
      tell(new(), "followtheleader:mag2")

    peer = %{pose: Pose.new(3, 1, :math.pi() / 2), twist: Twist.new(0.2, 0), at_ms: 500}

    assert {:follow_the_leader, mission, [{:goal, tag, {Follow, options}}]} =
             Manual.handle({:tick, percept(1_000, %{mag2: peer})}, mission)

    assert Pose.distance(options[:target], {3.0, 0.0}) < 1.0e-9
    assert {_, vy} = options[:velocity]
    assert_in_delta vy, 0.2, 1.0e-9

    assert {:follow_the_leader, mission, [{:goal, ^tag, {Stop, []}}]} =
             Manual.handle({:tick, percept(1_500, %{mag2: peer})}, mission)

    assert {:follow_the_leader, _, [{:goal, ^tag, {Follow, _}}]} =
             Manual.handle({:tick, percept(1_600, %{mag2: %{peer | at_ms: 1_550}})}, mission)
  end

  test "a way that the robot gives up is told with what blocks it, once, and is forgotten with the next command" do
    there = Map.put(percept(100, %{}), :pose, Pose.new(0, 0))
    peer = %{pose: Pose.new(0.6, 0.3), twist: Twist.new(0, 0), radius: 0.2, at_ms: 0, mode: :dead}

    for {outcome, peers, why} <- [
          {2, %{mag2: peer}, "mag2"},
          {2, %{}, "no way"},
          {0, %{}, "no way"}
        ] do
      {:goto, mission, [{:goal, tag, _} | _]} = tell(new(), "goto:2:1")

      assert {:given_up, mission, [{:claim, %{standing: true}}]} =
               Manual.handle({:outcome, tag, outcome}, mission)

      # Without a pose nothing can be said about what is in the way.
      assert {:given_up, ^mission, []} = Manual.handle({:tick, percept(100, peers)}, mission)

      assert {:given_up, mission, [stage, {:claim, claim}]} =
               Manual.handle({:tick, %{there | peers: peers}}, mission)

      assert stage == {:stage, :given_up, %{x: 2.0, y: 1.0, blocked_by: why}}
      assert claim == %{phase: :idle, standing: true, blocked_by: why}
      assert {:given_up, ^mission, []} = Manual.handle({:tick, %{there | peers: peers}}, mission)

      assert {:goto, _mission, [_goal, _look, {:claim, claim}]} = tell(mission, "goto:3:1")
      refute is_map_key(claim, :blocked_by)
    end
  end

  test "a robot that gives up where nobody gets past goes aside, and says no other word" do
    # A room of 2 m, and a corridor of 0.8 m.
    cells =
      for j <- 0..19,
          i <- 0..49,
          into: <<>>,
          do: if(i > 20 and j not in 6..13, do: <<1>>, else: <<0>>)

    grid = Nav.Grid.new(cells, {50, 20}, 0.1, {0.0, 0.0})

    for {x, aside?} <- [{0.6, false}, {3.0, true}] do
      {:goto, mission, [{:goal, tag, _} | _]} = tell(new(), "goto:4.5:1.0")
      {:given_up, mission, _claim} = Manual.handle({:outcome, tag, 2}, mission)
      percept = %{percept(100, %{}) | pose: Pose.new(x, 1.0), grid: grid}

      assert {:given_up, mission, [_stage, _claim | more]} =
               Manual.handle({:tick, percept}, mission)

      if aside? do
        assert [{:goal, aside, {Robot.Behaviour.Goto, x: to, y: _y}}] = more
        assert to < 2.0
        assert {:given_up, ^mission, []} = Manual.handle({:outcome, aside, 1}, mission)
      else
        assert more == []
      end
    end
  end

  test "a wall where a robot was sent is named" do
    cells =
      for j <- 0..9, i <- 0..29, into: <<>>, do: if(i > 20 and j < 5, do: <<1>>, else: <<0>>)

    grid = Nav.Grid.new(cells, {30, 10}, 0.1, {0.0, 0.0})
    {:goto, mission, [{:goal, tag, _} | _]} = tell(new(), "goto:2.5:0.2")
    {:given_up, mission, _claim} = Manual.handle({:outcome, tag, 0}, mission)
    percept = %{percept(100, %{}) | pose: Pose.new(0.5, 0.5), grid: grid}

    assert {:given_up, _mission,
            [{:stage, :given_up, %{blocked_by: "a wall at its goal"}}, _claim]} =
             Manual.handle({:tick, percept}, mission)
  end
end
