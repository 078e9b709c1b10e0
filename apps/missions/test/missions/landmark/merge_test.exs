defmodule Missions.Landmark.MergeTest do
  @moduledoc "Which robots a leader leaves to another one when two parts of a fleet meet."
  use ExUnit.Case, async: true
  alias Missions.Landmark
  alias Missions.Landmark.{Beat, Merge}

  defp beat(phase, leader), do: Beat.new(phase: phase, leader: leader, epoch: 2)

  # What mag1, which leads, hears of the others.
  defp theirs(beats) do
    peers = Map.new(beats, fn {id, beat} -> {id, %{at_ms: 1_000, beat: beat}} end)

    mission = %Landmark.State{
      me: :mag1,
      formation: {:line, 1.0},
      assign: :cost,
      leader_change?: true,
      phase: :lead,
      now_ms: 1_000,
      percept: %{peers: peers}
    }

    beats |> Keyword.keys() |> Merge.theirs(mission)
  end

  test "another leader keeps its followers" do
    assert theirs(mag2: beat(:lead, :mag2), mag3: beat(:follow, :mag2)) == [:mag2, :mag3]
  end

  test "a follower that is heard before its leader stays with it, too" do
    assert theirs(mag3: beat(:follow, :mag2)) == [:mag3]
  end

  test "a robot is free if it is alone, this leader's follower, or its leader no longer leads" do
    assert theirs(
             mag2: beat(:follow, :mag1),
             mag3: beat(:agree, nil),
             mag4: beat(:follow, :mag2),
             mag5: beat(:search, nil)
           ) == []
  end
end
