defmodule Missions.Landmark.Leader.Loss do
  @moduledoc false
  # Decides what a leader does that does not see its landmark any more. Pure.
  #
  # It waits; then it goes where it saw the landmark last and looks around there; then it opens a round of all robots, in
  # which each looks around, and which leads to the search from room to room (`Missions.Landmark.Lookout`). Meanwhile its
  # followers keep their places, whatever the leader does: a leader that turns on the spot would sweep the whole shape about.
  alias Hal.Pose
  alias Missions.Landmark
  alias Missions.Landmark.{LandmarkTrack, SlotPoses}
  alias Swarm.Formation.Chain

  # It waits for so long. A new leader may have seen the landmark with its camera turned aside, and look ahead now.
  @wait_ms 5_000
  # It looks around so near to where it saw the landmark (metres): something that hides the landmark may stand there.
  @near 0.8
  # On its way for longer it looks around where it is.
  @way_ms 60_000
  # Longer than a turn and its own time-out.
  @look_ms 60_000

  defstruct step: nil, since_ms: 0, places: nil

  @typedoc """
  The `step` in which it is `since_ms`; `nil` while it sees the landmark. `places` are those that the followers keep, by name,
  in the order of the leader's announcement (mm and mrad).
  """
  @type t :: %__MODULE__{
          step: nil | :wait | :go | :look | :over,
          since_ms: integer(),
          places: [{atom(), {integer(), integer(), integer()}}] | nil
        }

  @doc "One tick, before the leader announces anything."
  @spec update(Landmark.State.t()) :: Landmark.State.t()
  def update(%{leadership: %{loss: loss}} = mission) do
    loss = if Landmark.State.sees?(mission), do: %__MODULE__{}, else: step(loss, mission)
    put_in(mission.leadership.loss, loss)
  end

  defp step(%{step: nil}, mission), do: keep(begin(:wait, mission), mission)

  defp step(%{step: :wait} = loss, mission) do
    if unseen_ms(mission) < @wait_ms,
      do: loss,
      else: %{loss | step: if(near?(mission), do: :look, else: :go), since_ms: mission.now_ms}
  end

  defp step(%{step: :go} = loss, mission), do: late(loss, :look, @way_ms, mission)
  defp step(%{step: :look} = loss, mission), do: late(loss, :over, @look_ms, mission)
  defp step(%{step: :over} = loss, _mission), do: loss

  defp late(loss, next, limit_ms, mission),
    do: if(mission.now_ms - loss.since_ms >= limit_ms, do: next(loss, next, mission), else: loss)

  defp next(loss, step, mission), do: %{loss | step: step, since_ms: mission.now_ms}
  defp begin(step, mission), do: %__MODULE__{step: step, since_ms: mission.now_ms}

  # A leader that has not seen the landmark since it leads has not faced it yet: the shape turns with it.
  defp keep(loss, %{anchor: %{leader: me} = anchor, me: me, sight: sight} = mission)
       when sight != nil do
    if sight.at_ms >= mission.since_ms do
      places =
        for id <- anchor.order, {slot, _velocity} = SlotPoses.slot(anchor, id, 0) do
          {id, Landmark.State.millimetres(slot)}
        end

      %{loss | places: places}
    else
      loss
    end
  end

  defp keep(loss, _mission), do: loss

  defp unseen_ms(%{sight: sight, since_ms: since_ms, now_ms: now}),
    do: now - max((sight && sight.at_ms) || since_ms, since_ms)

  defp near?(%{sight: sight, percept: %{pose: pose}}) do
    place = LandmarkTrack.where(sight)
    place == nil or pose == nil or Pose.distance(pose, place) <= @near
  end

  @doc "The end of what it did, by its tag."
  @spec ended(Landmark.State.t(), tag :: term(), outcome :: integer()) :: Landmark.State.t()
  def ended(%{leadership: %{loss: %{since_ms: since_ms} = loss}} = mission, tag, outcome) do
    loss =
      case {loss.step, tag, outcome} do
        {:go, {:last_seen, ^since_ms}, _there_or_not} -> next(loss, :look, mission)
        {:look, {:seek, ^since_ms}, 0} -> next(loss, :over, mission)
        _another -> loss
      end

    put_in(mission.leadership.loss, loss)
  end

  @doc "What it does now instead of tracking the landmark; `nil` as long as it tracks it."
  @spec goal(Landmark.State.t()) :: Robot.Mission.effect() | nil
  def goal(%{leadership: %{loss: %{step: :go, since_ms: since_ms}}} = mission) do
    {x, y} = LandmarkTrack.where(mission.sight)
    {:goal, {:last_seen, since_ms}, {Robot.Behaviour.Goto, x: x, y: y, tolerance: @near}}
  end

  def goal(%{leadership: %{loss: %{step: :look, since_ms: since_ms}}} = mission),
    do: {:goal, {:seek, since_ms}, {Robot.Behaviour.FindBlob, [colour: mission.colour]}}

  def goal(%{leadership: %{loss: %{step: :over}}}),
    do: {:goal, :stand, {Robot.Behaviour.Stop, []}}

  def goal(_tracks), do: nil

  @doc "The followers, in order, of those that are there, with the places that they keep; `nil` if they keep none."
  @spec kept(Landmark.State.t(), [atom()]) ::
          [{atom(), {integer(), integer(), integer()}}] | nil
  def kept(%{leadership: %{loss: %{places: nil}}}, _view), do: nil

  def kept(%{leadership: %{loss: %{places: places}}, order: order}, view) do
    places = Map.new(places)
    for id <- Chain.heal(order, view), is_map_key(places, id), do: {id, places[id]}
  end

  @doc "Whether it has looked in vain, and a round of all should follow."
  @spec over?(Landmark.State.t()) :: boolean()
  def over?(%{phase: :lead, leadership: %{loss: %{step: step}}}), do: step == :over
  def over?(_other), do: false

  @doc "What it does about that, for people; `nil` while it sees the landmark."
  @spec says(Landmark.State.t()) :: String.t() | nil
  def says(%{leadership: %{loss: %{step: step}}}) do
    case step do
      nil -> nil
      :wait -> "does not see the landmark: waits"
      :go -> "does not see the landmark: goes where it saw it last"
      :look -> "does not see the landmark: looks around for it"
      :over -> "does not see the landmark: calls all robots to search for it"
    end
  end
end
