defmodule Sim.Floorplan.Packing do
  @moduledoc false
  # Places start poses on cells that are given: at random from a seed, and if that leaves no room for the last ones, row
  # by row as close as is allowed. Pure.
  alias Hal.Pose
  alias Sim.Floorplan.Cells
  alias Sim.Noise

  @between 1.0
  @from_landmark 1.2
  @tries 300

  @doc """
  `count` poses on these cells, at least 1.0 m apart and 1.2 m from the landmark, if any; or how
  many there are room for.
  """
  @spec place(
          Sim.Floorplan.t(),
          [non_neg_integer()],
          pos_integer(),
          integer(),
          Sim.Floorplan.point() | nil
        ) ::
          {:ok, [Pose.t()]} | {:full, non_neg_integer()}
  def place(map, cells, count, seed, landmark) do
    draw = fn index, attempt, use ->
      Noise.unit(Noise.hash(seed, 0x57A27 + index, attempt, use))
    end

    # What is 1.2 m off the landmark stays so.
    cells =
      Enum.filter(
        cells,
        &(landmark == nil or far?(Cells.point(map, &1), landmark, @from_landmark))
      )

    case at_random(map, List.to_tuple(cells), count, draw) || in_rows(map, cells, count) do
      {:full, most} ->
        {:full, most}

      places ->
        poses =
          for {{x, y}, index} <- Enum.with_index(places),
              do: Pose.new(x, y, (draw.(index, 0, 2) - 0.5) * 2 * :math.pi())

        {:ok, poses}
    end
  end

  defp at_random(_map, {}, _count, _draw), do: nil

  defp at_random(map, cells, count, draw) do
    Enum.reduce_while(0..(count - 1), [], fn index, places ->
      found =
        Enum.find_value(0..(@tries - 1), fn attempt ->
          cell = elem(cells, trunc(draw.(index, attempt, 0) * tuple_size(cells)))
          place = Cells.point(map, cell)
          if Enum.all?(places, &far?(&1, place, @between)), do: place
        end)

      if found, do: {:cont, [found | places]}, else: {:halt, nil}
    end)
    |> then(&(&1 && Enum.reverse(&1)))
  end

  defp in_rows(map, cells, count) do
    places =
      cells
      |> Enum.sort()
      |> Enum.reduce_while([], fn cell, places ->
        place = Cells.point(map, cell)

        cond do
          length(places) == count -> {:halt, places}
          Enum.all?(places, &far?(&1, place, @between)) -> {:cont, [place | places]}
          true -> {:cont, places}
        end
      end)

    if length(places) == count, do: Enum.reverse(places), else: {:full, length(places)}
  end

  # A grid of cells has distances of exactly a metre, whatever floats make of them.
  defp far?({ax, ay}, {bx, by}, least) do
    {dx, dy} = {ax - bx, ay - by}
    dx * dx + dy * dy >= least * least + 1.0e-9
  end
end
