defmodule Missions.Landmark.Shape do
  @moduledoc """
  Chooses for the leader a shape that fits the free space. Pure.

  The shape is the requested one as long as that is possible. Slots that a dead robot's body
  occupies are left out. When followers report that their slots are blocked, and all others stand
  in theirs, the shape closes up step by step: spacing down to 0.8 m, then a column along the
  leader's trail. Once the leader has moved on, or a person asks for a shape, the requested shape
  is tried again.

  A leader that knows of walls chooses by `Swarm.Formation.Ladder`: the best rung that fits where it stands, a lower one
  each time that followers cannot get in. While it drives, it keeps the requested shape where that fits, and is followed in a
  column along its trail where it does not.
  """
  alias Hal.Pose
  alias Swarm.Formation
  alias Swarm.Formation.{FreeSlots, Ladder, Space, Trail}
  alias Missions.Landmark
  alias Missions.Landmark.{Claim, LandmarkTrack}

  @step_ms 3_000
  @step 0.1
  @elsewhere 1.0

  # A leader that has moved this far (metres) chooses again when it stands, and one whose shape has not fitted for
  # this long while it drives.
  @moved 0.15
  @unfit_ms 1_000
  @on_the_way [:asked, :column]

  defstruct formation: nil,
            trail?: false,
            room: nil,
            squeeze: 0,
            squeezed_ms: nil,
            at: nil,
            rung: :asked,
            spots: nil,
            chosen: nil,
            fit_ms: nil

  @typedoc """
  `rung` is that of `Swarm.Formation.Ladder`, `nil` if there is none; `spots` are the poses of the followers if they are not
  slots of the formation. The choice was made for `chosen`: the request, the number of followers, how often they could not
  get in, and where the leader was. A shape that does not fit any more last did at `fit_ms`.
  """
  @type t :: %__MODULE__{
          formation: Formation.t() | nil,
          trail?: boolean(),
          room: FreeSlots.t() | nil,
          squeeze: non_neg_integer(),
          rung: Ladder.rung() | nil,
          spots: [Pose.t()] | nil,
          chosen: {Formation.t(), non_neg_integer(), non_neg_integer(), Pose.point()} | nil,
          fit_ms: integer() | nil
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

    if mission.percept.grid,
      do: fit(shape, mission, distance),
      else: open(shape, mission, distance)
  end

  defp fit(shape, mission, distance) do
    %{percept: %{pose: pose}, now_ms: now} = mission
    slow? = Landmark.State.slow?(mission.percept, 0.02)
    asked = {mission.formation, length(mission.order), shape.squeeze}
    here = %{pose: pose, distance: distance, trail: mission.trail}
    space = %Space{bodies: bodies(mission), radius: radius(mission), grid: mission.percept.grid}

    case shape.chosen do
      {formation, followers, squeeze, at} when {formation, followers, squeeze} == asked ->
        moved = Pose.distance(at, pose)
        fits? = fits?(shape, here, space)
        shape = if fits?, do: %{shape | fit_ms: now}, else: shape

        cond do
          slow? and (moved > @moved or not fits?) ->
            choose(shape, asked, here, space, rungs(shape), now)

          slow? or moved <= @moved ->
            shape

          fits? and shape.spots == nil ->
            shape

          now - (shape.fit_ms || now) < @unfit_ms and shape.spots == nil ->
            shape

          true ->
            choose(shape, asked, here, space, @on_the_way, now)
        end

      _none_or_for_another ->
        choose(shape, asked, here, space, rungs(shape), now)
    end
  end

  defp rungs(%{squeeze: squeeze}), do: Enum.drop(Ladder.rungs(), min(squeeze, 4))

  defp fits?(%{rung: nil}, _here, _space), do: false

  defp fits?(%{spots: nil} = shape, here, space),
    do: Ladder.choose([:asked], shape.formation, length(elem(shape.room, 1)), here, space) != nil

  defp fits?(%{spots: spots}, _here, space), do: Enum.all?(spots, &Space.free?(space, &1))

  defp choose(shape, {asked, followers, _squeeze} = whom, here, space, rungs, now) do
    choice = Ladder.choose(rungs, asked, followers, here, space)

    cond do
      choice != nil -> chosen(shape, choice, whom, here, now)
      # A leader on its way may find room again.
      rungs == @on_the_way -> shape
      # The request stays, so that whoever is told that it cannot be knows what.
      true -> chosen(shape, none(asked, followers), whom, here, now)
    end
  end

  defp none(asked, followers),
    do: %{rung: nil, formation: asked, room: FreeSlots.whole(followers), spots: nil}

  defp chosen(shape, choice, {asked, followers, squeeze}, here, now) do
    %{
      shape
      | formation: choice.formation,
        room: choice.room,
        spots: choice.spots,
        rung: choice.rung,
        trail?: choice.spots != nil,
        chosen: {asked, followers, squeeze, Pose.point(here.pose)},
        fit_ms: now
    }
  end

  defp open(shape, mission, distance) do
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

  @doc "The poses of the followers, one by one, if they are not slots of the formation, else `nil`."
  @spec trail(t(), Landmark.State.t()) :: [{integer(), integer(), integer()}] | nil
  def trail(%{trail?: false}, _mission), do: nil

  def trail(%{spots: [_ | _] = spots}, _mission),
    do: Enum.map(spots, &Landmark.State.millimetres/1)

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

    if due? and blocked?(mission) and
         (not shape.trail? or shape.rung not in [nil, :cluster, :asked]),
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
    beats = Landmark.State.beats(mission)
    followers = for id <- mission.order, beat = beats[id], do: Claim.of(beat)

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
