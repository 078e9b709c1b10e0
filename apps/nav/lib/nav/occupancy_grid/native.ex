defmodule Nav.OccupancyGrid.Native do
  @moduledoc false
  # The kernels in C; `Nav.OccupancyGrid.Reference` documents them. The C code checks every size: wrong terms
  # raise ArgumentError.
  use Hal.Nif, app: :nav, library: "occupancy"

  @spec add(
          binary(),
          pos_integer(),
          right :: integer(),
          up :: integer(),
          decay :: non_neg_integer(),
          cones :: binary(),
          tangent :: float(),
          thick :: float(),
          discs :: binary(),
          sure :: pos_integer()
        ) :: {binary(), changes :: non_neg_integer()}
  def add(_cells, _size, _right, _up, _decay, _cones, _tangent, _thick, _discs, _sure),
    do: :erlang.nif_error(:nif_not_loaded)

  @spec walls(binary(), pos_integer(), {float(), float(), float(), float()}, pos_integer()) ::
          {binary(), count :: non_neg_integer()}
  def walls(_cells, _size, _at, _sure), do: :erlang.nif_error(:nif_not_loaded)
end
