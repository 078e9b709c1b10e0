defmodule Sim.Compute.Native do
  @moduledoc false
  # The kernels in C; `Sim.Compute` documents them. The C code checks every size: wrong terms
  # raise ArgumentError.
  use Hal.Nif, app: :sim, library: "kernel"

  @spec field(binary(), pos_integer(), pos_integer()) :: binary()
  def field(_walls, _width, _height), do: :erlang.nif_error(:nif_not_loaded)

  @spec sonar_few(tuple(), binary(), [tuple()], tuple() | nil) :: [[float()]]
  def sonar_few(_map, _discs, _rings, _noise), do: :erlang.nif_error(:nif_not_loaded)

  @spec sonar_many(tuple(), binary(), [tuple()], tuple() | nil) :: [[float()]]
  def sonar_many(_map, _discs, _rings, _noise), do: :erlang.nif_error(:nif_not_loaded)

  @spec scan_few(tuple(), binary(), [tuple()], tuple() | nil) :: [binary()]
  def scan_few(_map, _discs, _lidars, _noise), do: :erlang.nif_error(:nif_not_loaded)

  @spec scan_many(tuple(), binary(), [tuple()], tuple() | nil) :: [binary()]
  def scan_many(_map, _discs, _lidars, _noise), do: :erlang.nif_error(:nif_not_loaded)

  @spec look(tuple(), tuple(), binary()) :: binary()
  def look(_map, _sight, _poles), do: :erlang.nif_error(:nif_not_loaded)

  @spec join(binary(), <<_::16>>) :: [Sim.Compute.Regions.t()]
  def join(_pieces, _least), do: :erlang.nif_error(:nif_not_loaded)

  @spec paint(tuple(), tuple(), binary(), [tuple()], tuple() | nil, binary()) :: binary()
  def paint(_map, _sight, _poles, _marks, _noise, _tables), do: :erlang.nif_error(:nif_not_loaded)
end
