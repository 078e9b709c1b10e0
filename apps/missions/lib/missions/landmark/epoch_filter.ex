defmodule Missions.Landmark.EpochFilter do
  @moduledoc false
  # Excludes robots that claim an impossible epoch (`Swarm.Agreement.Round.Epochs`), because a robot that
  # believed it would count on from there. Pure.
  #
  # Such a robot stays a peer, which others avoid, but counts as one without a mission: no robot waits
  # for it or follows it. The event `:refused` names it and says what is allowed, at
  # most once in 10 s for each robot. As soon as its epochs are possible, it takes part again.
  alias Swarm.Agreement.Round
  alias Swarm.Membership.Heartbeat
  alias Missions.Landmark
  alias Missions.Landmark.Claim

  @tell_ms 10_000
  # More than any fleet has: invented names do not fill the memory.
  @most 256

  @typedoc "The refused robots, with when each was last told; and what has still to be told."
  @type t :: %__MODULE__{told: %{atom() => integer()}, untold: [map()]}
  defstruct told: %{}, untold: []

  @doc "One tick, with the epochs that others claim: the mission with a percept without the claims that are refused."
  @spec update(Landmark.State.t(), claims :: [non_neg_integer()]) :: Landmark.State.t()
  def update(%{now_ms: now} = mission, claims) do
    mission = %{mission | round: Round.Epochs.hear(mission.round, claims, now)}
    allowed = Round.Epochs.allowed(mission.round, now)

    if claims != [] and Enum.max(claims) > allowed,
      do: leave_out(mission, allowed),
      else: mission
  end

  defp leave_out(%{percept: percept} = mission, allowed) do
    beyond =
      for {id, %{beat: %Heartbeat{} = beat} = peer} <- percept.peers,
          Claim.of(beat).epoch > allowed,
          do: {id, peer}

    peers =
      Enum.reduce(beyond, percept.peers, fn {id, peer}, all -> %{all | id => idle(peer)} end)

    beyond
    |> Enum.sort_by(&elem(&1, 0))
    |> Enum.reduce(%{mission | percept: %{percept | peers: peers}}, fn {id, peer}, mission ->
      refuse(mission, id, Claim.of(peer.beat).epoch)
    end)
  end

  defp idle(%{beat: beat} = peer) do
    %{heard: heard, estop: estop, standing: standing} = beat
    said = struct!(Heartbeat, Map.take(beat, [:boot, :sequence, :pose, :twist, :radius]))
    beat = %{said | heard: heard, estop: estop, standing: standing}
    %{peer | beat: beat}
  end

  @doc "Whether the epoch of a letter or of a reference is admitted; notes it if it is not."
  @spec admit(Landmark.State.t(), atom(), non_neg_integer()) ::
          {:ok, Landmark.State.t()} | {:refused, Landmark.State.t()}
  def admit(mission, from, epoch) do
    case Round.Epochs.admit(mission.round, epoch, mission.now_ms) do
      {:ok, round} -> {:ok, %{mission | round: round}}
      {:error, _allowed} -> {:refused, refuse(mission, from, epoch)}
    end
  end

  defp refuse(%{refused: refused, now_ms: now} = mission, from, epoch) do
    told = Map.filter(refused.told, fn {_id, at_ms} -> now - at_ms < @tell_ms end)

    if is_map_key(told, from) or map_size(told) >= @most do
      mission
    else
      allowed = Round.Epochs.allowed(mission.round, now)
      about = %{from: from, epoch: epoch, allowed: allowed}
      told = Map.put(told, from, now)
      %{mission | refused: %{refused | told: told, untold: [about | refused.untold]}}
    end
  end

  @doc "What is to be told about those that were refused, as effects."
  @spec tell(Landmark.State.t()) :: {Landmark.State.t(), [{:stage, :refused, map()}]}
  def tell(%{refused: %{untold: []}} = mission), do: {mission, []}

  def tell(%{refused: refused} = mission) do
    stages = for about <- Enum.reverse(refused.untold), do: {:stage, :refused, about}
    {%{mission | refused: %{refused | untold: []}}, stages}
  end
end
