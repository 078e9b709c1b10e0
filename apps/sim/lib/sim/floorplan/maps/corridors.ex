defmodule Sim.Floorplan.Maps.Corridors do
  @moduledoc "Buildings of rooms along corridors: offices, a clinic, two rooms and a narrow door. Pure."
  alias Sim.Floorplan.{Drawing, Shape}

  @wall 0.2

  @doc "The fields of the map of this name."
  @spec draw(String.t(), pos_integer()) :: map()
  def draw("offices", _fleet) do
    # A corridor 2.2 m wide from end to end; above and below it seven rooms of 4 m, two of them
    # one. Doors of 1 m are near a corner, as in offices, now the left one, now the right one.
    {x, y, corridor} = {14.0, 7.0, 1.1}

    upper =
      [{:wall, {:box, -x, corridor, x, corridor + @wall}}] ++
        for(k <- [-5, -3, -1, 3, 5], do: upright(2.0 * k, corridor, y)) ++
        for(
          {k, side} <- [{-6, 1}, {-4, -1}, {-2, 1}, {4, -1}, {6, 1}],
          do: door(2.0 * k + 1.1 * side, corridor, 1.0)
        ) ++
        [door(1.0, corridor, 1.4)] ++
        for(k <- [-6, -4, -2, 4, 6], do: desk(2.0 * k, 5.6)) ++
        [{:wall, {:box, 0.0, 3.9, 2.4, 5.0}}]

    lower =
      [{:wall, {:box, -x, corridor, x, corridor + @wall}}] ++
        for(k <- [-5, -3, -1, 1, 3, 5], do: upright(2.0 * k, corridor, y)) ++
        for(
          {k, side} <- [{-6, -1}, {-4, 1}, {-2, -1}, {0, 1}, {2, -1}, {4, 1}, {6, -1}],
          do: door(2.0 * k + 1.1 * side, corridor, 1.0)
        ) ++
        for(k <- [-6, -4, 0, 2, 6], do: desk(2.0 * k, 5.6))

    plan("offices", x, y, upper ++ Enum.map(lower, &Shape.below/1))
  end

  def draw("clinic", _fleet) do
    # A main corridor from west to east, two wings across it, and wards with beds on all of them;
    # a lobby opens on the main corridor.
    {x, y, corridor} = {18.0, 12.0, 1.3}
    {near, far, middle} = {7.8, 10.2, 6.7}

    # One quarter: the wards beyond the wing, and those between the wings that open on it.
    outer =
      [
        upright(far + @wall / 2, corridor, y),
        {:wall, {:box, far, corridor, x, corridor + @wall}},
        {:wall, {:box, far, middle, x, middle + @wall}},
        side_door(far, 3.2),
        side_door(far, 9.4)
      ] ++ beds(12.6, 3) ++ beds_low(12.6, 3)

    inner = [
      upright(near - @wall / 2, corridor, y),
      {:wall, {:box, 0.0, corridor, near, corridor + @wall}},
      {:wall, {:box, 0.0, middle, near, middle + @wall}},
      {:wall, {:box, -@wall / 2, middle, @wall / 2, y}},
      side_door(near - @wall, 9.4)
    ]

    quarter = outer ++ inner ++ beds(1.8, 2)
    upper = quarter ++ Enum.map(quarter, &Shape.beside/1)

    # Above the main corridor three wards, below it the lobby with its desk.
    wards =
      for(k <- [-1, 1], do: upright(2.6 * k, corridor, middle)) ++
        for(k <- [-1, 0, 1], do: door(5.2 * k, corridor, 1.3))

    lobby = [
      {:free, {:box, -4.5, -corridor - @wall, 4.5, -corridor}},
      {:wall, {:box, -1.6, -5.2, 1.6, -4.4}}
    ]

    plan("clinic", x, y, upper ++ Enum.map(upper, &Shape.below/1) ++ wards ++ lobby)
  end

  def draw("doorway", _fleet) do
    # Two rooms; the door between them is as narrow as doors are.
    plan("doorway", 9.0, 5.0, [
      {:wall, {:box, 2.4, -5.0, 2.6, 5.0}},
      {:free, {:box, 2.4, -0.45, 2.6, 0.45}}
    ])
  end

  defp plan(name, x, y, shapes),
    do: Drawing.plan(name, {2 * x, 2 * y}, {-x, -y, x, y}, shapes ++ Shape.frame(x, y, @wall))

  # A wall that stands across the corridor's direction.
  defp upright(x, low, high), do: {:wall, {:box, x - @wall / 2, low, x + @wall / 2, high}}

  # A door in a wall along x whose lower edge is at `low`.
  defp door(x, low, width), do: {:free, {:box, x - width / 2, low, x + width / 2, low + @wall}}

  # A door of 1.3 m in a wall along y whose left edge is at `left`.
  defp side_door(left, y), do: {:free, {:box, left, y - 0.65, left + @wall, y + 0.65}}

  defp desk(x, y), do: {:wall, {:box, x - 0.8, y, x + 0.8, y + 0.7}}

  # Beds side by side with their heads at the outer wall, or at that in the middle.
  defp beds(x, count),
    do: for(k <- 0..(count - 1), do: {:wall, {:box, x + 2.2 * k, 9.8, x + 2.2 * k + 0.9, 11.8}})

  defp beds_low(x, count),
    do: for(k <- 0..(count - 1), do: {:wall, {:box, x + 2.2 * k, 4.7, x + 2.2 * k + 0.9, 6.7}})
end
