defmodule Missions.Landmark.MarksTest do
  @moduledoc "Which robots a follower looks for in its pictures."
  use ExUnit.Case, async: true
  alias Hal.{Pose, Profile, Twist}
  alias Missions.Landmark
  alias Missions.Landmark.Marks
  alias Robot.Percept
  alias Missions.Landmark.Reference
  alias Swarm.Membership.Heartbeat
  doctest Marks

  # Robots in a row, a metre apart, of which :r0 leads and :r60 looks; behind it stand as many as before it.
  defp looked_for(robots, order) do
    peers = for i <- 0..(robots - 1), i != 60, into: %{}, do: {:"r#{i}", peer(1.0 * i)}

    percept = %Percept{
      robot: :r60,
      at_ms: 0,
      profile: Profile.magellan(),
      pose: Pose.new(60, 0),
      peers: peers
    }

    anchor = %Reference{
      leader: :r0,
      epoch: 1,
      sequence: 1,
      pose: {0, 0, 0},
      twist: {0, 0},
      formation: {:column, 1.0},
      order: order,
      size: robots,
      places: Enum.to_list(1..(robots - 1))
    }

    mission = %Landmark.State{
      me: :r60,
      formation: {:column, 1.0},
      assign: :cost,
      leader_change?: true,
      anchor: anchor,
      anchor_ms: 0,
      now_ms: 0,
      percept: percept
    }

    marks = for %{kind: :robot} = mark <- Marks.anchors(mission).marks, do: mark
    {Enum.sort(for %{key: {:robot, id}} <- marks, do: id), Enum.filter(marks, & &1.reference?)}
  end

  defp peer(x) do
    claim = Robot.Mission.Claim.new(Landmark, %{epoch: 1, sd: {50, 50, 0}})

    beat = %Heartbeat{
      boot: 1,
      sequence: 1,
      pose: {round(1000 * x), 0, 0},
      twist: {0, 0},
      leader: :r0,
      phase: :follow,
      claim: claim
    }

    %{
      pose: Pose.new(x, 0),
      twist: Twist.zero(),
      radius: 0.2,
      at_ms: 0,
      mode: :holding,
      beat: beat
    }
  end

  defp names(numbers), do: Enum.sort(for i <- numbers, do: :"r#{i}")

  test "of a large fleet the leader, the twenty nearest, and the twenty nearest of those ahead" do
    order = for i <- 1..119, do: :"r#{i}"
    assert {looked_for, references} = looked_for(120, order)
    assert looked_for == names([0 | Enum.to_list(40..59) ++ Enum.to_list(61..70)])

    assert Enum.sort(for %{key: {:robot, id}} <- references, do: id) ==
             names([0 | Enum.to_list(40..59)])
  end

  test "those ahead may be far away" do
    order = for i <- 1..119, do: :"r#{120 - i}"
    assert {looked_for, _references} = looked_for(120, order)
    assert looked_for == names([0 | Enum.to_list(50..59) ++ Enum.to_list(61..80)])
  end
end
