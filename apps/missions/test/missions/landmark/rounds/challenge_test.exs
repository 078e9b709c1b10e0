defmodule Missions.Landmark.Rounds.ChallengeTest do
  @moduledoc "A follower asks for a new leader when it is clearly nearer, for long enough, and not at once."
  use ExUnit.Case, async: true
  alias Missions.Landmark
  alias Missions.Landmark.Beat
  alias Missions.Landmark.Rounds.Challenge

  # A follower in its place since `since_ms`, this far from the landmark; its leader is 3 m from it.
  defp follower(metres, since_ms, leader_sight \\ %{size_ppm: 9_000, distance: 3_000}) do
    beat = Beat.new(phase: :lead, sight: leader_sight)

    %Landmark.State{
      me: :mag2,
      formation: {:column, 1.0},
      assign: :cost,
      leader_change?: true,
      phase: :follow,
      leader: :mag1,
      since_ms: since_ms,
      follower: %{in_place?: true, landmark: nil},
      sight: %{distance: metres, size_ppm: 20_000, at_ms: 0},
      percept: %{peers: %{mag1: %{at_ms: 0, beat: beat}}}
    }
  end

  # When it asks, seeing the same all the time; nil if not within 30 s.
  defp asks_after(mission, from_ms) do
    Enum.reduce_while(0..30_000//100, mission, fn past, mission ->
      now = from_ms + past
      peers = Map.new(mission.percept.peers, fn {id, peer} -> {id, %{peer | at_ms: now}} end)
      mission = %{mission | now_ms: now, percept: %{peers: peers}}
      mission = Challenge.update(put_in(mission.sight.at_ms, now))
      if mission.challenge == :open, do: {:halt, past}, else: {:cont, mission}
    end)
    |> then(&if(is_integer(&1), do: &1))
  end

  test "a nearer follower asks after 2 s" do
    assert asks_after(follower(2.0, 0), 20_000) == 2_000
  end

  test "no leader is challenged in its first 10 s" do
    assert asks_after(follower(2.0, 20_000), 20_000) == 10_000
  end

  test "a little nearer is not enough, nor is equally near" do
    assert asks_after(follower(2.6, 0), 20_000) == nil
    assert asks_after(follower(3.0, 0), 20_000) == nil
  end

  test "a follower that sees what the leader has lost asks after 3 s" do
    assert asks_after(follower(4.0, 0, nil), 20_000) == 3_000
  end

  test "with leader changes off nobody asks" do
    assert asks_after(%{follower(2.0, 0) | leader_change?: false}, 20_000) == nil
  end

  test "a short sight only starts the time again" do
    mission = Challenge.update(%{follower(2.0, 0) | now_ms: 500, since_ms: -20_000})
    assert mission.challenge == {:nearer, 500}
    assert Challenge.update(put_in(mission.sight.distance, 3.0)).challenge == nil
  end
end
