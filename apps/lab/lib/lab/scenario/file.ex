defmodule Lab.Scenario.File do
  @moduledoc """
  Reads and writes scenarios as files: one list of keys in Elixir's notation, which is parsed and
  never executed (`Robot.File.Reader`), and makes no atoms.

      [
        about: "The leader dies; the others elect another one and form again.",
        robots: 6,
        seed: 1,
        script: [{40, {:kill, :leader}}],
        expect: [{:formed, by_s: 40}, {:formed_again, after_s: 40, within_s: 40}]
      ]

  A file that does not parse gives its first problem; otherwise each problem is a line with the
  file, the line and the key. Wrong names of robots, and times after the end of the run, are found
  once each key by itself is right.
  """
  alias Robot.File.{Reader, Terms}
  alias Lab.Check.{Expectation, Invariants}
  alias Lab.Scenario
  alias Lab.Scenario.{Names, Text}

  @doc """
  The scenario of the file at `path`, or the problems with it, those that its map shows among them.

      iex> Lab.Scenario.File.load("no/such.exs")
      {:error, ["no/such.exs: no such file or directory"]}
  """
  @spec load(Path.t()) :: {:ok, Scenario.t()} | {:error, [String.t(), ...]}
  def load(path),
    do: with({:ok, text} <- Reader.text(path, "scenario"), do: read(text, path, &set_up/1))

  defp set_up(scenario), do: Lab.Trial.Setup.problems(Scenario.trial(scenario))

  @doc """
  The scenario of a text; `name` is the file's in messages.

      iex> {:ok, scenario} = Lab.Scenario.File.parse("[robots: 1, expect: [{:formed, by_s: 60}]]")
      iex> scenario.expect
      [{:formed, [by_s: 60.0]}]
      iex> Lab.Scenario.File.parse("[robots: 1,\\n script: [{5, {:kil, :mag1}}]]", "a.exs")
      {:error, ["a.exs:2: script.1: expected an event, one of kill, move, remove_landmark, tell, " <>
        "estop, reset, cut, join, loss, freeze, crash, hang, displace, place, blind, deaf, got {:kil, :mag1}; did you mean kill?"]}
  """
  @spec parse(String.t(), name :: String.t()) :: {:ok, Scenario.t()} | {:error, [String.t(), ...]}
  def parse(text, name \\ "scenario"), do: read(text, name, fn _scenario -> [] end)

  defp read(text, name, more) do
    # Loads the modules whose names a file may use, which are found among existing atoms only.
    table = Scenario.table()
    _names = {Names.all(), Expectation.phases(), Invariants.names(), Swarm.Formation.kinds()}

    with {:ok, {_line, value} = tree} <- Reader.read(text, "scenario"),
         :ok <- keys(value),
         :ok <- Names.know(tree),
         {:ok, values} <- Terms.check(tree, {:keys, table}),
         [] <- Terms.at(Scenario.problems(values), tree),
         scenario = Scenario.build(values),
         [] <- Terms.at(more.(scenario), tree) do
      {:ok, scenario}
    else
      {:error, {line, words}} -> {:error, ["#{name}:#{line}: #{words}"]}
      {:error, problems} -> {:error, Reader.lines(problems, name)}
      problems -> {:error, Reader.lines(problems, name)}
    end
  end

  defp keys({:keys, _keys}), do: :ok
  defp keys({:list, []}), do: :ok
  defp keys(_other), do: {:error, {1, "a scenario is one list, [key: value, …]"}}

  @doc """
  Writes a scenario into a file.

  The reason of an error is one of `t:File.posix/0`.
  """
  @spec write(Path.t(), Scenario.t()) :: :ok | {:error, File.posix()}
  def write(path, scenario), do: File.write(path, text(scenario))

  @doc """
  The text of a scenario, formatted; `parse/2` gives the same scenario.

      iex> {:ok, scenario} = Lab.Scenario.new(about: "Two robots.", options: [robots: 2, loss: 0.1], script: [{5, {:kill, :mag1}}])
      iex> text = Lab.Scenario.File.text(scenario)
      iex> text
      ~s([\\n  about: "Two robots.",\\n  robots: 2,\\n  loss: 0.1,\\n  script: [\\n    {5, {:kill, :mag1}}\\n  ]\\n]\\n)
      iex> Lab.Scenario.File.parse(text) == {:ok, scenario}
      true
  """
  @spec text(Scenario.t()) :: String.t()
  def text(%Scenario{} = scenario) do
    about = if scenario.about != "", do: ["about: " <> Text.option(scenario.about)], else: []
    options = for {key, value} <- scenario.options, do: "#{key}: #{option(key, value)}"
    script = list("script", scenario.script)
    keys = Enum.join(about ++ options ++ script ++ list("expect", scenario.expect), ",\n")
    IO.iodata_to_binary([Code.format_string!("[\n#{keys}\n]", line_length: 98), "\n"])
  end

  defp option(:robots, robots) do
    count = length(robots)

    cond do
      count <= 100 and robots == Names.fleet(count) -> "#{count}"
      robots -- Names.all() == [] -> Text.option(robots)
      true -> Text.option(Enum.map(robots, &Atom.to_string/1))
    end
  end

  defp option(_key, value), do: Text.option(value)

  defp list(_key, []), do: []
  defp list(key, values), do: ["#{key}: [\n#{Enum.map_join(values, ",\n", &Text.form/1)}\n]"]
end
