defmodule Missions.Landmark.Shape do
  @moduledoc false
  # Chooses for the leader a shape that fits the free space. Pure.
  #
  # The shape is the requested one as long as that is possible. Slots that a dead robot's body
  # occupies are left out. When followers report that their slots are blocked, and all others stand
  # in theirs, the shape closes up step by step: spacing down to 0.8 m, then a column along the
  # leader's trail, then a cluster round it. When half of them are blocked, at least three, the cluster
  # follows at once. In a cluster, a place that a follower could not get to is left out of the next ones for a while: what kept
  # it from it, such as another robot, may be gone. If no other place is left, it tries again. Once the leader has moved on, or
  # a person asks for a shape, the requested shape is tried again. The shape closes up to 0.8 m, too, when all stand in their slots
  # and some have not become sure of that for long: what a robot knows of its place is worse the farther it is from the leader.
  # Where there is no room for all, those for which there is none
  # stand where they are: a place in a wall is none.
  #
  # A leader that knows of walls chooses by `Swarm.Formation.Ladder`: the best rung that fits where it stands, a lower one
  # each time that followers cannot get in. While it drives, it keeps the requested shape where that fits, and is followed in a
  # column along its trail where it does not.
  alias Hal.Pose
  alias Swarm.Formation
  alias Swarm.Formation.{FreeSlots, Ladder, Space, Trail}
  alias Missions.Landmark
  alias Missions.Landmark.LandmarkTrack
  alias Missions.Landmark.Shape.{Spots, Squeeze}

  @step 0.1

  # The radius (metres) of what stands in a place of the cluster that a follower could not get to.
  @barred 0.05

  # A leader that has moved this far (metres) chooses again when it stands, and one whose shape has not fitted for
  # this long while it drives, or that has found room for none.
  @moved 0.15
  @unfit_ms 1_000
  @on_the_way [:asked, :column]

  defstruct formation: nil,
            trail?: false,
            room: nil,
            squeeze: 0,
            squeezed_ms: nil,
            unsure_ms: nil,
            closest?: false,
            at: nil,
            rung: :asked,
            spots: nil,
            barred: [],
            proven: [],
            chosen: nil,
            fit_ms: nil

  @typedoc """
  `rung` is that of `Swarm.Formation.Ladder`, `nil` if there is none; `spots` are the poses of the followers if they are not
  slots of the formation; `barred` are places where a follower was blocked, and when;
  `proven` those where one has stood; since `unsure_ms` all stand in their slots, and some are not sure of that; `closest?` if
  that took so long that the shape is to be as close as may be. The choice was made for `chosen`: the request, the number of
  followers, how often they could not get in, and where the leader was. A shape that does not fit any more last did at `fit_ms`.
  """
  @type t :: %__MODULE__{
          formation: Formation.t() | nil,
          trail?: boolean(),
          room: FreeSlots.t() | nil,
          squeeze: non_neg_integer(),
          unsure_ms: integer() | nil,
          closest?: boolean(),
          rung: Ladder.rung() | nil,
          spots: [Pose.t()] | nil,
          barred: [{Pose.point(), at_ms :: integer()}],
          proven: [Pose.t()],
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
    shape = Squeeze.update(shape, mission, last(mission))

    if mission.percept.grid != nil or shape.squeeze >= last(mission),
      do: fit(shape, mission, distance),
      else: open(shape, mission, distance)
  end

  defp fit(shape, mission, distance) do
    %{percept: %{pose: pose}, now_ms: now} = mission
    slow? = Landmark.State.slow?(mission.percept, 0.02)
    asked = {wanted(shape, mission.formation), length(mission.order), shape.squeeze}
    here = %{pose: pose, distance: distance, trail: mission.trail, stand: stand(mission)}
    bodies = bodies(mission) ++ for({{x, y}, _at_ms} <- shape.barred, do: {x, y, @barred})
    space = %Space{bodies: bodies, radius: radius(mission), grid: mission.percept.grid}

    case shape.chosen do
      {formation, followers, squeeze, at} when {formation, followers, squeeze} == asked ->
        moved = Pose.distance(at, pose)
        shape = prove(shape, mission)
        # Where all stand there is room, whatever sonars seem to see later.
        fits? = match?(%{formed?: true}, mission.leadership) or fits?(shape, here, space)
        shape = if fits?, do: %{shape | fit_ms: now}, else: shape

        cond do
          shape.rung == nil and moved <= @moved and now - (shape.fit_ms || now) < @unfit_ms ->
            shape

          # A cluster that was chosen without knowing the walls stays until the leader is elsewhere (`relax/2`).
          mission.percept.grid == nil and (fits? or not slow?) ->
            shape

          slow? and (moved > @moved or not fits?) ->
            choose(shape, asked, here, space, rungs(shape, mission), mission)

          slow? or moved <= @moved ->
            shape

          fits? and shape.spots == nil ->
            shape

          now - (shape.fit_ms || now) < @unfit_ms and shape.spots == nil ->
            shape

          true ->
            choose(shape, asked, here, space, @on_the_way, mission)
        end

      {formation, followers, _steps, _at}
      when shape.rung == :cluster and {formation, followers} == {elem(asked, 0), elem(asked, 1)} ->
        refill(shape, asked, here, space, now)

      _none_or_for_another ->
        choose(shape, asked, here, space, rungs(shape, mission), mission)
    end
  end

  # The ladder takes the first spacing below the one that is asked for.
  defp wanted(%{closest?: true}, {kind, _spacing}),
    do: {kind, Float.round(Formation.least_spacing() + @step, 3)}

  defp wanted(_shape, formation), do: formation

  # Where the shape has no room with the least spacing, it stays.
  defp rungs(%{closest?: true, squeeze: 2}, %{percept: %{grid: grid}}) when grid != nil,
    do: [:closer, :asked, :turned, :column, :cluster]

  defp rungs(%{squeeze: squeeze}, mission),
    do: if(squeeze >= last(mission), do: [:cluster], else: Enum.drop(Ladder.rungs(), squeeze))

  # The number of steps after which only the cluster is left.
  defp last(%{percept: %{grid: nil}, formation: {_kind, spacing}}),
    do: floor((spacing - Formation.least_spacing()) / @step + 1.0e-6) + 2

  defp last(_knows_walls), do: length(Ladder.rungs()) - 1

  defp fits?(%{rung: nil}, _here, _space), do: false

  defp fits?(%{spots: nil} = shape, here, space),
    do: Ladder.choose([:asked], shape.formation, length(elem(shape.room, 1)), here, space) != nil

  defp fits?(%{spots: spots, proven: proven}, _here, space),
    do: Enum.all?(spots, &(&1 in proven or Space.free?(space, &1)))

  # Where a follower has stood in its place there is room, whatever walls sonars seem to see later.
  defp prove(%{spots: nil} = shape, _mission), do: shape

  defp prove(%{spots: spots, proven: proven} = shape, mission) do
    more =
      for {index, %{in_place: true}} <- Squeeze.followers(mission),
          spot = Enum.at(spots, index),
          spot not in proven,
          do: spot

    %{shape | proven: more ++ proven}
  end

  defp choose(shape, {asked, followers, _squeeze} = whom, here, space, rungs, mission) do
    choice = Ladder.choose(rungs, asked, followers, here, space)

    cond do
      choice != nil ->
        chosen(shape, choice, whom, here, mission.now_ms)

      # A leader on its way may find room again.
      rungs == @on_the_way ->
        shape

      shape.barred != [] ->
        space = %{space | bodies: bodies(mission)}
        choose(%{shape | barred: []}, whom, here, space, [:cluster], mission)

      # Nor is there room now.
      none?(shape, whom, here) ->
        %{shape | fit_ms: mission.now_ms}

      # The request stays, so that the line that refuses it names it.
      true ->
        chosen(
          shape,
          %{
            rung: nil,
            formation: asked,
            room: FreeSlots.whole(followers),
            spots: Spots.most(asked, followers, here, space)
          },
          whom,
          here,
          mission.now_ms
        )
    end
  end

  # Only a robot that could not get to its place gets another one.
  defp refill(%{spots: spots} = shape, {asked, _followers, _} = whom, here, space, now) do
    barred = for {place, _at_ms} <- shape.barred, do: place
    {left?, spots} = Spots.refill(spots, barred, asked, here, space)
    choice = %{rung: :cluster, formation: asked, room: shape.room, spots: spots}
    chosen(if(left?, do: shape, else: %{shape | barred: []}), choice, whom, here, now)
  end

  defp none?(%{rung: nil, chosen: {asked, followers, _, at}}, {asked, followers, _}, here),
    do: Pose.distance(at, here.pose) <= @moved

  defp none?(_shape, _whom, _here), do: false

  # Where the followers stand, in metres, as far as they are heard.
  defp stand(mission) do
    beats = Landmark.State.beats(mission)
    for id <- mission.order, %{pose: {x, y, _heading}} <- [beats[id]], do: {x / 1000, y / 1000}
  end

  defp chosen(shape, choice, {asked, followers, squeeze}, here, now) do
    %{
      shape
      | formation: choice.formation,
        room: choice.room,
        spots: choice.spots,
        proven: Enum.filter(shape.proven, &(&1 in (choice.spots || []))),
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

    rung = rung(trail?, formation == mission.formation)
    shape = %{shape | formation: formation, trail?: trail?, rung: rung, spots: nil}

    if changed? or Landmark.State.slow?(mission.percept, 0.02),
      do: %{shape | room: room(shape, mission, followers, distance, changed?)},
      else: shape
  end

  defp rung(true, _asked?), do: :column
  defp rung(false, true), do: :asked
  defp rung(false, false), do: :closer

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

    case LandmarkTrack.where(mission.sight) do
      {x, y} -> [{x, y, LandmarkTrack.radius()} | dead]
      nil -> dead
    end
  end

  defp radius(mission) do
    for(id <- mission.order, peer = mission.percept.peers[id], do: peer.radius)
    |> Enum.max(fn -> mission.percept.profile.radius end)
  end
end
