defmodule Missions.Landmark.Rounds do
  @moduledoc """
  A robot's part in the rounds of the landmark mission: when it opens one, what it reports, and
  what follows from the record. Pure.

  A round is opened for two purposes. `:search`: everybody reports after its scan. `:change`:
  everybody reports at once what it sees now, because the leader is gone, or another robot has
  come clearly nearer to the landmark (R76). Leader and
  followers stand still while a round is open, searchers once they have scanned.
  """
  alias Swarm.{Formation, Message}
  alias Swarm.Agreement.{Election, Round}
  alias Swarm.Formation.{Assignment, Chain}
  alias Swarm.Membership.{NameSet, Peers}
  alias Missions.Landmark
  alias Missions.Landmark.{Challenge, LandmarkTrack, Merge, Policy}

  # Heartbeats come at 5 Hz: after this time the view has settled.
  @settle_ms 600
  @late_ms 1_500
  # How long a round waits for reports: longer than a scan takes, and than a letter is under way.
  @search_ms 30_000
  @change_ms 2_000
  # A sighting this old still counts in a report.
  @fresh_ms 1_000
  # A leader without a sign of life for this long is lost.
  @lost_ms 2_000

  @doc "Hears a letter. A robot that is not started does not take part."
  @spec hear(Landmark.State.t(), atom(), Round.Letter.t()) :: Landmark.State.t()
  def hear(%{started?: false} = mission, _from, _letter), do: mission

  def hear(mission, from, letter),
    do: %{mission | round: Round.hear(mission.round, from, letter, mission.now_ms)}

  @doc "Whether a round waits for this robot's scan."
  @spec search?(Landmark.State.t()) :: boolean()
  def search?(%{round: round, rescan?: rescan?}),
    do:
      rescan? or (round.phase == :collect and round.purpose == :search and round.report == :busy)

  @doc """
  One tick: returns the letters to send, as effects, and the verdict of a round that has
  committed.
  """
  @spec tick(Landmark.State.t()) :: {Landmark.State.t(), [tuple()]}
  def tick(%{phase: :idle} = mission), do: {mission, []}

  def tick(mission) do
    mission = mission |> Challenge.update() |> Merge.update() |> open() |> report()
    {round, letters, event} = Round.tick(mission.round, mission.now_ms)
    mission = conclude(event, promise(event, %{mission | round: round}, mission.round.phase))
    to = List.delete(round.view, mission.me)

    effects =
      for letter <- letters, to != [], do: {:send, to, Message.new(mission.me, :round, letter)}

    {mission, effects}
  end

  @doc "All robots that take part in the mission and are not gone, including this one, sorted."
  @spec view(Landmark.State.t()) :: [atom()]
  def view(mission) do
    others = for {id, beat} <- beats(mission), beat.phase != :idle, do: id

    Enum.sort([mission.me | others])
  end

  @doc "Whether this robot hears another one that leads."
  @spec led?(Landmark.State.t()) :: boolean()
  def led?(mission), do: leading_epoch(mission) >= 0

  defp open(mission) do
    view = view(mission)
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

      mission.verdict != nil or led?(mission) ->
        mission

      mission.phase == :search and turn?(mission, view, since) ->
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
    do: epoch <= leading_epoch(mission)

  defp leading_epoch(mission) do
    for {_id, %{phase: :lead, epoch: epoch}} <- beats(mission), reduce: -1 do
      highest -> max(highest, epoch)
    end
  end

  defp beats(mission), do: Peers.taking_part(mission.percept.peers, mission.now_ms)

  # A round would wait in vain for a member that is gone, and leave out one that came. A robot
  # that has only just been switched on has heard nobody yet, but then nobody is gone.
  defp reopen(%{round: round} = mission, view, since) do
    gone? = since >= @settle_ms and Enum.any?(round.view, &(&1 not in view))
    came? = round.phase == :collect and hd(view) == mission.me and view -- round.view != []

    if gone? or came?,
      do: start(mission, view, round.purpose),
      else: mission
  end

  defp start(mission, view, purpose) do
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
    known = for {_id, beat} <- beats(mission), do: beat.epoch
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
    peers = beats(mission)

    case peers[mission.leader] do
      nil -> Enum.any?(peers, fn {_id, beat} -> NameSet.member?(beat.heard, mission.leader) end)
      beat -> beat.phase == :lead
    end
  end

  # The robot that has all digests leads, with those that sent them.
  defp promise({:commit, record}, mission, _phase) do
    case Election.leader(record.reports) do
      {:ok, leader} -> Policy.vow(mission, leader)
      _none -> mission
    end
  end

  # Another robot may have them all when this one does not.
  defp promise({:failed, _reason}, mission, :digest), do: Policy.vow(mission, nil)
  defp promise(_event, mission, _phase), do: mission

  defp report(%{round: %{phase: :collect, report: :busy} = round} = mission) do
    if Policy.bound?(mission, round.view), do: mission, else: report(mission, round.purpose)
  end

  defp report(mission), do: mission

  defp report(mission, purpose) do
    case purpose do
      :change ->
        put_report(mission, LandmarkTrack.fresh?(mission.sight, mission.now_ms, @fresh_ms))

      :search when mission.scan == nil ->
        mission

      :search ->
        put_report(mission, mission.scan == :found or Landmark.State.sees?(mission))
    end
  end

  defp put_report(%{percept: %{pose: nil}} = mission, _found?), do: mission

  defp put_report(mission, found?) do
    found? = found? and mission.sight != nil
    size = if found?, do: mission.sight.size_ppm, else: 0

    report = %{
      found: found?,
      size_ppm: size,
      pose: Landmark.State.millimetres(mission.percept.pose),
      led: if(mission.phase in [:lead, :agree], do: mission.led, else: 0),
      of: mission.of
    }

    %{mission | round: Round.report(mission.round, report)}
  end

  defp conclude({:commit, record}, mission) do
    mission = %{mission | of: Election.fleet(record.reports)}

    case Election.leader(record.reports) do
      {:ok, leader} ->
        {epoch, _counter, _initiator} = record.id

        %{
          mission
          | verdict: {:leader, leader},
            epoch: epoch,
            size_ppm: record.reports[leader].size_ppm,
            order: plan(mission, record.reports, leader),
            rescan?: false,
            anchor: nil,
            anchor_ms: nil
        }

      :minority ->
        mission

      :nobody when mission.round.purpose == :search ->
        %{mission | verdict: :nobody, rescan?: false}

      :nobody ->
        %{mission | scan: nil, rescan?: true}
    end
  end

  defp conclude({:failed, _reason}, %{round: %{id: {epoch, _counter, _initiator}}} = mission) do
    if epoch <= leading_epoch(mission),
      do: mission,
      else: start(mission, view(mission), mission.round.purpose)
  end

  defp conclude(nil, mission), do: mission

  # All robots compute the same order from the same record.
  defp plan(mission, reports, leader) do
    present = for {id, report} <- Enum.sort(reports), report != nil, do: {id, report.pose}
    {x, y, heading} = reports[leader].pose
    followers = for {id, {fx, fy, _heading}} <- present, id != leader, do: {id, {fx, fy}}

    case mission.assign do
      :chain ->
        Chain.order(followers, {x, y})

      :cost ->
        pose = Hal.Pose.new(x / 1000, y / 1000, heading / 1000)
        slots = slots(mission.formation, pose, length(present))
        Assignment.order(:cost, followers, {x, y}, slots)
    end
  end

  @doc "The slots around a leader's pose, in whole millimetres."
  @spec slots(Formation.t(), Hal.Pose.t(), pos_integer(), float()) :: [{integer(), integer()}]
  def slots(formation, pose, robots, landmark_distance \\ 1.6) do
    for slot <- Formation.slots(formation, robots, landmark_distance) do
      {x, y, _heading} = pose |> Hal.Pose.compose(slot) |> Landmark.State.millimetres()
      {x, y}
    end
  end
end
