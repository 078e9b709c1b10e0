defmodule Sim.Floorplan.Maps.Halls do
  @moduledoc false
  # Draws the maps that grow with the fleet: each has free space around its centre for a column of the whole fleet at 1 m
  # spacing in any direction, and 3 m to drive around its end. Pure.
  alias Sim.Floorplan.{Drawing, Shape}
  alias Sim.Trig

  @wall 0.2
  @corridor 2.5
  @door 1.4

  @doc "The fields of the map of this name, for a fleet of this size."
  @spec draw(String.t(), pos_integer()) :: map()
  def draw("hall", fleet) do
    {x, y} = half(fleet)
    cell = Drawing.cell()
    {w, h} = {round(2 * x / cell), round(2 * y / cell)}
    # Without inner walls the field needs no sweep: rows farther inside than a byte can count are
    # alike.
    rows = Map.new(1..255, fn most -> {most, open_row(w, most)} end)
    field = for j <- 0..(h - 1), into: <<>>, do: rows[Enum.min([j + 1, h - j, 255])]

    %{name: "hall", width: w, height: h, cell: cell, field: field, room: {-x, -y, x, y}}
  end

  def draw("hospital", fleet) do
    {x, y} = half(fleet)

    # A large room in the middle, a corridor around it, rooms along the outer side of the
    # corridor.
    {cx, cy} = {x + @wall + @corridor, y + @wall + @corridor}
    {ox, oy} = {cx + 8.0, cy + 4.5}

    shapes =
      Shape.frame(x + @wall, y + @wall, @wall) ++
        cross(x, y) ++
        Shape.frame(cx + @wall, cy + @wall, @wall) ++
        ward(ox, cy, oy, fn a, b, c, d -> {a, b, c, d} end) ++
        ward(ox, cy, oy, fn a, b, c, d -> {a, -d, c, -b} end) ++
        ward(cy + @wall, cx, ox, fn a, b, c, d -> {b, a, d, c} end) ++
        ward(cy + @wall, cx, ox, fn a, b, c, d -> {-d, a, -b, c} end) ++
        Shape.frame(ox, oy, @wall)

    Drawing.plan("hospital", {2 * ox, 2 * oy}, {-x, -y, x, y}, shapes)
  end

  def draw("arena", fleet) do
    {free, _} = half(fleet)
    half = free + 4.0
    thin = for k <- 0..11, do: pillar(k / 12, free + 1.5, 0.25 + 0.15 * rem(k, 2))
    thick = for k <- 0..3, do: pillar((2 * k + 1) / 8, 1.25 * half, 0.6)
    # A square that lies in the free circle.
    room = 0.7 * free

    Drawing.plan(
      "arena",
      {2 * half, 2 * half},
      {-room, -room, room, room},
      thin ++ thick ++ Shape.frame(half, half, @wall)
    )
  end

  defp half(fleet), do: {max(8.0, fleet + 3.0), max(6.0, fleet + 3.0)}

  defp open_row(w, most),
    do: for(i <- 0..(w - 1), into: <<>>, do: <<Enum.min([i + 1, w - i, most])>>)

  # A door in the middle of each wall of the large room.
  defp cross(x, y) do
    half = @door / 2

    [
      {:free, {:box, -x - @wall, -half, @wall - x, half}},
      {:free, {:box, x - @wall, -half, x + @wall, half}},
      {:free, {:box, -half, -y - @wall, half, @wall - y}},
      {:free, {:box, -half, y - @wall, half, y + @wall}}
    ]
  end

  # Rooms about 5 m wide side by side, from -half to half, `low` to `high`; `turn` places them on
  # their side.
  defp ward(half, low, high, turn) do
    count = max(round(2 * half / 5), 1)
    width = 2 * half / count

    doors =
      for k <- 0..(count - 1), middle = -half + (k + 0.5) * width do
        {:free, middle - @door / 2, low - @wall, middle + @door / 2, low + 2 * @wall}
      end

    walls =
      for k <- 1..(count - 1)//1, edge = -half + k * width do
        {:wall, edge - @wall / 2, low, edge + @wall / 2, high}
      end

    for {ink, left, low, right, high} <- walls ++ doors do
      {left, low, right, high} = turn.(left, low, right, high)
      {ink, {:box, left, low, right, high}}
    end
  end

  defp pillar(turn, distance, radius) do
    {c, s} = Trig.cos_sin(turn * 2 * :math.pi())
    {:wall, {:disc, distance * c, distance * s, radius}}
  end
end
