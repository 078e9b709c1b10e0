defmodule Missions.Landmark.Rounds.ChallengeTest do
  @moduledoc "A follower asks for a new leader when it is clearly nearer, for long enough, and not at once."
  use ExUnit.Case, async: true
  alias Missions.Landmark
  alias Missions.Landmark.{Beat, LandmarkTrack}
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
      anchor: anchor({round(metres * 1000), 0}),
      anchor_ms: 0,
      sight: sight(metres, 20_000),
      percept: %{pose: Hal.Pose.new(0, 0), peers: %{mag1: %{at_ms: 0, beat: beat}}}
    }
  end

  # Where the leader last said that the landmark was.
  defp anchor(landmark), do: Beat.anchor([:mag2], landmark)

  defp sight(metres, size_ppm),
    do: %LandmarkTrack{
      distance: metres,
      place: {metres, 0.0},
      size_ppm: size_ppm,
      bearing: 0.0,
      at_ms: 0
    }

  # When it asks, seeing the same all the time; nil if not within 30 s.
  defp asks_after(mission, from_ms) do
    Enum.reduce_while(0..30_000//100, mission, fn past, mission ->
      now = from_ms + past
      peers = Map.new(mission.percept.peers, fn {id, peer} -> {id, %{peer | at_ms: now}} end)

      mission = %{
        mission
        | now_ms: now,
          anchor_ms: now,
          percept: %{mission.percept | peers: peers}
      }

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

  test "one that sees it elsewhere than the leader last said asks after half a second, not in the first 3 s" do
    gone = %{follower(4.0, 0, nil) | anchor: anchor({-3_000, 0})}
    assert asks_after(gone, 20_000) == 500
    assert asks_after(%{gone | since_ms: 20_000}, 20_000) == 3_000
    # As far as the distance of something so far away is known.
    far = %{follower(8.0, 0, nil) | anchor: anchor({6_500, 0})}
    assert asks_after(far, 20_000) == 3_000
  end

  test "one that is farther from it than its leader asks after 3 s: the leader may follow it behind a corner" do
    gone = %{follower(4.0, 0, nil) | anchor: anchor({-3_000, 0})}
    assert asks_after(put_in(gone.anchor.pose, {400, 0, 0}), 20_000) == 500
    assert asks_after(put_in(gone.anchor.pose, {1_000, 0, 0}), 20_000) == 3_000
  end

  test "of two that see it elsewhere the one that sees it larger asks; of two equals, either" do
    gone = %{follower(4.0, 0, nil) | anchor: anchor({-3_000, 0})}

    beside = fn size ->
      beat = Beat.new(phase: :follow, sight: %{size_ppm: size, distance: nil})
      put_in(gone.percept.peers[:min1], %{at_ms: 0, beat: beat})
    end

    assert asks_after(beside.(30_000), 20_000) == nil
    assert asks_after(beside.(19_000), 20_000) == 500

    # The other is a little larger in every second picture.
    last =
      Enum.reduce(0..20, gone, fn n, mission ->
        now = 20_000 + n * 100

        mission =
          put_in(mission.percept.peers[:min1], beside.(20_000 + rem(n, 2)).percept.peers.min1)

        peers = Map.new(mission.percept.peers, fn {id, peer} -> {id, %{peer | at_ms: now}} end)

        mission = %{
          mission
          | now_ms: now,
            anchor_ms: now,
            percept: %{mission.percept | peers: peers}
        }

        if mission.challenge == :open,
          do: mission,
          else: Challenge.update(put_in(mission.sight.at_ms, now))
      end)

    assert last.challenge == :open
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
