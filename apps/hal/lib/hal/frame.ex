defmodule Hal.Frame do
  @moduledoc """
  Holds one camera picture. Rows run from the top, pixels from the left.

  | format | bytes |
  |---|---|
  | `:yuyv` | Y0 U Y1 V for each pair of pixels; even width |
  | `:i420` | plane Y, then U and V at half width and half height; even width and height |
  | `:nv12` | plane Y, then interleaved U V at half width and half height; even width and height |
  | `:yuv444` | planes Y, U, V, all of full size |
  | `:rgb24` | R G B for each pixel |

  `at_ms` is when the picture was taken, as near as its source knows, by the clock of the robot
  (monotonic, or the simulator's). `pan` and `tilt` (radians, left and up positive) say where the
  camera looked then, and `field_of_view` how wide. They are `nil` if the camera does not know
  them; its pan-tilt unit does (`Hal.Ptz.History`).
  """

  @enforce_keys [:format, :width, :height, :bytes, :at_ms]
  defstruct @enforce_keys ++ [pan: nil, tilt: nil, field_of_view: nil]

  @type format :: :yuyv | :i420 | :nv12 | :yuv444 | :rgb24
  @type t :: %__MODULE__{
          format: format(),
          width: pos_integer(),
          height: pos_integer(),
          bytes: binary(),
          at_ms: integer(),
          pan: float() | nil,
          tilt: float() | nil,
          field_of_view: float() | nil
        }

  @formats [:yuyv, :i420, :nv12, :yuv444, :rgb24]

  @doc "All formats."
  @spec formats() :: [format(), ...]
  def formats, do: @formats

  @doc """
  The number of bytes of a frame of this format and size; an error if the format does not allow
  the size.

      iex> Hal.Frame.byte_size(:yuyv, 320, 240)
      {:ok, 153_600}
      iex> Hal.Frame.byte_size(:i420, 3, 2)
      {:error, {:size, {3, 2}}}
  """
  @spec byte_size(format(), pos_integer(), pos_integer()) ::
          {:ok, pos_integer()} | {:error, {:size, term()}}
  def byte_size(:yuyv, w, h) when w > 0 and h > 0 and rem(w, 2) == 0, do: {:ok, 2 * w * h}

  def byte_size(format, w, h)
      when format in [:i420, :nv12] and w > 0 and h > 0 and rem(w, 2) == 0 and rem(h, 2) == 0,
      do: {:ok, div(3 * w * h, 2)}

  def byte_size(format, w, h) when format in [:yuv444, :rgb24] and w > 0 and h > 0,
    do: {:ok, 3 * w * h}

  def byte_size(_format, w, h), do: {:error, {:size, {w, h}}}

  @doc """
  A frame, if its size and its number of bytes fit the format.

      iex> {:error, {:bytes, 5, :expected, 12}} = Hal.Frame.new(:rgb24, 2, 2, <<1, 2, 3, 4, 5>>, 0)
      iex> {:ok, frame} = Hal.Frame.new(:yuyv, 2, 1, <<1, 2, 3, 4>>, 7)
      iex> frame.at_ms
      7
  """
  @spec new(format(), pos_integer(), pos_integer(), binary(), integer()) ::
          {:ok, t()}
          | {:error, {:size, term()} | {:bytes, non_neg_integer(), :expected, pos_integer()}}
  def new(format, width, height, bytes, at_ms) when format in @formats do
    with {:ok, size} <- byte_size(format, width, height) do
      if Kernel.byte_size(bytes) == size do
        {:ok,
         %__MODULE__{format: format, width: width, height: height, bytes: bytes, at_ms: at_ms}}
      else
        {:error, {:bytes, Kernel.byte_size(bytes), :expected, size}}
      end
    end
  end
end
