defmodule Missions.Landmark.Shape do
  @moduledoc """
  The leader's choice of a shape that fits the free space. Pure.

  The shape is the requested one as long as that is possible. Slots that a dead robot's body
  occupies are left out. When followers report that their slots are blocked, and all others stand
  in theirs, the shape closes up step by step: spacing down to 0.8 m, then a column along the
  leader's trail. Once the leader has moved on, or a person asks for a shape, the requested shape
  is tried again.
  """
  alias Hal.Pose
  alias Swarm.Formation
  alias Swarm.Formation.{FreeSlots, Trail}
  alias Swarm.Membership.Peers
  alias Missions.Landmark
  alias Missions.Landmark.LandmarkTrack

  @step_ms 3_000
  @step 0.1
  @elsewhere 1.0

  defstruct formation: nil, trail?: false, room: nil, squeeze: 0, squeezed_ms: nil, at: nil

  @type t :: %__MODULE__{
          formation: Formation.t() | nil,
          trail?: boolean(),
          room: FreeSlots.t() | nil,
          squeeze: non_neg_integer()
        }

  @doc "No shape yet: the next update chooses the requested one."
  @spec new() :: t()
  def new, do: %__MODULE__{}

  @doc """
  The shape for this tick. A leader that stands looks for room; one that moves keeps its choice.
  """
  @spec update(t(), Landmark.State.t(), distance :: float()) :: t()
  def update(shape, mission, distance) do
    shape = shape |> relax(mission) |> squeeze(mission)
    {formation, trail?} = formation(mission.formation, shape.squeeze)
    followers = length(mission.order)

    changed? =
      shape.formation != formation or shape.room == nil or
        length(elem(shape.room, 1)) != followers

    shape = %{shape | formation: formation, trail?: trail?}

    if changed? or Landmark.State.slow?(mission.percept, 0.02),
      do: %{shape | room: room(shape, mission, followers, distance, changed?)},
      else: shape
  end

  # A choice that still has room for all is kept, so that no robot moves for nothing.
  defp room(shape, mission, followers, distance, changed?) do
    bodies = bodies(mission)
    pose = mission.percept.pose
    radius = radius(mission)

    if not changed? and room?(shape, pose, distance, bodies, radius),
      do: shape.room,
      else: FreeSlots.places(shape.formation, followers, pose, distance, bodies, radius)
  end

  defp room?(shape, pose, distance, bodies, radius) do
    {size, places} = shape.room
    slots = shape.formation |> Formation.slots(size, distance) |> List.to_tuple()
    Enum.all?(places, &FreeSlots.free?(Pose.compose(pose, elem(slots, &1 - 1)), bodies, radius))
  end

  @doc "The poses along the leader's trail if that is the shape, else `nil`."
  @spec trail(t(), Landmark.State.t()) :: [{integer(), integer(), integer()}] | nil
  def trail(%{trail?: false}, _mission), do: nil

  def trail(%{formation: {_kind, spacing}}, mission) do
    bodies = bodies(mission)
    radius = radius(mission)

    Stream.iterate(spacing, &(&1 + spacing / 2))
    |> Stream.map(&{&1, Trail.behind(mission.trail, mission.percept.pose, &1)})
    |> Enum.reduce_while({[], 0.0, 0}, fn {way, place}, {taken, last, tries} ->
      cond do
        length(taken) == length(mission.order) ->
          {:halt, {taken, last, tries}}

        way - last >= spacing - 1.0e-9 and (tries > 400 or FreeSlots.free?(place, bodies, radius)) ->
          {:cont, {[place | taken], way, tries + 1}}

        true ->
          {:cont, {taken, last, tries + 1}}
      end
    end)
    |> elem(0)
    |> Enum.reverse()
    |> Enum.map(&Landmark.State.millimetres/1)
  end

  defp relax(%{squeeze: 0} = shape, _mission), do: shape

  defp relax(shape, mission) do
    if Pose.distance(mission.percept.pose, shape.at) > @elsewhere,
      do: %{shape | squeeze: 0, squeezed_ms: mission.now_ms},
      else: shape
  end

  defp squeeze(shape, mission) do
    due? = mission.now_ms - (shape.squeezed_ms || mission.since_ms) >= @step_ms

    if due? and blocked?(mission) and not shape.trail?,
      do: %{
        shape
        | squeeze: shape.squeeze + 1,
          squeezed_ms: mission.now_ms,
          at: Pose.point(mission.percept.pose)
      },
      else: shape
  end

  # A robot reports that it is blocked, and all others have come to rest in their places: as long
  # as some are under way, one of them may be the blocker. A robot that is not sure of its place
  # counts as at rest, too.
  defp blocked?(mission) do
    beats = Peers.taking_part(mission.percept.peers, mission.now_ms)
    followers = for id <- mission.order, beat = beats[id], do: beat

    Enum.any?(followers, & &1.blocked) and
      Enum.all?(followers, &(&1.blocked or &1.in_place or &1.unsure))
  end

  defp formation(asked, 0), do: {asked, false}

  defp formation({kind, spacing}, squeeze) do
    closer = Float.round(spacing - squeeze * @step, 3)

    if closer >= Formation.least_spacing(),
      do: {{kind, closer}, false},
      else: {{:column, min(spacing, 1.0)}, true}
  end

  # Obstacles that stay where they are: dead robots, and the landmark.
  defp bodies(mission) do
    dead =
      for {_id, %{mode: :dead, pose: pose, radius: radius}} <- Enum.sort(mission.percept.peers),
          do: {pose.x, pose.y, radius}

    case mission.sight do
      %{place: {x, y}} -> [{x, y, LandmarkTrack.radius()} | dead]
      _unknown -> dead
    end
  end

  defp radius(mission) do
    for(id <- mission.order, peer = mission.percept.peers[id], do: peer.radius)
    |> Enum.max(fn -> mission.percept.profile.radius end)
  end
end
