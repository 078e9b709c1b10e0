defmodule Vision.Rgb do
  @moduledoc """
  Converts RGB to YUV as CMVision's driver does it: full range, whole numbers, rounded down.

  Two neighbours in a row, the even pixel and the odd one to its right, share their chroma. So an
  edge between them mixes it, and a thin object may lose a column of pixels.
  """
  import Bitwise

  @type rgb :: {0..255, 0..255, 0..255}
  @type yuv :: {0..255, 0..255, 0..255}

  @doc """
  Converts one pixel.

      iex> Vision.Rgb.to_yuv({220, 205, 90})
      {196, 67, 144}
      iex> Vision.Rgb.to_yuv({0, 0, 0})
      {0, 128, 128}
  """
  @spec to_yuv(rgb()) :: yuv()
  def to_yuv({r, g, b}) do
    {clamp((306 * r + 601 * g + 117 * b) >>> 10),
     clamp(((-172 * r - 340 * g + 512 * b) >>> 10) + 128),
     clamp(((512 * r - 429 * g - 83 * b) >>> 10) + 128)}
  end

  @doc """
  Converts one pixel back, for pictures that people look at (the usual full-range factors,
  rounded).

      iex> Vision.Rgb.from_yuv({128, 128, 128})
      {128, 128, 128}
  """
  @spec from_yuv(yuv()) :: rgb()
  def from_yuv({y, u, v}) do
    {clamp((1024 * y + 1436 * (v - 128) + 512) >>> 10),
     clamp((1024 * y - 352 * (u - 128) - 731 * (v - 128) + 512) >>> 10),
     clamp((1024 * y + 1815 * (u - 128) + 512) >>> 10)}
  end

  @doc """
  Converts a row of pixels. Pairs share their chroma; the last pixel of an odd row keeps its own.

      iex> Vision.Rgb.row([{220, 205, 90}, {0, 0, 0}])
      [{196, 97, 136}, {0, 97, 136}]
  """
  @spec row([rgb()]) :: [yuv()]
  def row([left, right | rest]) do
    {y0, u0, v0} = to_yuv(left)
    {y1, u1, v1} = to_yuv(right)
    u = (u0 + u1) >>> 1
    v = (v0 + v1) >>> 1
    [{y0, u, v}, {y1, u, v} | row(rest)]
  end

  def row([last]), do: [to_yuv(last)]
  def row([]), do: []

  defp clamp(value), do: value |> max(0) |> min(255)
end
