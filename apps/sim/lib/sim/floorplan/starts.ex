defmodule Sim.Floorplan.Starts do
  @moduledoc false
  # Chooses the start poses of a fleet: spread over the free area of a map, from a seed. Pure.
  #
  # Each robot has a straight free way to the landmark or to a robot placed before it, so that no
  # robot starts in a closed room of an unknown map. The middle of the room is tried first, then all
  # of it.
  alias Hal.Pose
  alias Sim.Floorplan.{Clearance, Cells}
  alias Sim.Noise

  @between 1.0
  @from_wall 0.7
  @from_landmark 1.2
  # Half the width of a free way, and the distance between tested points.
  @way 0.4
  @stride 0.2
  @tries 2_000

  @doc "See `Sim.Floorplan.starts/4`."
  @spec spread(Sim.Floorplan.t(), [{atom(), float()}], integer(), Sim.Floorplan.point() | nil) ::
          {:ok, [Pose.t()]} | {:error, String.t()}
  def spread(map, robots, seed, landmark) do
    areas = [middle(map.room, length(robots)), inset(map.room)]

    robots
    |> Enum.with_index()
    |> Enum.reduce_while({:ok, []}, fn {{id, _radius}, index}, {:ok, poses} ->
      case Enum.find_value(areas, &place(&1, index, map, seed, landmark, poses)) do
        nil -> {:halt, {:error, full(map, id, length(robots))}}
        pose -> {:cont, {:ok, [pose | poses]}}
      end
    end)
    |> case do
      {:ok, poses} -> {:ok, Enum.reverse(poses)}
      error -> error
    end
  end

  defp full(map, id, count) do
    "no free place left for #{id}: #{count} robots do not fit into the start room of map #{map.name}"
  end

  # A few robots start where they can see each other, however large the hall; at least 4 m2 each.
  defp middle({left, low, right, high} = room, count) do
    {x, y} = Cells.middle(room)
    grow = :math.sqrt(max(1.0, count / 40))
    {w, h} = {8.0 * grow, 6.0 * grow}
    inset({max(left, x - w), max(low, y - h), min(right, x + w), min(high, y + h)})
  end

  defp inset({left, low, right, high}),
    do: {left + @from_wall, low + @from_wall, right - @from_wall, high - @from_wall}

  defp place(area, index, map, seed, landmark, poses),
    do: Enum.find_value(1..@tries, &pose(&1, area, index, map, seed, landmark, poses))

  defp pose(attempt, {left, low, right, high}, index, map, seed, landmark, poses) do
    # The same seed gives other places in a map of another shape.
    shape = 16 * (map.width - map.height)
    draw = fn use -> Noise.unit(Noise.hash(seed, 0x57A27 + index, attempt - 1, shape + use)) end
    place = {left + draw.(0) * (right - left), low + draw.(1) * (high - low)}

    if Enum.all?(poses, &(Pose.distance(&1, place) >= @between)) and
         (landmark == nil or Pose.distance(landmark, place) >= @from_landmark) and
         Clearance.at_least?(map, place, @from_wall) and
         reachable?(map, place, Enum.map(poses, &Pose.point/1) ++ List.wrap(landmark)) do
      {x, y} = place
      Pose.new(x, y, (draw.(2) - 0.5) * 2 * :math.pi())
    end
  end

  defp reachable?(_map, _place, []), do: true
  defp reachable?(map, place, others), do: Enum.any?(others, &way?(map, place, &1))

  defp way?(map, {ax, ay} = a, {bx, by} = b) do
    steps = ceil(Pose.distance(a, b) / @stride)
    wide = wide(map, b)

    Enum.all?(1..steps//1, fn k ->
      share = k / steps
      Clearance.at_least?(map, {ax + share * (bx - ax), ay + share * (by - ay)}, wide)
    end)
  end

  # A landmark may stand closer to a wall than a robot may.
  defp wide(map, b), do: min(@way, Clearance.of(map, b, @way))
end
