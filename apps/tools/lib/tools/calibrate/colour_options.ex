defmodule Tools.Calibrate.ColourOptions do
  @moduledoc false
  # Reads the command line of `mix calibrate colour`: turns its arguments into a checked map or error
  # lines. Pure.
  alias Hal.Cli.Parse

  @type t :: %{
          source: String.t(),
          places: [Vision.Calibration.Sample.place(), ...],
          name: String.t(),
          colours: Path.t() | nil,
          write: boolean(),
          picture: Path.t() | nil,
          frames: pos_integer() | nil,
          tolerance: :auto | float(),
          min_area: pos_integer(),
          metres: float() | nil
        }

  @doc "The table of the options, as `Hal.Cli.Arguments` takes it."
  @spec table() :: [Hal.Cli.Arguments.option()]
  def table do
    [
      {"box", "X,Y,W,H", &numbers(&1, 4, "X,Y,WIDTH,HEIGHT in pixels from the top left"),
       "a box that shows the thing and little else; may be repeated"},
      {"point", "X,Y", &numbers(&1, 2, "X,Y in pixels from the top left"),
       "a point that shows it (5 by 5 pixels); may be repeated. With points and\nboxes the points say what colour, the boxes how it varies"},
      {"name", "NAME", &name/1, "of the colour, one word"},
      {"colours", "FILE", &file/1,
       "the colour file to write it to; created if it does not exist"},
      {"write", nil, nil, "writes it without asking; prints the changes"},
      {"picture", "FILE", &picture/1,
       "a preview, .png or .jpg: what matches the colour is bright, everything else\ndark and grey; its blobs and your boxes are outlined"},
      {"frames", "N", &Parse.whole(&1, 1..100),
       "looks at this many frames together (1 of files, 10 of cameras)"},
      {"light", "PERCENT", &light/1,
       "how much more or less light is tolerated (auto: the most, up to 40,\nwith which nothing else in the picture is found)"},
      {"min-area", "PIXELS", &Parse.whole(&1, 1..1_000_000), "smaller blobs are ignored (20)"},
      {"metres", "METRES", &Parse.number(&1, 0.1, 20),
       "the distance of the thing: gives the constant for the robot file"}
    ]
  end

  @doc """
  Reads the arguments after `colour`.

      iex> {:ok, options} = Tools.Calibrate.ColourOptions.parse(~w(a.png --box 10,20,60,80 --name Red))
      iex> {options.source, options.places, options.tolerance}
      {"a.png", [box: {10, 20, 60, 80}], :auto}
      iex> Tools.Calibrate.ColourOptions.parse(~w(a.png --box 10,20 --name Red))
      {:error, [~s(--box: expected X,Y,WIDTH,HEIGHT in pixels from the top left, got "10,20")]}
      iex> Tools.Calibrate.ColourOptions.parse(~w(a.png --nmae Red))
      {:error, ["unknown option --nmae; did you mean --name?"]}
  """
  @spec parse([String.t()]) :: {:ok, t()} | :help | {:error, [String.t()]}
  def parse(words) do
    {sources, words} = Enum.split_while(words, &(not String.starts_with?(&1, "--")))

    with {:ok, given} <- Hal.Cli.Arguments.parse(words, table()) do
      map = Map.new(given)
      if map["help"], do: :help, else: check(sources, given, map)
    end
  end

  defp check(sources, given, map) do
    places = for {name, value} <- given, name in ["box", "point"], do: {kind(name), value}

    problems =
      [
        sources == [] && "SOURCE is missing: a picture, video, stream, /dev/video0 or sim",
        length(sources) > 1 &&
          "expected one source, got #{length(sources)}: #{Enum.join(sources, ", ")}",
        places == [] && "--box X,Y,WIDTH,HEIGHT or --point X,Y is missing",
        map["name"] == nil && "--name NAME is missing",
        map["write"] == true && map["colours"] == nil && "--write needs --colours FILE"
      ]
      |> Enum.filter(& &1)

    if problems == [],
      do: {:ok, options(hd(sources), places, map)},
      else: {:error, problems}
  end

  defp kind("box"), do: :box
  defp kind("point"), do: :point

  defp options(source, places, map) do
    %{
      source: source,
      places: places,
      name: map["name"],
      colours: map["colours"],
      write: map["write"] || false,
      picture: map["picture"],
      frames: map["frames"],
      tolerance: map["light"] || :auto,
      min_area: map["min-area"] || 20,
      metres: map["metres"]
    }
  end

  defp numbers(text, count, form) do
    parts = text |> String.split(",") |> Enum.map(&Parse.whole(&1, 0..65_535))

    if length(parts) == count and Enum.all?(parts, &match?({:ok, _}, &1)),
      do: {:ok, parts |> Enum.map(&elem(&1, 1)) |> List.to_tuple()},
      else: {:error, form}
  end

  defp name(text) do
    if text =~ ~r/\A[^\s#[:cntrl:]][^\s[:cntrl:]]{0,59}\z/u,
      do: {:ok, text},
      else: {:error, "one word of up to 60 letters"}
  end

  defp file(text) do
    cond do
      text == "" or File.dir?(text) -> {:error, "the path of a file"}
      not File.dir?(Path.dirname(text)) -> {:error, "in a folder that exists"}
      true -> {:ok, text}
    end
  end

  defp picture(text) do
    if String.downcase(Path.extname(text)) in [".png", ".jpg", ".jpeg"],
      do: file(text),
      else: {:error, "a name that ends in .png or .jpg"}
  end

  defp light("auto"), do: {:ok, :auto}

  defp light(text) do
    case Parse.number(text, 0, 90) do
      {:ok, percent} -> {:ok, percent / 100}
      {:error, allowed} -> {:error, "auto or #{allowed}"}
    end
  end
end
