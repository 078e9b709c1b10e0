defmodule Sim.Floorplan.Refusal do
  @moduledoc "Words what is said of a fleet for which a map has no room: what would fit. Pure."
  alias Sim.Floorplan
  alias Sim.Floorplan.{Cells, Search}

  @doc "The line, given how many robots would fit."
  @spec line(
          Floorplan.t(),
          [{atom(), float()}],
          Floorplan.point() | :default | nil,
          non_neg_integer()
        ) ::
          String.t()
  def line(map, robots, asked, 0) do
    "#{who(length(robots))} cannot start in map #{map.name}: #{why(map, robots, asked)}"
  end

  def line(map, robots, asked, most) do
    "#{who(length(robots))} cannot start in map #{map.name}: there is room for #{most}#{where(asked)}"
  end

  defp who(1), do: "1 robot"
  defp who(count), do: "#{count} robots"

  defp where({x, y}), do: ", with ways to the landmark at #{x},#{y}"
  defp where(_chosen), do: ""

  defp why(_map, _robots, {x, y}),
    do: "none has a free way to the landmark at #{x},#{y}"

  defp why(map, robots, _chosen) do
    need = 2 * Search.least(robots |> Enum.map(&elem(&1, 1)) |> Enum.max())
    widest = widest(map)

    cond do
      widest == 0.0 ->
        "it is all wall"

      widest < need ->
        {width, height} = Cells.size(map)
        factor = need / widest

        "its widest place is #{metres(widest)} m across, and a robot needs #{metres(need)} m; " <>
          "it would take a map of #{ceil(width * factor)} x #{ceil(height * factor)} m"

      true ->
        "no place is 1.2 m from the landmark and far enough from the walls"
    end
  end

  # Metres across the widest place, as far as a byte counts.
  defp widest(map) do
    steps = map.field |> :binary.bin_to_list() |> Enum.max()
    max(2 * steps - 1, 0) * map.cell
  end

  defp metres(metres), do: :erlang.float_to_binary(metres * 1.0, decimals: 2)
end
