defmodule Vision.Pixels do
  @moduledoc "Lists the YUV pixels of a frame of any format. Simple and slow."
  alias Hal.Frame

  @doc """
  All pixels, row by row from the top left.

      iex> {:ok, frame} = Hal.Frame.new(:yuyv, 2, 1, <<10, 60, 20, 130>>, 0)
      iex> Vision.Pixels.yuv(frame)
      [{10, 60, 130}, {20, 60, 130}]
      iex> {:ok, frame} = Hal.Frame.new(:i420, 2, 2, <<1, 2, 3, 4, 60, 130>>, 0)
      iex> Vision.Pixels.yuv(frame)
      [{1, 60, 130}, {2, 60, 130}, {3, 60, 130}, {4, 60, 130}]
  """
  @spec yuv(Frame.t()) :: [Vision.Rgb.yuv()]
  def yuv(%Frame{format: :yuyv, bytes: bytes}) do
    Enum.flat_map(
      for(<<y0, u, y1, v <- bytes>>, do: {y0, u, y1, v}),
      fn {y0, u, y1, v} -> [{y0, u, v}, {y1, u, v}] end
    )
  end

  def yuv(%Frame{format: :i420, width: w, height: h, bytes: bytes}) do
    u = w * h
    v = u + div(u, 4)

    shared(w, h, bytes, fn index ->
      {:binary.at(bytes, u + index), :binary.at(bytes, v + index)}
    end)
  end

  def yuv(%Frame{format: :nv12, width: w, height: h, bytes: bytes}) do
    shared(w, h, bytes, fn index ->
      {:binary.at(bytes, w * h + 2 * index), :binary.at(bytes, w * h + 2 * index + 1)}
    end)
  end

  def yuv(%Frame{format: :yuv444, width: w, height: h, bytes: bytes}) do
    size = w * h
    [y, u, v] = for plane <- 0..2, do: binary_part(bytes, plane * size, size)
    Enum.zip([:binary.bin_to_list(y), :binary.bin_to_list(u), :binary.bin_to_list(v)])
  end

  def yuv(%Frame{format: :rgb24, width: w, bytes: bytes}) do
    for(<<r, g, b <- bytes>>, do: {r, g, b})
    |> Enum.chunk_every(w)
    |> Enum.flat_map(&Vision.Rgb.row/1)
  end

  # Two by two pixels share one pair of chroma values.
  defp shared(w, h, bytes, chroma) do
    for row <- 0..(h - 1), x <- 0..(w - 1) do
      {u, v} = chroma.(div(row, 2) * div(w, 2) + div(x, 2))
      {:binary.at(bytes, row * w + x), u, v}
    end
  end
end
