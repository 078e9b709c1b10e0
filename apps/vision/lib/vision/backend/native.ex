defmodule Vision.Backend.Native do
  @moduledoc """
  The blob finder in C, for yuyv, i420 and nv12. It makes no label image: it joins runs of equal
  masks to those of the row above, so that only runs and regions take memory. It runs on a dirty
  scheduler, because a large or noisy frame may take more than a millisecond.
  """
  @behaviour Vision.Backend
  @on_load :load
  alias Hal.Frame
  alias Vision.Colours

  # As in blobs.c: areas then fit into 32 bits.
  @largest 32_768
  @formats %{yuyv: 0, i420: 1, nv12: 2}

  @doc false
  @spec load() :: :ok
  def load do
    # Without the library the stubs remain, and `Vision.blobs/3` uses the reference.
    _ = :erlang.load_nif(to_charlist(Application.app_dir(:vision, "priv/blobs")), 0)
    :ok
  end

  @doc "Whether the C library was built and loaded."
  @spec loaded?() :: boolean()
  # The library replaces this function. From a plain `false`, a compiler that infers types would
  # conclude that it is always false.
  def loaded?, do: not function_exported?(__MODULE__, :loaded?, 0)

  @impl Vision.Backend
  def reads?(format), do: is_map_key(@formats, format) and loaded?()

  @impl Vision.Backend
  def regions(%Frame{width: width, height: height}, _colours)
      when width > @largest or height > @largest,
      do: {:error, {:size, {width, height}}}

  def regions(%Frame{} = frame, %Colours{} = colours) do
    find(
      Map.fetch!(@formats, frame.format),
      frame.width,
      frame.height,
      frame.bytes,
      colours.tables,
      colours.min_area,
      colours.max_area
    )
  end

  defp find(_format, _width, _height, _bytes, _tables, _min_area, _max_area),
    do: :erlang.nif_error(:nif_not_loaded)
end
