defmodule Missions.Landmark.ReferenceInbox do
  @moduledoc false
  # Decides whose reference a robot accepts, and when it joins a leader that lists it. Pure.
  alias Swarm.Agreement.Round
  alias Missions.Landmark.Reference
  alias Missions.Landmark
  alias Missions.Landmark.{Claim, EpochFilter, Policy}

  # No people ask this often for another shape unheard; accepting such a number would leave no
  # room for later ones.
  @leap 1_000
  # A robot does not join by an anchor older than this.
  @news_ms 500
  # After so long without news the newest anchor counts, whatever its number.
  @lease_ms 1_000

  @doc """
  Hears the anchor in the leader's heartbeats; the last one of a leader that fell silent counts
  only once.
  """
  @spec beats(Landmark.State.t()) :: Landmark.State.t()
  def beats(mission),
    do: if(Landmark.State.company(mission).anchored?, do: anchors(mission), else: mission)

  defp anchors(%{now_ms: now} = mission) do
    Enum.reduce(mission.percept.peers, mission, fn
      {_id, %{at_ms: at_ms, beat: %{claim: %{fields: %Claim{anchor: %Reference{} = anchor}}}}},
      mission
      when now - at_ms < @news_ms ->
        anchor(mission, anchor)

      _silent, mission ->
        mission
    end)
  end

  @doc """
  Hears an anchor. It counts only if it is new, and from this robot's leader or of a later epoch
  that names this robot. From other leaders a robot learns only what people have asked for
  meanwhile.

  Anchors are numbered. If the newest one has been silent for a lease, its number may have been
  wrong, so the next one counts in any case.
  """
  @spec anchor(Landmark.State.t(), Reference.t()) :: Landmark.State.t()
  def anchor(%{me: me} = mission, %Reference{leader: leader} = anchor) when leader != me do
    case EpochFilter.admit(mission, leader, anchor.epoch) do
      {:ok, mission} -> admitted(mission, anchor)
      {:refused, mission} -> mission
    end
  end

  def anchor(mission, _own), do: mission

  defp admitted(mission, anchor) do
    ours? = anchor.epoch == mission.epoch and mission.leader in [nil, anchor.leader]
    later? = anchor.epoch > mission.epoch and mission.me in anchor.order

    cond do
      not (ours? or later?) ->
        if anchor.asked_no > mission.asked_no, do: take_up(mission, anchor), else: mission

      news?(mission, anchor) ->
        %{mission | anchor: anchor, anchor_ms: mission.now_ms}
        |> take_up(anchor)
        |> Policy.told(anchor)

      true ->
        mission
    end
  end

  defp news?(%{anchor: same}, same), do: false

  defp news?(%{anchor: %{epoch: epoch}, anchor_ms: at_ms, now_ms: now}, %{epoch: epoch})
       when now - at_ms >= @lease_ms,
       do: true

  defp news?(mission, anchor), do: Reference.newest(mission.anchor, anchor) != mission.anchor

  # A person may have asked for another shape while this anchor was under way.
  defp take_up(%{asked_no: known} = mission, %Reference{asked_no: number} = anchor)
       when number >= known,
       do: %{
         mission
         | formation: anchor.asked || anchor.formation,
           asked_no: min(number, known + @leap)
       }

  defp take_up(mission, _older), do: mission

  @doc """
  Whether a leader names this robot now. If the robot came late or back, or missed the end of a
  round, it then joins without a round.
  """
  @spec joined?(Landmark.State.t()) :: boolean()
  def joined?(%{anchor: nil}), do: false

  def joined?(mission) do
    anchor = mission.anchor

    anchor.epoch >= mission.epoch and mission.me in anchor.order and
      mission.now_ms - mission.anchor_ms < @news_ms and not Round.open?(mission.round)
  end
end
