defmodule Bench.Vision.Kernel do
  @moduledoc false
  # Times the C code of `Vision.Backend.Native` without the call from Elixir, and a `memcpy` of the
  # same frames: in this VM, on the same scheduler, with the code and the compiler's options of the
  # vision app. It is not in the vision app, because robots do not need it.
  use Hal.Nif, app: :tools, library: "kernel"

  @doc "Searches yuyv frames; nanoseconds and number of regions of each, from the last to the first."
  @spec find([binary()], pos_integer(), pos_integer(), tables :: binary(), pos_integer()) ::
          [{nanoseconds :: non_neg_integer(), regions :: non_neg_integer()}]
  def find(_frames, _width, _height, _tables, _min_area), do: :erlang.nif_error(:nif_not_loaded)

  @doc "Copies binaries; nanoseconds of each, from the last to the first."
  @spec copy([binary()]) :: [non_neg_integer()]
  def copy(_frames), do: :erlang.nif_error(:nif_not_loaded)
end
