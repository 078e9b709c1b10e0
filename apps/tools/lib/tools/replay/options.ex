defmodule Tools.Replay.Options do
  @moduledoc "Reads the options of `mix replay`, checked once when it starts. Pure."
  alias Hal.Cli.{Arguments, Parse}

  defstruct file: nil,
            at_s: nil,
            until_s: nil,
            robot: nil,
            why: nil,
            against: nil,
            csv: nil,
            step: false,
            page: false,
            film: nil,
            help: false

  @type t :: %__MODULE__{
          file: Path.t() | nil,
          at_s: float() | nil,
          until_s: float() | nil,
          robot: String.t() | nil,
          why: String.t() | nil,
          against: Path.t() | nil,
          csv: Path.t() | nil,
          step: boolean(),
          page: boolean(),
          film: Path.t() | nil,
          help: boolean()
        }

  @doc """
  Options from a command's arguments, or one line for each error in them. Names of files are
  relative to `folder`.

      iex> {:ok, options} = Tools.Replay.Options.parse(~w(run.mcap --at 42.3 --why leader))
      iex> {options.file, options.at_s, options.why}
      {"run.mcap", 42.3, "leader"}
      iex> Tools.Replay.Options.parse(~w(--at 3))
      {:error, ["a recording is missing: mix replay FILE.mcap"]}
  """
  @spec parse([String.t()], Path.t()) :: {:ok, t()} | {:error, [String.t()]}
  def parse(arguments, folder \\ ".") do
    {files, rest} =
      case arguments do
        ["-" <> _ | _] -> {[], arguments}
        [file | rest] -> {[file], rest}
        [] -> {[], []}
      end

    with {:ok, pairs} <- Arguments.parse(rest, table(folder)) do
      options = Enum.reduce(pairs, %__MODULE__{file: from(List.first(files), folder)}, &put/2)

      if options.file || options.help,
        do: alone(options),
        else: {:error, ["a recording is missing: mix replay FILE.mcap"]}
    end
  end

  # A prompt and a page go by themselves; the others go through all of a run.
  defp alone(options) do
    through = [until: options.until_s, csv: options.csv, film: options.film]

    step =
      if options.step, do: [page: options.page, against: options.against] ++ through, else: []

    page = if options.page, do: [why: options.why, robot: options.robot] ++ through, else: []

    lines =
      for {option, others} <- [step: step, page: page],
          {name, value} <- others,
          value not in [nil, false],
          do: "--#{option} cannot be used with --#{name}"

    if lines == [], do: {:ok, options}, else: {:error, lines}
  end

  @doc "The help text of `mix replay`."
  @spec help() :: String.t()
  def help do
    """
    Replays a recording of a run or of robots from its inputs, and says whether every decision is the same.

      mix replay FILE.mcap [options]

    #{Arguments.help(table("."))}

    Examples
      mix demo --headless --kill leader@40 --record run.mcap   records a run
      mix replay run.mcap                                      every decision again, compared
      mix replay run.mcap --at 42.3                            how the fleet stood then
      mix replay run.mcap --at 42.3 --why leader               why its leader did what it did
      mix replay run.mcap --step --at 42                       forwards and backwards from there
      mix replay run.mcap --page                               in the browser: play, pause, choose a robot, read why
      mix replay run.mcap --against other.mcap                 where two runs part
      mix replay run.mcap --against other.mcap --page          both side by side
      mix replay run.mcap --film run.svg                       an animation that any browser shows
      mix replay run.mcap --csv tables                         for a spreadsheet, or pandas

    Exit status: 0 all is the same; 2 something differs, or could not be compared because it was
    not recorded; 1 something was wrong with the input.
    """
  end

  defp table(folder) do
    [
      {"at", "T", &Parse.number(&1, 0, 1_000_000), "show the fleet at second T"},
      {"until", "T", &Parse.number(&1, 0, 1_000_000), "replay to second T only"},
      {"robot", "NAME", &name/1, "show this robot only"},
      {"why", "leader|NAME", &name/1,
       "what this robot perceived, wished and decided at --at (at the end)"},
      {"against", "FILE.mcap", &file(&1, folder),
       "compare with another recording: the first tick that differs, and in what"},
      {"step", nil, nil, "go forwards and backwards tick by tick, and ask: a prompt"},
      {"page", nil, nil, "show it in the browser, with a strip of time"},
      {"film", "FILE.svg", &file(&1, folder),
       "draw the run as an animation, for a README or a talk"},
      {"csv", "DIR", &Parse.folder(&1, folder),
       "write poses, errors, messages, ticks and events as tables"}
    ]
  end

  defp put({"at", at_s}, options), do: %{options | at_s: at_s}
  defp put({"until", until_s}, options), do: %{options | until_s: until_s}

  defp put({name, value}, options),
    do: Map.replace!(options, String.to_existing_atom(name), value)

  defp name(""), do: {:error, "a name"}
  defp name(text), do: {:ok, text}

  defp file("", _folder), do: {:error, "the name of a file"}
  defp file(text, folder), do: {:ok, from(text, folder)}

  defp from(nil, _folder), do: nil
  defp from(path, "."), do: path
  defp from(path, folder), do: Path.expand(path, folder)
end
