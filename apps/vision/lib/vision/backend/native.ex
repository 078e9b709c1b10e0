defmodule Vision.Backend.Native do
  @moduledoc """
  Finds blobs in C, for yuyv, i420 and nv12. It makes no label image: it joins runs of equal masks to those of the row
  above, so that only runs and regions take memory. Where the processor has AVX-512 (with VBMI) or AVX2, it looks up the classes
  of 64 or 32 pixels at once; AVX2 needs classes that are ranges, as those of `Vision.Colours` are. The regions are the same
  everywhere.

  With a scratch it searches for up to a millisecond on the scheduler of its caller; a large or
  noisy frame is finished on a dirty scheduler. Without one it is a dirty scheduler's from the
  start, which costs 3 to 12 us.

  ## Memory

  A region takes 48 bytes while it is searched for, and a noisy frame may have tens of thousands that
  are too small to be kept. To take that memory for each frame may cost half of the search, because the
  system clears each page again. So a process keeps a `scratch/0`, whose memory stays:

    * it grows with the frames, to 96 bytes for each pixel at the very most, plus 46 bytes for
      each column of the widest one and 9 kB; most frames need less than 100 kB;
    * after 64 frames in a row that needed less than a quarter of its room for regions, it keeps
      twice what they needed;
    * garbage collection frees it when nothing refers to it any more;
    * it is locked while a frame is searched. A second process that comes meanwhile with the same
      one takes memory of its own for that call; so does everybody after a process was killed while
      its frame waited for a dirty scheduler, because the lock then stays;
    * it outlives a new version of this module, unless that lays it out differently: such a scratch
      raises `ArgumentError`.

  If memory is out, the answer is `{:error, :memory}`, and the scratch can be used again.
  """
  @behaviour Vision.Backend
  use Hal.Nif, app: :vision, library: "blobs"
  alias Hal.Frame
  alias Vision.Colours

  # As in blobs.c: areas then fit into 32 bits.
  @largest 32_768
  @formats %{yuyv: 0, i420: 1, nv12: 2}

  @impl Vision.Backend
  def reads?(format), do: is_map_key(@formats, format) and loaded?()

  @doc "Scratch memory of the process that calls this; `nil` without the library."
  @impl Vision.Backend
  @spec scratch() :: reference() | nil
  def scratch, do: if(loaded?(), do: new())

  @doc "The bytes that a scratch holds; `{:error, :in_use}` while a frame is searched in it."
  @spec held(reference()) :: non_neg_integer() | {:error, :in_use}
  def held(_scratch), do: :erlang.nif_error(:nif_not_loaded)

  @impl Vision.Backend
  def regions(frame, colours, scratch \\ nil)

  def regions(%Frame{width: width, height: height}, _colours, _scratch)
      when width > @largest or height > @largest,
      do: {:error, {:size, {width, height}}}

  def regions(%Frame{} = frame, %Colours{} = colours, scratch) do
    find(
      Map.fetch!(@formats, frame.format),
      frame.width,
      frame.height,
      frame.bytes,
      colours.tables,
      colours.min_area,
      colours.max_area,
      scratch
    )
  end

  defp new, do: :erlang.nif_error(:nif_not_loaded)

  defp find(_format, _width, _height, _bytes, _tables, _min_area, _max_area, _scratch),
    do: :erlang.nif_error(:nif_not_loaded)
end
