defmodule Console.Picture.Floorplan do
  @moduledoc "Presents the map of a simulated world as a `Console.Picture.MapView`. Pure."
  alias Console.Picture.MapView

  @doc """
  The view of a map; a map view is returned unchanged.

      iex> {:ok, map} = Sim.Floorplan.open("hall", 6)
      iex> ground = Console.Picture.Floorplan.of(map)
      iex> {ground.name, ground.wall?.(0.0, 0.0), ground.wall?.(99.0, 0.0)}
      {"hall", false, true}
  """
  @spec of(MapView.t() | Sim.Floorplan.t()) :: MapView.t()
  def of(%MapView{} = ground), do: ground

  def of(%Sim.Floorplan{} = map) do
    {width, height} = Sim.Floorplan.size(map)
    wall? = fn x, y -> Sim.Floorplan.wall?(map, {x, y}) end
    unknown? = if map.unknown, do: fn x, y -> Sim.Floorplan.unknown?(map, {x, y}) end
    %MapView{name: map.name, width: width, height: height, wall?: wall?, unknown?: unknown?}
  end
end
