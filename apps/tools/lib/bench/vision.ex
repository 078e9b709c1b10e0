defmodule Bench.Vision do
  @moduledoc """
  Lists what `mix bench vision` compares: the ways to search a frame, and the frames. Pure, but for
  reading a photograph.
  """
  alias Bench.Vision.Frames
  alias Hal.Frame
  alias Vision.Colours

  @typedoc "Frames of one kind with their colours; `copies` are the bytes of the frames."
  @type work :: %{
          name: :easy | :speckle | :photograph,
          colours: Colours.t(),
          frames: [Frame.t()],
          copies: [binary()]
        }
  @type name :: atom()
  @typedoc "A way to search: in this VM in each round, or by a slow one in some of them."
  @type way :: %{name: name(), says: String.t(), pace: :fast | :slow}

  @doc "All ways, in the order of the table."
  @spec ways() :: [way()]
  def ways do
    [
      %{name: :copy, says: "memcpy of the frame", pace: :fast},
      %{name: :kernel, says: "kernel, called from C", pace: :fast},
      %{name: :call, says: "call from Elixir, with a scratch", pace: :fast},
      %{name: :blobs, says: "the same, to `Vision.Blob`s", pace: :fast},
      %{name: :alone, says: "call without a scratch", pace: :fast},
      %{name: :evision, says: "`Vision.Backend.Evision`", pace: :slow},
      %{name: :nx, says: "`Vision.Backend.Nx`", pace: :slow},
      %{name: :opencv, says: "python3-opencv, one thread", pace: :slow}
    ]
  end

  @doc "The kinds of frames and what they show."
  @spec kinds() :: [{atom(), String.t()}]
  def kinds, do: [easy: "easy", speckle: "5 % speckle", photograph: "photograph"]

  @doc "The frames of a kind with so many classes; those of the photograph are made from the file at `photo`."
  @spec work(atom(), Path.t(), 8..32) :: {:ok, work()} | {:error, String.t()}
  def work(kind, photo, count \\ 8)

  def work(:easy, _photo, count),
    do: {:ok, make(:easy, Frames.easy(), Frames.classes(), count)}

  def work(:speckle, _photo, count),
    do: {:ok, make(:speckle, Frames.speckle(Frames.easy()), Frames.classes(), count)}

  def work(:photograph, photo, count) do
    with {:ok, bytes} <- photograph(photo),
         do: {:ok, make(:photograph, bytes, Frames.classes_of(bytes), count)}
  end

  defp make(name, bytes, classes, count) do
    {:ok, colours} = Colours.new(Frames.more(classes, count))
    {width, height, _copies} = Frames.size()
    copies = Frames.rolled(bytes)

    frames =
      for bytes <- copies do
        {:ok, frame} = Frame.new(:yuyv, width, height, bytes, 0)
        frame
      end

    %{name: name, colours: colours, frames: frames, copies: copies}
  end

  defp photograph(path) do
    {width, height, _copies} = Frames.size()
    filter = "scale=#{width}:#{height}:out_color_matrix=bt601:out_range=full,format=yuyv422"
    words = ~w(-v error -nostdin -i) ++ [path, "-vf", filter, "-frames:v", "1", "-f", "rawvideo"]

    with true <- File.regular?(path),
         ffmpeg when is_binary(ffmpeg) <- System.find_executable("ffmpeg"),
         {bytes, 0} when byte_size(bytes) == 2 * width * height <-
           System.cmd(ffmpeg, words ++ ["-"]) do
      {:ok, bytes}
    else
      false -> {:error, "#{path} is not there: bin/opencv-data fetches it"}
      nil -> {:error, "ffmpeg is not there"}
      {_bytes, _status} -> {:error, "#{path} is not a picture"}
    end
  end
end
