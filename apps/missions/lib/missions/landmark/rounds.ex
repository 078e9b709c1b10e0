defmodule Missions.Landmark.Rounds do
  @moduledoc """
  Plays a robot's part in the rounds of the landmark mission: when it opens one (`.Opening`, `.Challenge`), what it
  reports (`.Report`), and what follows from the record. Pure.

  A round is opened for two purposes. `:search`: every robot reports after its scan. `:change`:
  every robot reports at once what it sees now, because the leader is gone, or another robot has
  come clearly nearer to the landmark. Leader and
  followers stand still while a round is open, searchers once they have scanned.
  """
  alias Swarm.{Formation, Message}
  alias Swarm.Agreement.{Election, Round}
  alias Swarm.Formation.{Assignment, Chain}
  alias Missions.Landmark
  alias Missions.Landmark.{EpochFilter, Lookout, Merge, Policy}
  alias Missions.Landmark.Rounds.{Challenge, Opening, Report, View}

  @doc "Hears a letter. A robot that is not started does not take part."
  @spec hear(Landmark.State.t(), atom(), Round.Letter.t()) :: Landmark.State.t()
  def hear(%{started?: false} = mission, _from, _letter), do: mission

  def hear(mission, from, letter) do
    {epoch, _counter, _initiator} = letter.id

    with {:ok, mission} <- EpochFilter.admit(mission, from, epoch),
         do: %{mission | round: Round.hear(mission.round, from, letter, mission.now_ms)},
         else: ({:refused, mission} -> mission)
  end

  @doc "Whether a round waits for this robot's scan."
  @spec search?(Landmark.State.t()) :: boolean()
  def search?(%{round: round, rescan?: rescan?}),
    do:
      rescan? or (round.phase == :collect and round.purpose == :search and round.report == :busy)

  # Others may have elected another leader since, as after `Robot.Mission.Claim.timely/3`.
  @slept_ms 1_000

  @doc """
  Before a tick at this time: a robot that has slept since its last one, for example because it was
  frozen, leaves the round that it was in, whatever it has heard for it since. With letters that waited
  for it the round could still commit, and the robot would lead in an epoch that is over.
  """
  @spec wake(Landmark.State.t(), at_ms :: integer()) :: Landmark.State.t()
  def wake(%{now_ms: then_ms, round: round} = mission, at_ms) when at_ms - then_ms > @slept_ms do
    if Round.open?(round) or mission.verdict != nil do
      # Others may have all digests of the round, and count on this robot.
      mission =
        if round.phase == :digest,
          do: Policy.promise(%{mission | now_ms: at_ms}, nil),
          else: mission

      %{mission | round: Round.leave(round), verdict: nil, since_ms: at_ms}
    else
      mission
    end
  end

  def wake(mission, _at_ms), do: mission

  @doc """
  One tick: returns the letters to send, as effects, and the verdict of a round that has
  committed.
  """
  @spec tick(Landmark.State.t()) :: {Landmark.State.t(), [tuple()]}
  def tick(%{phase: :idle} = mission), do: {mission, []}

  def tick(mission) do
    mission =
      mission |> Challenge.update() |> Merge.update() |> Opening.update() |> Report.update()

    {round, letters, event} = Round.tick(mission.round, mission.now_ms)
    mission = conclude(event, promise(event, %{mission | round: round}, mission.round.phase))
    to = List.delete(round.view, mission.me)

    effects =
      for letter <- letters, to != [], do: {:send, to, Message.new(mission.me, :round, letter)}

    {mission, effects}
  end

  @doc "All robots that take part in the mission and are not gone, including this one, sorted."
  @spec view(Landmark.State.t()) :: [atom()]
  defdelegate view(mission), to: View

  # The robot that has all digests leads, with those that sent them.
  defp promise({:commit, record}, mission, _phase) do
    case Election.leader(record.reports) do
      {:ok, leader} -> Policy.promise(mission, leader)
      _none -> mission
    end
  end

  # Another robot may have them all when this one does not.
  defp promise({:failed, _reason}, mission, :digest), do: Policy.promise(mission, nil)
  defp promise(_event, mission, _phase), do: mission

  defp conclude({:commit, record}, mission) do
    mission = %{mission | of: Election.fleet(record.reports)}

    case Election.leader(record.reports) do
      {:ok, leader} ->
        {epoch, _counter, _initiator} = record.id

        %{
          mission
          | verdict: {:leader, leader},
            epoch: epoch,
            size_ppm: record.reports[leader].merit || 0,
            order: if(leader == mission.me, do: plan(mission, record.reports, leader), else: []),
            rescan?: false,
            anchor: nil,
            anchor_ms: nil
        }

      :minority ->
        mission

      :nobody when mission.round.purpose == :search ->
        Lookout.turned(%{mission | verdict: :nobody, rescan?: false})

      :nobody ->
        %{mission | scan: nil, rescan?: true}
    end
  end

  defp conclude({:failed, _reason}, %{round: %{id: {epoch, _counter, _initiator}}} = mission) do
    if epoch <= View.leading_epoch(mission),
      do: mission,
      else: Opening.start(mission, View.view(mission), mission.round.purpose)
  end

  defp conclude(nil, mission), do: mission

  # By the leader alone: the others hear of it with its anchor.
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
