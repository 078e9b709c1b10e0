defmodule Robot.Mission.ManualTest do
  use ExUnit.Case, async: true
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

  test "each command is a goal of its own, and its outcome ends it" do
    {:goto, mission, [{:goal, tag, {Goto, x: 2.0, y: 1.0}} | _]} = tell(new(), "goto:2:1")
    {:goto, mission, [{:goal, next, _} | _]} = tell(mission, "goto:2:1")
    assert next != tag
    assert {:goto, ^mission, []} = Manual.handle({:outcome, tag, 1}, mission)

    assert {:done, _mission, [{:claim, %{standing: true}}]} =
             Manual.handle({:outcome, next, 1}, mission)
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
end
