defmodule Nav.Grid.Native do
  @moduledoc false
  # The kernels in C; `Nav.Grid` documents them. The C code checks every size: wrong terms
  # raise ArgumentError.
  use Hal.Nif, app: :nav, library: "grid"

  @spec clearance(binary(), pos_integer(), pos_integer(), float(), boolean()) :: binary()
  def clearance(_cells, _width, _height, _cell, _closed?), do: :erlang.nif_error(:nif_not_loaded)

  @spec overlay(
          binary(),
          pos_integer(),
          pos_integer(),
          over :: binary(),
          pos_integer(),
          pos_integer(),
          left :: integer(),
          low :: integer()
        ) :: binary()
  def overlay(_clear, _width, _height, _over, _over_width, _over_height, _left, _low),
    do: :erlang.nif_error(:nif_not_loaded)

  @spec way(
          binary(),
          pos_integer(),
          pos_integer(),
          need :: pos_integer(),
          discs :: binary(),
          start :: non_neg_integer(),
          goal :: non_neg_integer()
        ) :: [non_neg_integer()]
  def way(_clear, _width, _height, _need, _discs, _start, _goal),
    do: :erlang.nif_error(:nif_not_loaded)

  @spec spread(times :: binary(), pos_integer(), pos_integer(), start :: non_neg_integer()) ::
          binary()
  def spread(_times, _width, _height, _start), do: :erlang.nif_error(:nif_not_loaded)
end
