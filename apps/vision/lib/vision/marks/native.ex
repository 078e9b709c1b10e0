defmodule Vision.Marks.Native do
  @moduledoc """
  Finds AprilTags by Debian's libapriltag (E. Olson, "AprilTag: A robust and flexible visual fiducial system", 2011; J. Wang and
  E. Olson, "AprilTag 2", 2016; M. Krogius et al., "Flexible layouts for fiducial tags", 2019). It is built where the header
  `apriltag/apriltag.h` is. At most one wrong bit of a code is corrected, and pictures are searched in full resolution.

  All functions run on dirty schedulers: a whole picture takes 5 to 200 ms.
  """
  use Hal.Nif, app: :vision, library: "marks"
  alias Hal.Frame

  @families %{tag36h11: 0, tagStandard41h12: 1}
  @formats %{yuyv: 0, i420: 1, nv12: 2}

  @typedoc "A detector of one family. Garbage collection frees it."
  @opaque detector :: {Vision.Mark.family(), reference()}
  @type found ::
          {id :: non_neg_integer(), wrong_bits :: 0..1, margin :: float(), Vision.Mark.point(),
           corners :: [Vision.Mark.point(), ...]}

  @doc "A detector, for the process that calls this; another one that uses it has to wait for it."
  @spec detector(Vision.Mark.family()) :: detector()
  def detector(family), do: {family, new(Map.fetch!(@families, family))}

  @doc """
  What is found in a part of a frame: `{left, top, right, bottom}`, its first column and row, and those behind its last. Pixels
  are those of the part. Formats and sizes that `Vision.Marks` refuses raise `ArgumentError`.
  """
  @spec search(detector(), Frame.t(), Vision.Marks.Schedule.box()) ::
          {:ok, [found()]} | {:error, :memory}
  def search({_family, kept}, %Frame{format: format} = frame, box),
    do: find(kept, @formats[format], frame.width, frame.height, frame.bytes, box)

  @doc """
  The picture of a mark: how many cells it is wide, how many of these the square between its corners is, and its cells row by
  row, 1 for white. `nil` if the family has no such id.
  """
  @spec picture(Vision.Mark.family(), non_neg_integer()) ::
          {cells :: pos_integer(), border :: pos_integer(), binary()} | nil
  def picture(family, id) when id < 0x10000, do: cells(Map.fetch!(@families, family), id)
  def picture(_family, _id), do: nil

  defp new(_family), do: :erlang.nif_error(:nif_not_loaded)

  defp find(_detector, _format, _width, _height, _bytes, _box),
    do: :erlang.nif_error(:nif_not_loaded)

  defp cells(_family, _id), do: :erlang.nif_error(:nif_not_loaded)
end
