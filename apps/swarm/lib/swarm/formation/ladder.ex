defmodule Swarm.Formation.Ladder do
  @moduledoc """
  Chooses the shape that fits where the leader stands, by one ladder, the best first. Pure.

  | rung | the shape |
  |---|---|
  | `:asked` | as asked for; slots that a body takes are left out |
  | `:turned` | turned about the leader, in steps of 15 degrees, by as little as it needs |
  | `:closer` | the same with less spacing, down to 0.8 m |
  | `:column` | a column along the leader's trail |
  | `:cluster` | the nearest free places round the leader that a way leads to, behind one another where they must be |

  Each robot of a shape can drive straight from its place to the leader's, or to that of a robot before it, so that no shape
  extends behind a wall; and none stands between the leader and what it faces, or nearer to that than the leader.
  """
  alias Hal.Pose
  alias Swarm.Formation
  alias Swarm.Formation.{FreeSlots, Space, Trail}

  @rungs [:asked, :turned, :closer, :column, :cluster]
  @turns for k <- 1..12, sign <- [1, -1], k != 12 or sign == 1, do: sign * k * :math.pi() / 12
  @closer 0.1
  # The half of the angle in which no robot may stand before the leader, and how far beyond what it faces.
  @ahead 0.5
  @beyond 0.4
  # Places are looked for along a trail in steps of this share of the spacing, and up to this many.
  @stride 0.5
  # Places along a trail are at least this share of the spacing apart in a straight line, too.
  @apart_share 0.7
  @strides 60
  # The gaps between robots of a cluster, from edge to edge: the first with which all see their leader, else the last.
  # How many places round the leader are tried, and how much finer they lie where too few of them are free, as in a
  # corridor hardly wider than a robot.
  @apart [0.6, 0.4]
  @finer 4
  @most 400

  @type rung :: :asked | :turned | :closer | :column | :cluster

  @typedoc """
  What is to be formed: the rung, the formation as it is told, the slots of it that are used (`:asked`), or the poses in
  the map frame, one for each follower.
  """
  @type choice :: %{
          rung: rung(),
          formation: Formation.t(),
          room: FreeSlots.t(),
          spots: [Pose.t()] | nil
        }

  @typedoc """
  Where the leader is, how far ahead of it stands what it faces (metres), and where it came from; and where its followers
  `stand`, which a cluster takes for places if there are too few others.
  """
  @type here :: %{
          required(:pose) => Pose.t(),
          required(:distance) => float(),
          required(:trail) => Trail.t(),
          optional(:stand) => [Pose.point()]
        }

  @doc "All rungs, the best first."
  @spec rungs() :: [rung(), ...]
  def rungs, do: @rungs

  @doc """
  The first of these rungs on which so many followers have room; `nil` if there is none.

      iex> here = %{pose: Hal.Pose.new(0, 0), distance: 1.6, trail: []}
      iex> space = %Swarm.Formation.Space{radius: 0.2}
      iex> Swarm.Formation.Ladder.choose([:asked], {:column, 1.0}, 2, here, space)
      %{rung: :asked, formation: {:column, 1.0}, room: {3, [1, 2]}, spots: nil}
      iex> choice = Swarm.Formation.Ladder.choose([:turned], {:column, 1.0}, 1, here, space)
      iex> choice.spots |> hd() |> Hal.Pose.distance({0.0, 0.0}) |> Float.round(6)
      1.0
  """
  @spec choose([rung()], Formation.t(), non_neg_integer(), here(), Space.t()) :: choice() | nil
  def choose(rungs, asked, followers, here, space) do
    Enum.find_value(rungs, fn rung ->
      with {formation, room, spots} <- rung(rung, asked, followers, here, space),
           do: %{rung: rung, formation: formation, room: room, spots: spots}
    end)
  end

  defp rung(:asked, asked, followers, here, space) do
    fits? = &Space.free?(space, &1)
    {size, places} = room = FreeSlots.places(asked, followers, here.pose, here.distance, fits?)
    slots = asked |> Formation.slots(size, here.distance) |> List.to_tuple()
    spots = for place <- places, do: Pose.compose(here.pose, elem(slots, place - 1))
    if Enum.all?(spots, fits?) and linked?(spots, here, space), do: {asked, room, nil}
  end

  # A ring is about what the leader faces.
  defp rung(rung, {:circle, _spacing}, _followers, _here, _space) when rung in [:turned, :closer],
    do: nil

  defp rung(:turned, asked, followers, here, space),
    do: turned(@turns, asked, followers, here, space)

  defp rung(:closer, {kind, spacing}, followers, here, space) do
    least = Formation.least_spacing()

    spacings =
      Stream.iterate(spacing - @closer, &(&1 - @closer))
      |> Enum.take_while(&(&1 > least - 1.0e-9))

    Enum.find_value(spacings, fn closer ->
      turned([0.0 | @turns], {kind, Float.round(closer, 3)}, followers, here, space)
    end)
  end

  defp rung(:column, {_kind, spacing}, followers, here, space) do
    spacing = min(spacing, 1.0)

    spots =
      1..@strides
      |> Stream.map(&(spacing * (1 + (&1 - 1) * @stride)))
      |> Enum.reduce_while({[], 0.0}, fn way, {spots, last} ->
        place = Trail.behind(here.trail, here.pose, way)
        due? = way - last >= spacing - 1.0e-9

        cond do
          length(spots) == followers ->
            {:halt, {spots, last}}

          due? and apart?(place, [here.pose | spots], spacing) and
              fits?(place, spots, here, space) ->
            {:cont, {[place | spots], way}}

          true ->
            {:cont, {spots, last}}
        end
      end)
      |> elem(0)

    if length(spots) == followers, do: told({:column, spacing}, Enum.reverse(spots))
  end

  defp rung(:cluster, asked, followers, here, space) do
    clusters =
      for apart <- @apart, spots = cluster(apart, 1, followers, here, space, []), do: spots

    leader = Pose.point(here.pose)
    near? = fn spots -> Enum.all?(spots, &Space.joined?(space, &1, leader)) end
    least = List.last(@apart)

    spots =
      Enum.find(clusters, near?) || List.last(clusters) ||
        cluster(least, @finer, followers, here, space, []) ||
        cluster(least, @finer, followers, here, space, Map.get(here, :stand, []))

    if spots, do: told(asked, spots)
  end

  defp turned(turns, asked, followers, here, space) do
    slots = Formation.slots(asked, followers + 1, here.distance)

    Enum.find_value(turns, fn turn ->
      base = Pose.new(here.pose.x, here.pose.y, here.pose.heading + turn)
      spots = for slot <- slots, do: base |> Pose.compose(slot) |> Pose.point() |> facing(here)

      if Enum.all?(spots, &(Space.free?(space, &1) and not hides?(&1, here))) and
           linked?(spots, here, space),
         do: told(asked, spots)
    end)
  end

  # Of a lattice that is `finer` times as fine as robots stand apart, only places that far apart are taken, to which a way
  # leads; then those where robots `stand`.
  defp cluster(apart, finer, followers, here, space, stand) do
    apart = 2 * space.radius + apart
    open = :gb_sets.singleton({0.0, {0, 0}})
    limits = {apart / finer, @most * finer * finer}
    found = flood(open, MapSet.new([{0, 0}]), [], limits, here, space)
    way? = fn point -> point in stand or Space.way?(space, here.pose, point) end
    stood = Enum.filter(stand, &(Space.free?(space, &1) and not hides?(&1, here)))

    {spots, _before} =
      Enum.flat_map_reduce(Enum.reverse(found) ++ stood, [Pose.point(here.pose)], fn at, before ->
        if length(before) <= followers and
             Enum.all?(before, &(Pose.distance(&1, at) > apart - 1.0e-6)) and way?.(at),
           do: {[facing(at, here)], [at | before]},
           else: {[], before}
      end)

    if length(spots) >= followers, do: Enum.take(spots, followers)
  end

  defp told(formation, spots), do: {formation, FreeSlots.whole(length(spots)), spots}
  defp facing({x, y}, here), do: Pose.new(x, y, here.pose.heading)

  # A trail may come near to where it was before.
  defp apart?(place, others, spacing),
    do: Enum.all?(others, &(Pose.distance(&1, Pose.point(place)) >= @apart_share * spacing))

  defp fits?(place, spots, here, space) do
    Space.free?(space, place) and not hides?(place, here) and
      Space.joined?(space, place, List.first(spots) || here.pose)
  end

  # Each in its turn sees the leader, or one before it.
  defp linked?(spots, here, space) do
    {linked?, _before} =
      Enum.reduce(spots, {true, [here.pose]}, fn spot, {linked?, before} ->
        {linked? and Enum.any?(before, &Space.joined?(space, spot, &1)), [spot | before]}
      end)

    linked?
  end

  defp hides?(place, %{pose: pose, distance: distance}) do
    (abs(Pose.bearing(pose, place)) < @ahead and Pose.distance(pose, place) < distance + @beyond) or
      Pose.distance(Pose.place(pose, {distance, 0.0}), place) < distance
  end

  # Places of a triangular lattice round the leader, in the order of the length of way to them: from each that is free
  # to those beside it. Places that are not free are passed, where a robot can drive through.
  defp flood(open, seen, found, {step, most} = limits, here, space) do
    if :gb_sets.is_empty(open) or MapSet.size(seen) > most do
      found
    else
      {{way, cell}, open} = :gb_sets.take_smallest(open)
      at = lattice(cell, step, here)
      free? = cell == {0, 0} or (Space.free?(space, at) and not hides?(at, here))

      {open, seen} =
        for {i, j} <- [{1, 0}, {0, 1}, {-1, 1}, {-1, 0}, {0, -1}, {1, -1}],
            next = {elem(cell, 0) + i, elem(cell, 1) + j},
            not MapSet.member?(seen, next),
            Space.joined?(space, at, lattice(next, step, here)),
            reduce: {open, seen} do
          {open, seen} -> {:gb_sets.add({way + step, next}, open), MapSet.put(seen, next)}
        end

      flood(open, seen, if(free?, do: [at | found], else: found), limits, here, space)
    end
  end

  defp lattice({i, j}, step, %{pose: pose}) do
    Pose.place(pose, {-step * (i + j / 2), step * j * :math.sqrt(3) / 2})
  end
end
