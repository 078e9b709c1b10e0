defmodule Vision.Blobs.Report do
  @moduledoc "Formats what was found in a frame, as a line of JSON and as a table for people."
  alias Vision.{Blob, Blobs}

  @doc """
  One JSON object, without a line end. `right` and `bottom` are the last pixels inside;
  `distance_m` is `null` if the colour has no constant or the blob is too near.

      iex> {:ok, frame} = Hal.Frame.new(:yuyv, 2, 1, <<0, 0, 0, 0>>, 0)
      iex> Vision.Blobs.Report.json(%{number: 3, at_s: 0.1, frame: frame, blobs: []})
      ~S({"frame":3,"at_s":0.1,"width":2,"height":1,"blobs":[]})
  """
  @spec json(Blobs.seen()) :: String.t()
  def json(%{number: number, at_s: at_s, frame: frame, blobs: blobs}) do
    Hal.Json.encode!(
      {:object,
       frame: number,
       at_s: at_s,
       width: frame.width,
       height: frame.height,
       blobs: Enum.map(blobs, &blob_object/1)}
    )
  end

  @doc "A heading and one line for each blob."
  @spec table(Blobs.seen()) :: iodata()
  def table(%{number: number, at_s: at_s, frame: frame, blobs: blobs}) do
    heading =
      "frame #{number}  #{decimals(at_s, 3)} s  #{frame.width}x#{frame.height}  #{count(length(blobs), "blob")}\n"

    [heading | if(blobs == [], do: [], else: [columns() | Enum.map(blobs, &row/1)])]
  end

  @doc """
  A count with its noun.

      iex> {Vision.Blobs.Report.count(1, "blob"), Vision.Blobs.Report.count(0, "frame")}
      {"1 blob", "0 frames"}
  """
  @spec count(non_neg_integer(), String.t()) :: String.t()
  def count(1, thing), do: "1 #{thing}"
  def count(n, thing), do: "#{n} #{thing}s"

  defp blob_object(%Blob{} = blob) do
    {:object,
     colour: blob.colour,
     area: blob.area,
     area_share: blob.share,
     x: Float.round(blob.x, 3),
     y: Float.round(blob.y, 3),
     left: blob.left,
     top: blob.top,
     right: blob.right,
     bottom: blob.bottom,
     distance_m: blob.distance && Float.round(blob.distance, 3),
     clipped: blob.clipped?}
  end

  defp columns,
    do: line(["colour", "area", "share", "x", "y", "left,top - right,bottom", "distance"])

  defp row(%Blob{} = blob) do
    line([
      blob.colour,
      blob.area,
      "#{decimals(100 * blob.share, 2)} %",
      decimals(blob.x, 1),
      decimals(blob.y, 1),
      "#{blob.left},#{blob.top} - #{blob.right},#{blob.bottom}#{if blob.clipped?, do: " (clipped)"}",
      if(blob.distance, do: "#{decimals(blob.distance, 2)} m", else: "-")
    ])
  end

  defp line([colour, area, share, x, y, box, distance]) do
    ["  ", String.pad_trailing(colour, 16)] ++
      [pad(area, 8), pad(share, 9), pad(x, 8), pad(y, 8), "  "] ++
      [String.pad_trailing(box, 30), pad(distance, 9), "\n"]
  end

  defp pad(value, width), do: String.pad_leading("#{value}", width)

  defp decimals(number, places), do: :erlang.float_to_binary(number / 1, decimals: places)
end
