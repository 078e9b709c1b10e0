defmodule Sim.Floorplan.Maps.Rough do
  @moduledoc "Draws maps with few right angles: a lab with diagonal walls, and a cave. Pure."
  alias Sim.Floorplan.{Drawing, Shape}
  alias Sim.Noise

  @wall 0.2

  # The chambers of the cave, and the passages between them by their numbers, with their widths.
  @chambers {{0.0, 0.0, 3.2}, {-7.0, 3.6, 2.6}, {6.8, 4.2, 2.8}, {-8.2, -4.0, 2.4},
             {1.2, -5.6, 2.2}, {8.4, -3.8, 2.6}}
  @passages [{0, 1, 2.2}, {0, 2, 2.4}, {1, 3, 1.8}, {3, 4, 1.6}, {0, 4, 2.0}, {2, 5, 1.8}]

  @doc "The fields of the map of this name."
  @spec draw(String.t(), pos_integer()) :: map()
  def draw("lab", _fleet) do
    # Partitions at 45 and 30 degrees, with gaps of 1.2 m and more, and two benches that stand
    # askew.
    {x, y} = {11.0, 8.0}

    walls = [
      line({-11.0, 1.0}, {-8.0, 4.0}, @wall),
      line({-7.1, 4.9}, {-4.0, 8.0}, @wall),
      line({11.0, -2.0}, {7.4, -5.6}, @wall),
      line({6.5, -6.5}, {5.0, -8.0}, @wall),
      line({3.0, 8.0}, {5.0, 4.54}, @wall),
      line({5.6, 3.5}, {7.0, 1.08}, @wall),
      line({7.0, 1.08}, {11.0, 1.08}, @wall),
      line({-11.0, -3.0}, {-7.0, -5.3}, @wall),
      line({-5.9, -5.95}, {-2.4, -8.0}, @wall)
    ]

    benches = [line({-6.4, -1.6}, {-4.4, 0.4}, 0.8), line({1.6, -5.2}, {3.6, -4.05}, 0.8)]

    Drawing.plan(
      "lab",
      {2 * x, 2 * y},
      {-x, -y, x, y},
      walls ++ benches ++ Shape.frame(x, y, @wall)
    )
  end

  def draw("cave", _fleet) do
    chambers = for k <- 0..(tuple_size(@chambers) - 1), shape <- chamber(k), do: shape

    passages =
      for {a, b, width} <- @passages do
        {ax, ay, _} = elem(@chambers, a)
        {bx, by, _} = elem(@chambers, b)
        {:free, {:line, {ax, ay}, {bx, by}, width}}
      end

    # Two stones that were left standing.
    stones = [{:wall, {:disc, -7.4, -4.4, 0.5}}, {:wall, {:disc, 7.4, 5.2, 0.6}}]

    Drawing.plan(
      "cave",
      {24.0, 18.0},
      {-12.0, -9.0, 12.0, 9.0},
      passages ++ chambers ++ stones,
      :wall
    )
  end

  # A disc, with smaller ones on its rim that no two have alike.
  defp chamber(k) do
    {x, y, radius} = elem(@chambers, k)

    rim =
      for turn <- 0..11 do
        draw = fn use -> Noise.unit(Noise.hash(0, 0xCA7E, 16 * k + turn, use)) end
        {c, s} = Sim.Trig.cos_sin((turn + draw.(0)) * :math.pi() / 6)
        {:free, {:disc, x + radius * c, y + radius * s, 0.4 + 0.5 * draw.(1)}}
      end

    [{:free, {:disc, x, y, radius}} | rim]
  end

  defp line(from, to, thickness), do: {:wall, {:line, from, to, thickness}}
end
