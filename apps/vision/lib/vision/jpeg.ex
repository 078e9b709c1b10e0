defmodule Vision.Jpeg do
  @moduledoc """
  Builds the arguments with which ffmpeg encodes raw frames from its input as JPEG, one picture for each, and parses its
  output: a stream of parts, each with its length. Pure; `Vision.Jpeg.Encoder` runs it.

  A picture keeps the chroma resolution of its frame, and the full range, which JPEG is made for.
  """
  alias Hal.Frame

  @formats %{
    yuyv: {"yuyv422", "yuvj422p"},
    i420: {"yuv420p", "yuvj420p"},
    nv12: {"nv12", "yuvj420p"},
    yuv444: {"yuv444p", "yuvj444p"},
    rgb24: {"rgb24", "yuvj444p"}
  }
  @longest_head 256

  @typedoc "What an encoder is opened for: the format and size of its frames."
  @type shape :: {Frame.format(), width :: pos_integer(), height :: pos_integer()}

  @doc "ffmpeg's arguments. `quality` is ffmpeg's, 2 (best) to 31."
  @spec arguments(shape(), quality :: 2..31) :: [String.t()]
  def arguments({format, width, height}, quality) do
    {raw, jpeg} = Map.fetch!(@formats, format)
    matrix = "scale=in_range=full:out_range=full:in_color_matrix=bt601:out_color_matrix=bt601"

    # With one thread and without looking ahead, a picture comes out before the next frame goes
    # in.
    ~w(-nostdin -hide_banner -loglevel quiet -threads 1 -probesize 32 -analyzeduration 0) ++
      ~w(-f rawvideo -pixel_format #{raw} -color_range pc -video_size #{width}x#{height}) ++
      ~w(-i pipe:0 -vf #{matrix},format=#{jpeg} -fps_mode passthrough -c:v mjpeg -threads 1) ++
      ~w(-q:v #{quality} -flush_packets 1 -f mpjpeg pipe:1)
  end

  @doc """
  The greatest length of a JPEG that is accepted for such a frame.

      iex> Vision.Jpeg.longest({:yuyv, 320, 240})
      372_736
  """
  @spec longest(shape()) :: pos_integer()
  def longest({format, width, height}) do
    {:ok, size} = Frame.byte_size(format, width, height)
    2 * size + 65_536
  end

  @doc """
  Takes the first whole picture from the output of ffmpeg; the rest is for the next time.

      iex> head = "--ffmpeg\\r\\nContent-type: image/jpeg\\r\\nContent-length: 4\\r\\n\\r\\n"
      iex> Vision.Jpeg.take(head <> <<0xFF, 0xD8, 0xFF>>, 100)
      :more
      iex> Vision.Jpeg.take(head <> <<0xFF, 0xD8, 0xFF, 0xD9, ?\\r>>, 100)
      {:ok, <<0xFF, 0xD8, 0xFF, 0xD9>>, "\\r"}
      iex> Vision.Jpeg.take(head, 3)
      {:error, :unreadable}
  """
  @spec take(binary(), longest :: pos_integer()) ::
          {:ok, jpeg :: binary(), rest :: binary()} | :more | {:error, :unreadable}
  def take(buffer, longest) do
    case :binary.match(buffer, "\r\n\r\n", scope: {0, min(byte_size(buffer), @longest_head)}) do
      {at, 4} ->
        {head, <<_blank::32, body::binary>>} = :erlang.split_binary(buffer, at)
        body(length_of(head), body, longest)

      :nomatch ->
        if byte_size(buffer) < @longest_head, do: :more, else: {:error, :unreadable}
    end
  end

  defp length_of(head) do
    with [_before, number] <- String.split(head, "Content-length: ", parts: 2),
         {length, _after} <- Integer.parse(number) do
      length
    else
      _none -> nil
    end
  end

  defp body(length, body, longest) when length in 4..longest//1 do
    case body do
      <<0xFF, 0xD8, _::binary>> when byte_size(body) >= length ->
        {jpeg, rest} = :erlang.split_binary(body, length)
        # So that a small picture does not keep the whole buffer.
        {:ok, :binary.copy(jpeg), :binary.copy(rest)}

      <<first, _::binary>> when first != 0xFF ->
        {:error, :unreadable}

      <<0xFF, second, _::binary>> when second != 0xD8 ->
        {:error, :unreadable}

      _part ->
        :more
    end
  end

  defp body(_length, _body, _longest), do: {:error, :unreadable}
end
