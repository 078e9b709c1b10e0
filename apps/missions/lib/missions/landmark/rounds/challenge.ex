defmodule Missions.Landmark.Rounds.Challenge do
  @moduledoc false
  # Decides when a follower asks for a new leader:
  #
  # | reason | it holds for | no earlier in a reign than |
  # |---|---|---|
  # | `nearer`: it sees the landmark nearer than the leader does, by 0.5 m or a fifth of the distance | 2 s | 10 s |
  # | `gone`: the leader does not see it, and this robot, not 0.5 m farther from it, sees it elsewhere than it was | 0.5 s | 3 s |
  # | `blind`: the leader does not see the landmark, and this robot does | 3 s | 10 s |
  #
  # So leadership cannot oscillate. As long as the landmark has not moved, a robot that passes it on the way to its slot does
  # not challenge the leader. Of several that could ask, the one that sees it largest does, because a round elects that. Pure.
  alias Hal.Pose
  alias Missions.Landmark
  alias Missions.Landmark.{Claim, LandmarkTrack, SlotPoses}

  @terms %{nearer: {2_000, 10_000}, gone: {500, 3_000}, blind: {3_000, 10_000}}
  @least 500
  @share 0.2
  @moved 1.0
  @farther 0.5

  @doc "`challenge` becomes `:open` when it is time to open a round."
  @spec update(Landmark.State.t()) :: Landmark.State.t()
  def update(%{phase: :follow, leader_change?: true} = mission) do
    case reason(mission) do
      nil ->
        %{mission | challenge: nil}

      reason ->
        {dwell_ms, reign_ms} = @terms[reason]
        since = since(mission.challenge, reason, mission.now_ms)
        long? = mission.now_ms - since >= dwell_ms
        reigned? = mission.now_ms - mission.since_ms >= reign_ms
        open? = long? and reigned? and largest?(mission)
        %{mission | challenge: if(open?, do: :open, else: {reason, since})}
    end
  end

  def update(mission), do: %{mission | challenge: nil}

  defp since({reason, since}, reason, _now_ms), do: since
  defp since(_other, _reason, now_ms), do: now_ms

  defp reason(mission) do
    with true <- Landmark.State.sees?(mission),
         %{phase: :lead} = leader <- Landmark.State.beats(mission)[mission.leader] do
      reason(Claim.of(leader).sight, mission)
    else
      _unfit -> nil
    end
  end

  defp reason(nil, mission), do: if(gone?(mission), do: :gone, else: :blind)

  defp reason(theirs, mission) do
    if (mission.follower.in_place? or moved?(mission)) and nearer?(mission.sight, theirs),
      do: :nearer
  end

  # A leader that is nearer may only have lost it behind a corner, and follows it there.
  defp gone?(%{sight: sight, percept: %{pose: pose}, anchor: %{} = anchor, now_ms: now} = mission)
       when pose != nil do
    {leader, _twist} = SlotPoses.leader(anchor, now - mission.anchor_ms)

    LandmarkTrack.elsewhere?(sight, pose, SlotPoses.landmark(anchor)) and
      Pose.distance(pose, LandmarkTrack.where(sight)) <
        Pose.distance(leader, LandmarkTrack.where(sight)) + @farther
  end

  defp gone?(_knows_no_place), do: false

  defp nearer?(%{distance: mine}, %{distance: theirs}) when mine == nil or theirs == nil,
    do: false

  defp nearer?(%{distance: mine}, %{distance: theirs}),
    do: round(mine * 1000) < theirs - max(@least, theirs * @share)

  defp moved?(%{follower: %{landmark: place}, anchor: %{landmark: now}})
       when place != nil and now != nil do
    {x, y} = place
    {nx, ny} = now
    Pose.distance({x / 1000, y / 1000}, {nx / 1000, ny / 1000}) > @moved
  end

  defp moved?(_mission), do: false

  # Of robots that see it equally large, each is the largest now and then.
  defp largest?(%{sight: %{size_ppm: size}, me: me} = mission) do
    Enum.all?(Landmark.State.beats(mission), fn
      {id, %{phase: :follow} = beat} ->
        case Claim.of(beat).sight do
          %{size_ppm: other} -> {-size, me} < {-other, id}
          nil -> true
        end

      _other ->
        true
    end)
  end
end
