defmodule Vision.Blobs.Options do
  @moduledoc false
  # The options of `mix blobs`: their table, and what is checked of all of them.

  alias Hal.Camera.Source
  alias Hal.Cli.Parse

  @type t :: %{
          source: String.t(),
          colours: Path.t(),
          every: pos_integer(),
          frames: pos_integer() | nil,
          json: Path.t() | nil,
          picture: Path.t() | nil,
          min_area: pos_integer(),
          backend: module() | nil,
          unsafe: boolean(),
          distance: %{String.t() => float()}
        }

  @most 1_000_000_000
  # Frames of the endless test picture, unless the options give another number.
  @test_frames 50

  @doc "The options, as `Hal.Cli.Arguments` takes them."
  @spec table() :: [Hal.Cli.Arguments.option()]
  def table do
    [
      {"colours", "FILE", &Parse.text/1, "CMVision colour file"},
      {"every", "N", &Parse.whole(&1, 1..@most), "search every N-th frame (1)"},
      {"frames", "N", &Parse.whole(&1, 1..@most),
       "end after N frames that were searched; without it, cameras and streams go on"},
      {"json", "FILE", &writable/1,
       "one JSON object per frame, each on its own line; - is standard output,\nand then nothing else is written there"},
      {"picture", "FILE", &picture/1, "the last frame with its blobs drawn in, .png or .jpg"},
      {"min-area", "N", &Parse.whole(&1, 1..@most), "smallest blob in pixels (20)"},
      {"distance", "NAME=K", &distance/1,
       "gives the blobs of a colour a distance in metres,\nsqrt(K / share of the frame); once for each colour"},
      {"backend", "MODULE", &backend/1,
       "the Vision.Backend to use; by default the fastest that reads the frames"},
      {"unsafe", nil, nil,
       "opens any source that ffmpeg knows: also filter graphs (lavfi:), which can\nwrite files, and streams of unknown schemes"}
    ]
  end

  @doc """
  Checks the options of a command line, and its other words: the source.

      iex> {:ok, options} = Vision.Blobs.Options.check([{"colours", "c.txt"}, {"distance", {"Red", 0.02}}], ["a.png"])
      iex> {options.source, options.every, options.distance}
      {"a.png", 1, %{"Red" => 0.02}}
      iex> Vision.Blobs.Options.check([], ["a.png"])
      {:error, "--colours FILE is missing: a CMVision colour file"}
  """
  @spec check([{String.t(), term()}], [String.t()]) :: {:ok, t()} | {:error, String.t()}
  def check(pairs, sources) do
    given = Map.new(pairs)

    with {:ok, source} <- one_source(sources),
         :ok <- safe(source, given["unsafe"]),
         :ok <- needed(given["colours"]) do
      {:ok,
       %{
         source: source,
         colours: given["colours"],
         every: given["every"] || 1,
         frames: given["frames"] || if(source == "testsrc", do: @test_frames),
         json: given["json"],
         picture: given["picture"],
         min_area: given["min-area"] || 20,
         backend: given["backend"],
         unsafe: given["unsafe"] || false,
         distance: for({"distance", {name, constant}} <- pairs, into: %{}, do: {name, constant})
       }}
    end
  end

  defp one_source([""]), do: one_source([])
  defp one_source([source]), do: {:ok, source}

  defp one_source([]),
    do: {:error, "no source: give a picture, video file, stream, /dev/video0 or testsrc"}

  defp one_source(many),
    do: {:error, "expected one source, got #{length(many)}: #{Enum.join(many, ", ")}"}

  defp safe(_source, true), do: :ok

  defp safe(source, _not_said) do
    case Source.refused(source) do
      nil -> :ok
      why -> {:error, "#{source}: #{why}; --unsafe opens it all the same"}
    end
  end

  defp needed(nil), do: {:error, "--colours FILE is missing: a CMVision colour file"}
  defp needed(_path), do: :ok

  defp picture(path) do
    if String.downcase(Path.extname(path)) in [".png", ".jpg", ".jpeg"],
      do: writable(path),
      else: {:error, "names ending in .png or .jpg"}
  end

  defp writable("-"), do: {:ok, "-"}

  defp writable(path) do
    cond do
      path == "" -> {:error, "the name of a file"}
      File.dir?(path) -> {:error, "a file, not a folder"}
      not File.dir?(Path.dirname(path)) -> {:error, "a file in a folder that exists"}
      true -> {:ok, path}
    end
  end

  # The colours check whether it is a backend.
  defp backend(name) do
    with :error <- Hal.Options.ModuleLookup.module(name),
         do: {:error, "a module of this build"}
  end

  defp distance(text) do
    with [name, number] <- String.split(text, "=", parts: 2),
         {constant, ""} when constant > 0 <- Float.parse(number),
         do: {:ok, {name, constant}},
         else: (_other -> {:error, "NAME=K with K above 0, as in Yellow=0.0651"})
  end
end
