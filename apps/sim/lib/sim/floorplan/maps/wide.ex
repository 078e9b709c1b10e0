defmodule Sim.Floorplan.Maps.Wide do
  @moduledoc "Buildings without rooms: an open-plan office, and a corridor that runs in a ring. Pure."
  alias Sim.Floorplan.{Drawing, Shape}
  alias Sim.Trig

  @wall 0.2

  @doc "The fields of the map of this name."
  @spec draw(String.t(), pos_integer()) :: map()
  def draw("openplan", _fleet) do
    # Pillars in a grid of 6 m, islands of four desks between them, and a booth of glass.
    {x, y} = {13.0, 9.0}
    pillars = for i <- [-9.0, -3.0, 3.0, 9.0], j <- [-4.5, 4.5], do: {:wall, {:disc, i, j, 0.25}}

    islands =
      for {i, j} <- [
            {-9.0, -0.9},
            {-6.0, 5.4},
            {-6.0, -6.4},
            {6.0, -6.4},
            {0.0, -6.4},
            {9.0, 0.6}
          ],
          do: {:wall, {:box, i - 1.6, j - 0.8, i + 1.6, j + 0.8}}

    booth = [
      {:wall, {:box, 4.6, 5.6, 8.0, 8.9}},
      {:free, {:box, 4.7, 5.7, 7.9, 8.9}},
      {:free, {:box, 5.8, 5.6, 6.8, 5.7}}
    ]

    shelves = [{:wall, {:box, -1.8, 6.0, 1.8, 6.4}}, {:wall, {:box, -12.8, 3.0, -11.4, 3.4}}]

    Drawing.plan(
      "openplan",
      {2 * x, 2 * y},
      {-x, -y, x, y},
      pillars ++ islands ++ booth ++ shelves ++ Shape.frame(x, y, @wall)
    )
  end

  def draw("ring", _fleet) do
    # A round corridor 3 m wide with four bays on its outer side; the centre is wall.
    bays =
      for k <- 0..3 do
        {c, s} = Trig.cos_sin((2 * k + 1) * :math.pi() / 4)
        {:free, {:disc, 8.6 * c, 8.6 * s, 1.6}}
      end

    Drawing.plan(
      "ring",
      {21.0, 21.0},
      {-10.5, -10.5, 10.5, 10.5},
      bays ++ [{:free, {:disc, 0.0, 0.0, 8.5}}, {:wall, {:disc, 0.0, 0.0, 5.5}}],
      :wall
    )
  end
end
