defmodule Missions.Landmark.Merge do
  @moduledoc false
  # Decides which leader stays when two meet, for example after a network partition. Pure.
  #
  # They hold one round, for an epoch after both, in which each reports how many robots it leads; its
  # record makes the leader of the largest part lead all (`Swarm.Agreement.Election`). The one that will
  # probably win opens the round, once it has had time to hear of all robots; if it does not, the other
  # opens it a little later. A leader that none follows joins a later one without a round. Meanwhile
  # neither takes the other's followers into its order.
  alias Missions.Landmark
  alias Missions.Landmark.Claim

  # Heartbeats come at 5 Hz: after this time all of the other part have been heard.
  @settle_ms 300
  @late_ms 700
  # A later epoch without a known leader still ends this robot's own epoch.
  @higher_ms 1_500
  # Until then followers may not have reported yet that they follow.
  @young_ms 1_000

  @doc "Notes once a tick how many robots this one leads, and since when there is another leader."
  @spec update(Landmark.State.t()) :: Landmark.State.t()
  def update(%{phase: :lead} = mission) do
    peers = peers(mission)
    rival? = rivals(peers) != []
    higher? = higher?(mission, peers)

    %{
      mission
      | led: led(mission, peers),
        rival_ms: if(rival?, do: mission.rival_ms || mission.now_ms),
        higher_ms: if(higher?, do: mission.higher_ms || mission.now_ms)
    }
  end

  def update(mission), do: %{mission | rival_ms: nil, higher_ms: nil}

  @doc "Whether this leader should open the round that joins two parts of the fleet."
  @spec due?(Landmark.State.t()) :: boolean()
  def due?(%{phase: :lead, rival_ms: since} = mission) when since != nil do
    peers = peers(mission)
    mine = {mission.led, mission.me}

    first? =
      Enum.all?(rivals(peers), fn {id, _epoch} -> mine > {1 + following(peers, id), id} end)

    mission.now_ms - since >= if(first?, do: @settle_ms, else: @late_ms)
  end

  def due?(_mission), do: false

  @doc "Whether this leader gives way without a round: a later leadership is known, and no robot follows this one."
  @spec yields?(Landmark.State.t()) :: boolean()
  def yields?(%{higher_ms: nil}), do: false

  def yields?(mission) do
    peers = peers(mission)

    cond do
      mission.now_ms - mission.higher_ms >= @higher_ms -> true
      mission.led > 1 -> false
      rivals(peers) == [] -> true
      true -> Enum.any?(rivals(peers), &joinable?(&1, mission, peers))
    end
  end

  defp joinable?({id, epoch}, mission, peers),
    do: epoch > mission.epoch and following(peers, id) > 0

  @doc """
  Those of the given robots that another leader leads now. When parts meet, a follower may be
  heard before its leader is, so a robot that follows an unheard one is not free either.
  """
  @spec theirs([atom()], Landmark.State.t()) :: [atom()]
  def theirs(ids, mission) do
    peers = peers(mission)
    for id <- ids, beat = peers[id], beat.phase == :lead or led?(beat, mission.me, peers), do: id
  end

  defp led?(%{phase: :follow, leader: leader}, me, peers) when leader not in [nil, me],
    do: match?(%{phase: :lead}, Map.get(peers, leader, %{phase: :lead}))

  defp led?(_beat, _me, _peers), do: false

  defp led(mission, peers) do
    told =
      for {_id, %{leader: leader} = beat} <- peers,
          leader == mission.me and Claim.of(beat).epoch == mission.epoch,
          reduce: 1 do
        count -> count + 1
      end

    if mission.now_ms - mission.since_ms < @young_ms,
      do: max(told, length(mission.order) + 1),
      else: told
  end

  defp following(peers, leader) do
    Enum.count(peers, fn {_id, beat} -> beat.phase == :follow and beat.leader == leader end)
  end

  defp rivals(peers), do: for({id, %{phase: :lead} = b} <- peers, do: {id, Claim.of(b).epoch})

  defp higher?(mission, peers),
    do: Enum.any?(peers, fn {_id, beat} -> Claim.of(beat).epoch > mission.epoch end)

  defp peers(mission), do: Landmark.State.beats(mission)
end
