defmodule Sim.Floorplan.Maps.Partitions do
  @moduledoc false
  # Draws a building of rooms and doors at random: a rectangle that is divided in two again and again (binary space partitioning),
  # with a door in each wall, so that all rooms are connected. Pure: the same seed gives the same building.
  alias Sim.Floorplan.{Drawing, Shape}

  # Metres: the building of a fleet of up to `@few`, its walls, the least side of a room, the widths of doors, how far a door
  # is from a corner, and the room on both sides of it that no wall may take.
  @size {18.0, 14.0}
  @few 8
  @wall 0.15
  @least 3.0
  @doors {1.1, 1.5}
  @corner 0.4
  @before 1.0
  # How often a part is divided.
  @depth 4

  @doc "The fields of the map `rooms:SEED`, as large as the fleet needs."
  @spec draw(String.t(), pos_integer()) :: map()
  def draw("rooms", fleet), do: draw("rooms:1", fleet)

  def draw("rooms:" <> seed = name, fleet) do
    random = :rand.seed_s(:exsss, String.to_integer(seed))
    {width, height} = size(fleet)
    {x, y} = {width / 2, height / 2}
    inside = {@wall - x, @wall - y, x - @wall, y - @wall}
    {walls, doors, _random} = divide(inside, @depth, random)

    Drawing.plan(
      name,
      {width, height},
      {-x, -y, x, y},
      walls ++ doors ++ Shape.frame(x, y, @wall)
    )
  end

  defp size(fleet) do
    times = :math.sqrt(max(fleet / @few, 1.0))
    {width, height} = @size
    {cells(width * times), cells(height * times)}
  end

  defp divide({left, low, right, high} = part, depth, random) do
    {width, height} = {right - left, high - low}
    room = 2 * @least + @wall

    cond do
      depth == 0 or max(width, height) < room -> {[], [], random}
      width >= height -> upright(part, depth, random)
      true -> part |> flipped() |> upright(depth, random) |> flipped_back()
    end
  end

  # Divided by an upright wall.
  defp upright({left, low, right, high}, depth, random) do
    {x, random} = between(left + @least, right - @least - @wall, random)
    {least, most} = @doors
    {door, random} = between(least, most, random)
    {y, random} = between(low + @corner, high - @corner - door, random)
    {walls, doors, random} = divide({left, low, x, high}, depth - 1, random)
    {more, others, random} = divide({x + @wall, low, right, high}, depth - 1, random)
    wall = {:wall, {:box, x, low, x + @wall, high}}
    free = {:free, {:box, x - @before, y, x + @wall + @before, y + door}}
    {[wall | walls ++ more], [free | doors ++ others], random}
  end

  defp flipped({left, low, right, high}), do: {low, left, high, right}

  defp flipped_back({walls, doors, random}),
    do: {Enum.map(walls, &flip/1), Enum.map(doors, &flip/1), random}

  defp flip({ink, {:box, left, low, right, high}}), do: {ink, {:box, low, left, high, right}}

  defp between(from, to, random) do
    {share, random} = :rand.uniform_s(random)
    {cells(from + share * (to - from)), random}
  end

  # Whole cells, so that a wall is as thick everywhere.
  defp cells(metres), do: round(metres / Drawing.cell()) * Drawing.cell()
end
