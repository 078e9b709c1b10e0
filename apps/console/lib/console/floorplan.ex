defmodule Console.Floorplan do
  @moduledoc "The map of a simulated world as a `Console.Ground`. Pure."
  alias Console.Ground

  @doc """
  The ground of a map; a ground is its own.

      iex> {:ok, map} = Sim.Map.open("hall", 6)
      iex> ground = Console.Floorplan.of(map)
      iex> {ground.name, ground.wall?.(0.0, 0.0), ground.wall?.(99.0, 0.0)}
      {"hall", false, true}
  """
  @spec of(Ground.t() | Sim.Map.t()) :: Ground.t()
  def of(%Ground{} = ground), do: ground

  def of(%Sim.Map{} = map) do
    {width, height} = Sim.Map.size(map)
    wall? = fn x, y -> Sim.Map.wall?(map, {x, y}) end
    %Ground{name: map.name, width: width, height: height, wall?: wall?}
  end
end
