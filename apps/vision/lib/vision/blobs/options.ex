defmodule Vision.Blobs.Options do
  @moduledoc false
  # Parses the command line of `mix blobs` into a checked map, or one line that says what is wrong.

  alias Hal.Camera.Source
  alias Hal.CommandOutput

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

  @switches [
    colours: :string,
    every: :integer,
    frames: :integer,
    json: :string,
    picture: :string,
    min_area: :integer,
    backend: :string,
    distance: :keep,
    unsafe: :boolean,
    help: :boolean
  ]
  @most 1_000_000_000
  # Frames of the endless test picture, unless the options give another number.
  @test_frames 50

  @doc """
  Parses the words of the command line.

      iex> {:ok, options} = Vision.Blobs.Options.parse(~w(a.png --colours c.txt --distance Red=0.02))
      iex> {options.source, options.every, options.distance}
      {"a.png", 1, %{"Red" => 0.02}}
      iex> Vision.Blobs.Options.parse(~w(a.png --colors c.txt))
      {:error, "unknown option --colors; did you mean --colours?"}
      iex> Vision.Blobs.Options.parse(["--help"])
      :help
  """
  @spec parse([String.t()]) :: {:ok, t()} | :help | {:error, String.t()}
  def parse(words) do
    with {:ok, given, sources} <-
           CommandOutput.parse(words, strict: @switches, aliases: [h: :help]),
         do: check(given, sources)
  end

  defp check(given, sources) do
    with {:ok, source} <- one_source(sources),
         :ok <- safe(source, given[:unsafe]),
         :ok <- needed(given[:colours]),
         :ok <- positive("--every", given[:every]),
         :ok <- positive("--frames", given[:frames]),
         :ok <- positive("--min-area", given[:min_area]),
         :ok <- picture(given[:picture]),
         :ok <- writable("--picture", given[:picture]),
         :ok <- writable("--json", given[:json]),
         {:ok, backend} <- backend(given[:backend]),
         {:ok, distance} <- distances(Keyword.get_values(given, :distance)) do
      {:ok,
       %{
         source: source,
         colours: given[:colours],
         every: given[:every] || 1,
         frames: given[:frames] || if(source == "testsrc", do: @test_frames),
         json: given[:json],
         picture: given[:picture],
         min_area: given[:min_area] || 20,
         backend: backend,
         unsafe: given[:unsafe] || false,
         distance: distance
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

  defp needed(""), do: needed(nil)
  defp needed(nil), do: {:error, "--colours FILE is missing: a CMVision colour file"}
  defp needed(_path), do: :ok

  defp positive(_option, nil), do: :ok
  defp positive(_option, value) when value in 1..@most, do: :ok

  defp positive(option, value),
    do: {:error, "#{option}: expected whole numbers from 1 to #{@most}, got #{value}"}

  defp picture(nil), do: :ok

  defp picture(path) do
    if String.downcase(Path.extname(path)) in [".png", ".jpg", ".jpeg"],
      do: :ok,
      else: {:error, "--picture: expected names ending in .png or .jpg, got #{inspect(path)}"}
  end

  defp writable(_option, path) when path in [nil, "-"], do: :ok

  defp writable(option, path) do
    cond do
      path == "" ->
        {:error, "#{option}: expected the name of a file, got \"\""}

      File.dir?(path) ->
        {:error, "#{option}: expected a file, got #{inspect(path)}, a folder"}

      not File.dir?(Path.dirname(path)) ->
        {:error, "#{option} #{path}: no folder #{Path.dirname(path)}"}

      true ->
        :ok
    end
  end

  defp backend(nil), do: {:ok, nil}

  # The colours check whether it is a backend.
  defp backend(name) do
    with :error <- Hal.Options.ModuleLookup.module(name),
         do: {:error, "--backend: expected a module of this build, got #{inspect(name)}"}
  end

  defp distances(texts) do
    Enum.reduce_while(texts, {:ok, %{}}, fn text, {:ok, distances} ->
      with [name, number] <- String.split(text, "=", parts: 2),
           {constant, ""} when constant > 0 <- Float.parse(number) do
        {:cont, {:ok, Map.put(distances, name, constant)}}
      else
        _other ->
          {:halt,
           {:error,
            "--distance: expected NAME=K with K above 0, as in Yellow=0.0651, got #{inspect(text)}"}}
      end
    end)
  end
end
