defmodule Swarm.EStop.HeldTest do
  use ExUnit.Case, async: true
  alias Hal.{Pose, Profile}
  alias Robot.Control.Executive
  alias Swarm.{Member, StandMission}

  # Executive and pilot hear of a stop from the e-stop role, and the executive hears from the pilot that the mission has
  # ended: three senders, in any order.
  test "a robot that was stopped and reset takes goals again, in whatever order its roles hear each other" do
    for seed <- 1..200 do
      member =
        Member.new(
          id: :mag1,
          profile: Profile.magellan(),
          start: Pose.new(0, 0),
          mission: {StandMission, []},
          order: {seed, 2, 3}
        )

      {stopped, effects} = Member.step(member, {:command, :estop, 100})
      assert {seed, {:reply, :ok}} == {seed, List.keyfind(effects, :reply, 0)}
      assert %{controller: %{module: nil}} = Member.role(stopped, :executive)

      {reset, effects} = Member.step(stopped, {:command, :reset, 200})
      assert {seed, {:reply, :ok}} == {seed, List.keyfind(effects, :reply, 0)}
      assert {seed, []} == {seed, Member.role(reset, :executive).holds}
    end
  end

  test "a hold that arrives after its stand drops no goal; other halts hold on" do
    member =
      Member.new(
        id: :mag1,
        profile: Profile.magellan(),
        start: Pose.new(0, 0),
        mission: {StandMission, []}
      )

    hear = fn executive, message ->
      {executive, _effects} = Executive.handle({:cast, message}, 100, executive, %{})
      executive
    end

    executive = Member.role(member, :executive)
    goal = {:obey, {:goal, :go, {Robot.Behaviour.Stop, []}}}
    armed = %{arming: {%{state: :armed, why: nil}, 0}}

    stood = hear.(executive, {:stand, 1, nil})
    {going, _effects} = Executive.handle({:cast, goal}, 100, stood, armed)
    assert going.controller.module == Robot.Behaviour.Stop
    assert hear.(going, {:hold, 1}).controller.module == Robot.Behaviour.Stop
    assert %{holds: [2], controller: %{module: nil}} = hear.(going, {:hold, 2})

    twice = executive |> hear.({:hold, 1}) |> hear.({:disarmed, 2}) |> hear.({:stand, 1, nil})
    assert twice.holds == [2]
    {refused, []} = Executive.handle({:cast, goal}, 100, twice, armed)
    assert refused.controller.module == nil
    assert hear.(twice, {:stand, 2, nil}).holds == []
    # A pilot that begins anew: what the former one was told is lost.
    assert hear.(twice, {:stand, :all, nil}).holds == []

    # Holds that were lost fill no memory.
    many = Enum.reduce(1..1_000, executive, &hear.(&2, {:stand, &1, nil}))
    assert length(many.stood) == 16
  end
end
