defmodule Sim.Stage.Shape do
  @moduledoc "Reads the blocks of a model of a world file: polygons that together fill its size. Pure."
  alias Hal.Pose
  alias Sim.Stage.{Entities, Values}

  @doc """
  The polygons of a model's blocks about its middle, in metres; without blocks the box of its size.

      iex> at = {"a.world", 1, 1}
      iex> size = {at, [2.0, 1.0]}
      iex> Sim.Stage.Shape.polygons(%{type: "model", names: ["model"], at: at, entities: [], properties: %{"size" => size}})
      [[{-1.0, -0.5}, {1.0, -0.5}, {1.0, 0.5}, {-1.0, 0.5}]]
  """
  @spec polygons(Entities.entity()) :: [[Pose.point(), ...], ...]
  def polygons(entity) do
    {length, width, _height} = Values.size(entity)

    case blocks(entity) do
      [] ->
        {x, y} = {length / 2, width / 2}
        [[{-x, -y}, {x, -y}, {x, y}, {-x, y}]]

      blocks ->
        {xs, ys} = blocks |> Enum.concat() |> Enum.unzip()
        {x, y} = {scale(Enum.min_max(xs), length), scale(Enum.min_max(ys), width)}
        for points <- blocks, do: for({px, py} <- points, do: {x.(px), y.(py)})
    end
  end

  @doc "Its polygons where it has blocks, which say more of its shape than its size does."
  @spec drawn(Entities.entity()) :: [[Pose.point(), ...]]
  def drawn(entity), do: if(blocks(entity) == [], do: [], else: polygons(entity))

  defp scale({low, high}, size) do
    factor = size / max(high - low, 1.0e-9)
    &((&1 - (low + high) / 2) * factor)
  end

  defp blocks(entity) do
    for %{type: "block"} = block <- entity.entities,
        [_, _, _ | _] = points <- [points(block)],
        do: points
  end

  # In the order of their numbers.
  defp points(block) do
    places =
      for {"point[" <> index, {_at, [x, y]}} <- block.properties,
          do: {byte_size(index), index, {x, y}}

    places |> Enum.sort() |> Enum.map(&elem(&1, 2))
  end
end
