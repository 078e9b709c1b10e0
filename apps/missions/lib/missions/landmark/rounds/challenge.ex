defmodule Missions.Landmark.Rounds.Challenge do
  @moduledoc false
  # Decides when a follower asks for a new leader: it sees the landmark nearer than the leader
  # does, by 0.5 m or a fifth of the distance, for 2 s; or the leader has not seen it for 3 s while
  # this robot does. No leader is challenged in its first 10 s, so that leadership cannot oscillate;
  # and as long as the landmark has not moved, a robot that passes it on the way to its slot does
  # not challenge the leader. Pure.
  alias Missions.Landmark
  alias Missions.Landmark.Claim

  @dwell_ms 2_000
  @blind_ms 3_000
  @reign_ms 10_000
  @least 500
  @share 0.2
  @moved 1.0

  @doc "`challenge` becomes `:open` when it is time to open a round."
  @spec update(Landmark.State.t()) :: Landmark.State.t()
  def update(%{phase: :follow, leader_change?: true} = mission) do
    case reason(mission) do
      nil ->
        %{mission | challenge: nil}

      reason ->
        since = since(mission.challenge, reason, mission.now_ms)
        long? = mission.now_ms - since >= if(reason == :nearer, do: @dwell_ms, else: @blind_ms)
        reigned? = mission.now_ms - mission.since_ms >= @reign_ms
        %{mission | challenge: if(long? and reigned?, do: :open, else: {reason, since})}
    end
  end

  def update(mission), do: %{mission | challenge: nil}

  defp since({reason, since}, reason, _now_ms), do: since
  defp since(_other, _reason, now_ms), do: now_ms

  defp reason(mission) do
    peers = Landmark.State.beats(mission)

    with true <- Landmark.State.sees?(mission),
         %{distance: mine} when mine != nil <- mission.sight,
         %{phase: :lead} = leader <- peers[mission.leader],
         sight = Claim.of(leader).sight,
         mine = round(mine * 1000),
         true <- nearest?(mine, mission.me, peers),
         true <- mission.follower.in_place? or moved?(mission) or sight == nil do
      case sight do
        nil -> :blind
        %{distance: nil} -> nil
        %{distance: theirs} -> if mine < theirs - max(@least, theirs * @share), do: :nearer
      end
    else
      _unfit -> nil
    end
  end

  defp moved?(%{follower: %{landmark: place}, anchor: %{landmark: now}})
       when place != nil and now != nil do
    {x, y} = place
    {nx, ny} = now
    Hal.Pose.distance({x / 1000, y / 1000}, {nx / 1000, ny / 1000}) > @moved
  end

  defp moved?(_mission), do: false

  # If several could ask, the nearest does.
  defp nearest?(mine, me, peers) do
    Enum.all?(peers, fn
      {id, %{phase: :follow} = beat} ->
        case Claim.of(beat).sight do
          %{distance: distance} when distance != nil -> {mine, me} < {distance, id}
          _unknown -> true
        end

      _other ->
        true
    end)
  end
end
