defmodule Console.Chaos.Options do
  @moduledoc "Reads the options of `mix chaos`. Pure. One table describes them and makes the help text."
  alias Hal.Cli.{Arguments, Parse}
  alias Swarm.MissionRegistry

  @most_runs 1_000_000

  defstruct runs: 100,
            seed: 1,
            run: nil,
            attempts: 40,
            jobs: nil,
            json: nil,
            keep: nil,
            mission: nil,
            help: false

  @type t :: %__MODULE__{}

  @doc """
  Options from a command's arguments, or one line for each error in them.

      iex> {:ok, options} = Console.Chaos.Options.parse(~w(--runs 20 --seed 7))
      iex> {options.runs, options.seed, Console.Chaos.Options.numbers(options)}
      {20, 7, 1..20}
      iex> Console.Chaos.Options.parse(~w(--runs 0))
      {:error, [~s(--runs: expected a whole number from 1 to 1000000, got "0")]}
      iex> Console.Chaos.Options.parse(~w(--run 3 --runs 20))
      {:error, ["--run and --runs exclude each other; give one of them"]}
  """
  @spec parse([String.t()]) :: {:ok, t()} | {:error, [String.t()]}
  def parse(arguments) do
    with {:ok, pairs} <- Arguments.parse(arguments, table()),
         :ok <- one_of(pairs),
         do: mission(Enum.reduce(pairs, %__MODULE__{}, &put/2))
  end

  @doc "The numbers of the runs to play."
  @spec numbers(t()) :: Range.t()
  def numbers(%__MODULE__{run: nil, runs: runs}), do: 1..runs
  def numbers(%__MODULE__{run: run}), do: run..run

  @doc """
  The options of the command that draws the same.

      iex> {:ok, options} = Console.Chaos.Options.parse(~w(--seed 7 --mission patrol:period=90))
      iex> Console.Chaos.Options.words(options)
      "--seed 7 --mission 'patrol:period=90'"
  """
  @spec words(t()) :: String.t()
  def words(%__MODULE__{seed: seed, mission: nil}), do: "--seed #{seed}"
  def words(%__MODULE__{seed: seed, mission: {text, _}}), do: "--seed #{seed} --mission '#{text}'"

  @doc "The help text."
  @spec help() :: String.t()
  def help do
    """
    Plays missions that are drawn at random (fleets, maps, lost messages, kills, cuts, freezes, stops), judges
    each at every tick, and shrinks what is wrong to the smallest run in which it still is (docs/chaos.md).

      mix chaos [options]

    #{Arguments.help(table())}

    Examples
      mix chaos                               a hundred runs
      mix chaos --runs 1000 --keep failures   a thousand; each failure becomes a scenario in that folder
      mix chaos --seed 1 --run 17             run 17 of seed 1 again, alone
      mix chaos --mission patrol:period=90    the same with another mission
      mix chaos --runs 200 --json -           a report for another program

    Exit status: 0 nothing was wrong; 2 an invariant was violated; 1 the input was wrong.
    """
  end

  defp table do
    [
      {"runs", "N", &Parse.whole(&1, 1..@most_runs),
       "how many runs, from the first of the seed (100)"},
      {"seed", "S", &Parse.whole(&1, 0..4_294_967_295), "of all that is drawn (1)"},
      {"mission", "NAME[:KEY=VALUE,…]", &{:ok, &1},
       "#{Parse.either(MissionRegistry.names())}, with options of it; all else is drawn as without\n(#{hd(MissionRegistry.names() ++ ["none"])})"},
      {"run", "N", &Parse.whole(&1, 1..@most_runs), "only this run of the seed"},
      {"attempts", "N", &Parse.whole(&1, 0..10_000),
       "to shrink each violation; 0 leaves the run as it is (40)"},
      {"jobs", "N", &Parse.whole(&1, 1..1024), "how many runs at once (one a processor)"},
      {"json", "FILE|-", &file/1, "write the report (- is standard output)"},
      {"keep", "DIR", &folder/1, "write each shrunk failure as a scenario into this folder"}
    ]
  end

  defp one_of(pairs) do
    if List.keymember?(pairs, "run", 0) and List.keymember?(pairs, "runs", 0),
      do: {:error, ["--run and --runs exclude each other; give one of them"]},
      else: :ok
  end

  defp mission(%{mission: nil} = options), do: {:ok, options}

  # How many robots a run has is drawn.
  defp mission(%{mission: text} = options) do
    case MissionRegistry.Text.read(text, nil) do
      {:ok, mission} -> {:ok, %{options | mission: {text, mission}}}
      {:error, line} -> {:error, ["--mission: #{line}"]}
    end
  end

  # The keys of the table are those of the struct.
  defp put({name, value}, options),
    do: Map.replace!(options, String.to_existing_atom(name), value)

  defp file("-"), do: {:ok, "-"}

  defp file(path) do
    if path != "" and not File.dir?(path) and File.dir?(Path.dirname(path)),
      do: {:ok, path},
      else: {:error, "a file in a folder that exists"}
  end

  defp folder(path) do
    if path != "" and (File.dir?(path) or not File.exists?(path)),
      do: {:ok, path},
      else: {:error, "a folder"}
  end
end
