defmodule Missions.Landmark.LossTest do
  @moduledoc "A leader whose landmark is gone: it waits, goes there, looks, and calls all robots to search."
  use ExUnit.Case, async: true
  alias Missions.Landmark.Group

  @lead :mag1
  @robots [:mag1, :mag2, :mag3]

  # The landmark is 1.7 m ahead of the leader, at 1.7, 0; then nobody sees it any more.
  defp leading do
    group =
      Group.new()
      |> Group.join(@lead, {0, 0}, 0.02)
      |> Group.join(:mag2, {-1, 0}, nil)
      |> Group.join(:mag3, {-2, 0}, nil)

    {true, group} = Group.until(group, 20, &Group.one?(&1, @robots))
    Group.run(group, 3)
  end

  defp lost, do: leading() |> Group.show(@lead, nil)

  defp leader(group), do: group.robots[@lead]
  defp says(group), do: leader(group).claim.says
  defp goal(group), do: leader(group).goal
  defp turned(group, heading), do: put_in(group.robots[@lead].pose.heading, heading)

  defp slots(group),
    do: for(id <- [:mag2, :mag3], {_tag, {_follow, o}} = group.robots[id].goal, do: o[:target])

  # As the behaviour says that it has ended.
  defp ended(group, outcome) do
    {tag, _behaviour} = goal(group)
    Group.event(group, @lead, {:outcome, tag, outcome})
  end

  test "it waits, goes to where it saw it last, looks around there, and then all search" do
    assert says(leading()) == nil

    waits = Group.run(lost(), 4)
    assert says(waits) == "does not see the landmark: waits"
    assert {{:track, _epoch}, _track} = goal(waits)

    goes = Group.run(waits, 2)
    assert says(goes) == "does not see the landmark: goes where it saw it last"
    assert {_tag, {Robot.Behaviour.Goto, options}} = goal(goes)
    assert_in_delta options[:x], 1.7, 0.1
    assert_in_delta options[:y], 0.0, 0.1

    # It looks around even where it did not get all the way.
    for outcome <- [0, 1, 2] do
      looks = goes |> ended(outcome) |> Group.run(0.1)
      assert says(looks) == "does not see the landmark: looks around for it"
      assert {_tag, {Robot.Behaviour.FindBlob, _options}} = goal(looks)

      searches = looks |> ended(0) |> Group.run(3)
      assert MapSet.new(Map.values(Group.phases(searches))) == MapSet.new([:wander])
      assert Enum.all?(@robots, &(:search in searches.robots[&1].phases))

      rests = Enum.reduce(1..8, searches, fn _, group -> Group.run(group, 5) end)
      assert MapSet.new(Map.values(Group.phases(rests))) == MapSet.new([:rest])
    end
  end

  test "its followers keep their places, whatever it does meanwhile" do
    before = slots(leading())

    for heading <- [0.7, 2.0, -1.5] do
      there = lost() |> Group.run(1) |> turned(heading) |> Group.run(1)
      for {a, b} <- Enum.zip(before, slots(there)), do: assert(Hal.Pose.distance(a, b) < 0.01)
    end

    # Not those of one that is gone.
    group = lost() |> Group.run(1) |> Group.kill(:mag2) |> Group.run(3)
    assert leader(group).claim.anchor.order == [:mag3]
    assert [{x, _y, _heading}] = leader(group).claim.anchor.trail
    assert_in_delta x / 1000, List.last(before).x, 0.01
  end

  test "once it sees the landmark again it goes on leading, and the shape turns with it" do
    for seconds <- [2, 6] do
      seen = lost() |> Group.run(seconds) |> Group.show(@lead, 0.02) |> Group.run(1)
      assert says(seen) == nil
      assert leader(seen).mission.phase == :lead
      assert {{:track, _epoch}, _track} = goal(seen)
      assert leader(seen).claim.anchor.trail == nil
    end
  end

  test "one that hangs on its way, or while it looks, gives that up after a minute" do
    looks = Enum.reduce(1..7, lost(), fn _, group -> Group.run(group, 10) end)
    assert says(looks) == "does not see the landmark: looks around for it"
    searches = Enum.reduce(1..6, looks, fn _, group -> Group.run(group, 10) end)
    assert leader(searches).mission.phase != :lead
  end
end
