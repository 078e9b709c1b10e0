defmodule Sim.Floorplan.Landmark do
  @moduledoc "Decides whether the landmark can stand at a place of a map. Pure."
  alias Sim.Floorplan.{Clearance, Cells}

  @radius 0.15

  @doc "Its radius in metres."
  @spec radius() :: float()
  def radius, do: @radius

  @doc "See `Sim.Floorplan.check_landmark/2`."
  @spec check(Sim.Floorplan.t(), Sim.Floorplan.point()) :: :ok | {:error, String.t()}
  def check(map, {x, y}) do
    {right, high} = Cells.size(map)

    cond do
      abs(x) > right / 2 or abs(y) > high / 2 ->
        {:error,
         "the landmark cannot stand at #{x},#{y}: map #{map.name} is #{right} x #{high} m around its centre"}

      Clearance.of(map, {x * 1.0, y * 1.0}, @radius) >= @radius ->
        :ok

      true ->
        {:error, "the landmark cannot stand at #{x},#{y} of map #{map.name}: there is a wall"}
    end
  end
end
