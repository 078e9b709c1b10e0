defmodule Tools.Calibrate.Options do
  @moduledoc false
  # Reads the command line of `mix calibrate odometry`: turns its arguments into a checked map or error
  # lines. Pure.
  alias Hal.Cli.Parse
  alias Robot.File.Bodies

  @type t :: %{
          file: Path.t() | nil,
          mode: :drive | :dry_run | :simulate | :typed,
          distance: float(),
          angle: float(),
          squares: non_neg_integer(),
          side: float(),
          speed: float(),
          write: boolean(),
          measured: [float()],
          turned: [float()],
          cw: [{float(), float()}],
          ccw: [{float(), float()}],
          seed: integer(),
          seeds: pos_integer(),
          profile: Hal.Profile.t(),
          noise: :off | :default | :slip,
          wheels: keyword(float())
        }

  @doc "The table of the options, as `Hal.Cli.Arguments` takes it."
  @spec table() :: [Hal.Cli.Arguments.option()]
  def table do
    [
      {"distance", "METRES", &zero_or(&1, 0.5, 50),
       "straight ahead, by odometry (3); 0: not at all"},
      {"angle", "DEGREES", &zero_or(&1, 90, 3600),
       "to the left, and the same to the right (720); 0: not at all"},
      {"squares", "N", &Parse.whole(&1, 0..50), "squares in each direction (5); 0: none"},
      {"side", "METRES", &Parse.number(&1, 1, 20), "of the squares (4)"},
      {"speed", "M/S", &Parse.number(&1, 0.05, 0.5), "at most (0.2)"},
      {"measured", "METRES", &Parse.number(&1, 0.1, 100),
       "typed in, drives nothing: how far it truly went in a straight line\ninstead of --distance; may be repeated"},
      {"turned", "DEGREES", &Parse.number(&1, -4000, 4000),
       "typed in: how far it truly turned instead of --angle (negative: to the\nright); may be repeated"},
      {"cw", "X,Y", &Parse.point/1,
       "typed in: how far the true end of a clockwise square was from the end\nby odometry, in metres ahead and to the left; once for each"},
      {"ccw", "X,Y", &Parse.point/1, "the same for a counter-clockwise one"},
      {"write", nil, nil, "writes the robot file without asking; prints the changes"},
      {"dry-run", nil, nil, "prints what would be driven, and drives nothing"},
      {"simulate", nil, nil, "a simulated robot, measured by its true pose"},
      {"seed", "N", &Parse.whole(&1, 0..1_000_000), "of its noise (1)"},
      {"seeds", "N", &Parse.whole(&1, 1..1000),
       "this many robots, one after the other, and how exact the results are (1)"},
      {"profile", "BODY", &body/1,
       "which body it has, such as magellan, atrv_mini, kobuki (magellan)"},
      {"noise", "KIND", &Parse.choice(&1, off: :off, default: :default, slip: :slip),
       "off, default or slip (default)"},
      {"true-distance", "FACTOR", &Parse.number(&1, 0.8, 1.25),
       "its error: true metres per metre of odometry (1)"},
      {"true-base", "FACTOR", &Parse.number(&1, 0.8, 1.25),
       "its wheel base, relative to the known one (1.02)"},
      {"true-ratio", "FACTOR", &Parse.number(&1, 0.9, 1.1),
       "its right wheel's distance, relative to its left one's (1.01)"}
    ]
  end

  @doc """
  Reads the arguments after `odometry`.

      iex> {:ok, options} = Tools.Calibrate.Options.parse(~w(config/robots/mag1.exs --squares 3))
      iex> {options.file, options.mode, options.squares, options.side}
      {"config/robots/mag1.exs", :drive, 3, 4.0}
      iex> Tools.Calibrate.Options.parse(~w(mag1.exs --sqares 3))
      {:error, ["unknown option --sqares; did you mean --squares?"]}
      iex> Tools.Calibrate.Options.parse(~w(--squares 3))
      {:error, ["the robot file is missing: mix calibrate odometry config/robots/NAME.exs, or --simulate"]}
  """
  @spec parse([String.t()]) :: {:ok, t()} | :help | {:error, [String.t()]}
  def parse(words) do
    {files, words} = files(words)

    with {:ok, given} <- Hal.Cli.Arguments.parse(words, table()) do
      map = Map.new(given)

      if map["help"],
        do: :help,
        else: map |> options(given, List.first(files)) |> check(files, given)
    end
  end

  # The robot file comes first.
  defp files(["--" <> _ | _] = words), do: {[], words}

  defp files([file | words]),
    do: with({files, words} <- files(words), do: {[file | files], words})

  defp files([]), do: {[], []}

  defp options(map, given, file) do
    all = fn name -> for {^name, value} <- given, do: value end

    %{
      file: file,
      mode: mode(map),
      distance: map["distance"] || 3.0,
      angle: map["angle"] || 720.0,
      squares: Map.get(map, "squares", 5),
      side: map["side"] || 4.0,
      speed: map["speed"] || 0.2,
      write: map["write"] || false,
      measured: all.("measured"),
      turned: all.("turned"),
      cw: all.("cw"),
      ccw: all.("ccw"),
      seed: map["seed"] || 1,
      seeds: map["seeds"] || 1,
      profile: map["profile"] || Hal.Profile.magellan(),
      noise: map["noise"] || :default,
      wheels: [
        distance: map["true-distance"] || 1.0,
        base: map["true-base"] || 1.02,
        ratio: map["true-ratio"] || 1.01
      ]
    }
  end

  defp body(name) do
    with {:error, _lines} <- Bodies.fetch(name) do
      known = Bodies.names()
      {:error, {Parse.either(known), Hal.Options.Suggest.hint(name, known)}}
    end
  end

  defp mode(map) do
    cond do
      map["simulate"] -> :simulate
      Enum.any?(~w(measured turned cw ccw), &is_map_key(map, &1)) -> :typed
      map["dry-run"] -> :dry_run
      true -> :drive
    end
  end

  @simulated ~w(seed seeds profile noise true-distance true-base true-ratio)

  defp check(options, files, given) do
    strange = for {name, _value} <- given, name in @simulated, do: name

    problems =
      [
        length(files) > 1 &&
          "one robot file at a time, not #{length(files)}: #{Enum.join(files, ", ")}",
        options.mode in [:drive, :dry_run] && files == [] &&
          "the robot file is missing: mix calibrate odometry config/robots/NAME.exs, or --simulate",
        options.mode != :simulate && strange != [] &&
          "--#{hd(strange)} is for a simulated robot: add --simulate",
        options.mode == :simulate && files != [] &&
          "a simulated robot has no file: #{hd(files)} or --simulate",
        options.distance == 0 && options.measured != [] && "--measured needs a --distance",
        options.angle == 0 && options.turned != [] && "--turned needs an --angle",
        nothing?(options) && "nothing to drive: --distance, --angle and --squares are 0"
      ]
      |> Enum.filter(& &1)

    if problems == [], do: {:ok, options}, else: {:error, problems}
  end

  defp nothing?(%{mode: :typed}), do: false

  defp nothing?(options),
    do: options.distance == 0 and options.angle == 0 and options.squares == 0

  defp zero_or(text, least, most) do
    with {:error, _allowed} <- Parse.number(text, 0, 0),
         {:error, allowed} <- Parse.number(text, least, most),
         do: {:error, "0 or #{allowed}"}
  end
end
