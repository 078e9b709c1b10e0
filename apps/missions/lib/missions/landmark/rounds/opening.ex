defmodule Missions.Landmark.Rounds.Opening do
  @moduledoc "Decides when a robot opens a round of the landmark mission, and when it leaves one. Pure."
  alias Missions.Landmark
  alias Missions.Landmark.{Claim, Lookout, Merge, Policy}
  alias Missions.Landmark.Leader.Loss
  alias Missions.Landmark.Rounds.View
  alias Swarm.Agreement.Round
  alias Swarm.Membership.NameSet

  # Heartbeats come at 5 Hz: after this time the view has settled.
  @settle_ms 600
  @late_ms 1_500
  # How long a round waits for reports: longer than a scan takes, and than a letter is under way.
  @search_ms 30_000
  @change_ms 2_000
  # A leader without a sign of life for this long is lost.
  @lost_ms 2_000

  @doc "One tick: opens a round, opens another in place of one, or leaves one."
  @spec update(Landmark.State.t()) :: Landmark.State.t()
  def update(mission) do
    view = View.view(mission)
    since = mission.now_ms - mission.since_ms

    cond do
      Round.open?(mission.round) and overtaken?(mission) ->
        %{mission | round: Round.leave(mission.round)}

      Round.open?(mission.round) ->
        reopen(mission, view, since)

      mission.challenge == :open ->
        start(mission, view, :change)

      Merge.due?(mission) ->
        start(mission, view, :change)

      mission.phase == :follow and leader_lost?(mission) ->
        start(mission, view, :change)

      # It has just looked around itself.
      Loss.over?(mission) ->
        start(%{mission | scan: :nothing}, view, :search)

      mission.verdict != nil or View.leading_epoch(mission) >= 0 ->
        mission

      mission.phase == :search and not Lookout.alone?(mission) and turn?(mission, view, since) ->
        start(mission, view, :search)

      mission.phase == :agree and turn?(mission, view, since) ->
        start(mission, view, purpose(mission))

      true ->
        mission
    end
  end

  # The first robot of the view opens; if it is deaf or frozen, another one does so a little
  # later.
  defp turn?(mission, view, since),
    do: (since >= @settle_ms and hd(view) == mission.me) or since >= @late_ms

  defp purpose(%{scan: nil}), do: :change
  defp purpose(_scanned), do: :search

  # While this robot waited, others have elected a leader, and it joins by their anchor. Once its
  # digest is out, the round has to end by itself, because the others may wait for it.
  defp overtaken?(%{round: %{phase: :digest}}), do: false

  defp overtaken?(%{round: %{id: {epoch, _counter, _initiator}}} = mission),
    do: epoch <= View.leading_epoch(mission)

  # A round would wait in vain for a member that is gone, and leave out one that came. A robot
  # that has only just been switched on has heard none yet, but then none is gone.
  defp reopen(%{round: %{view: view}} = mission, view, _since), do: mission

  defp reopen(%{round: round} = mission, view, since) do
    gone? = since >= @settle_ms and Enum.any?(round.view, &(&1 not in view))
    came? = round.phase == :collect and hd(view) == mission.me and view -- round.view != []

    if gone? or came?,
      do: start(mission, view, round.purpose),
      else: mission
  end

  @doc "Opens a round among a view, if the policy lets this robot."
  @spec start(Landmark.State.t(), [atom()], :search | :change) :: Landmark.State.t()
  def start(mission, view, purpose) do
    if Policy.may_open?(mission, length(view)),
      do: begin(mission, view, purpose),
      else: give_up(mission)
  end

  # Once its digest is out, a round ends by itself.
  defp give_up(%{round: %{phase: phase}} = mission) when phase in [:collect, :echo],
    do: %{mission | round: Round.leave(mission.round), challenge: nil}

  defp give_up(mission), do: %{mission | challenge: nil}

  defp begin(mission, view, purpose) do
    length = if purpose == :search, do: @search_ms, else: @change_ms
    same? = Round.open?(mission.round)
    known = for {_id, beat} <- View.beats(mission), do: Claim.of(beat).epoch
    epoch = if same?, do: elem(mission.round.id, 0), else: Enum.max([mission.epoch | known]) + 1
    round = Round.open(mission.round, epoch, view, purpose, length, mission.now_ms)
    %{mission | round: round, challenge: nil}
  end

  # The anchor is the leader's sign of life, however it arrives; a leader that others still hear
  # is not gone, and its anchor will arrive along the chain.
  defp leader_lost?(%{anchor_ms: at_ms, now_ms: now} = mission) do
    now - max(at_ms || mission.since_ms, mission.since_ms) >= @lost_ms and
      not heard_by_others?(mission)
  end

  defp heard_by_others?(mission) do
    peers = View.beats(mission)

    case peers[mission.leader] do
      nil -> Enum.any?(peers, fn {_id, beat} -> NameSet.member?(beat.heard, mission.leader) end)
      beat -> beat.phase == :lead
    end
  end
end
