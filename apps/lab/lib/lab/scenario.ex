defmodule Lab.Scenario do
  @moduledoc """
  Describes a scenario as data: a world and its robots, a script of events, and what is expected of the run. Pure.
  `Lab.Scenario.Runner` runs it in lockstep, `Lab.Scenario.File` reads and writes it as text.
  """
  alias Hal.Options
  alias Hal.Options.{Suggest, Type}
  alias Lab.Check.Expectation
  alias Lab.Scenario.Names
  alias Lab.Trial
  alias Lab.Trial.Event

  defstruct about: "", options: [], script: [], expect: []

  @typedoc """
  `options` are those of `Lab.Trial.Options` that were given, without `script`, in the order of that
  table; `robots` are names. `script` has events `{at_s, event}` (`Lab.Trial.Event`), `expect` has
  expectations (`Lab.Check.Expectation`); both in the order in which they were given.
  """
  @type t :: %__MODULE__{
          about: String.t(),
          options: keyword(),
          script: [Event.entry()],
          expect: [Expectation.t()]
        }

  @longest 2000
  @keys [:about, :options, :script, :expect]

  @doc """
  A scenario of `about:` (a text), `options:` (of `Lab.Trial.Options`; `robots:` may be a number),
  `script:` and `expect:`; none must be given. The error is one line.

      iex> {:ok, scenario} = Lab.Scenario.new(options: [robots: 2, seed: 3], script: [{5, {:kill, :leader}}], expect: [{:never, :collision}])
      iex> {scenario.options, scenario.script, scenario.expect}
      {[robots: [:mag1, :min1], seed: 3], [{5.0, {:kill, :leader}}], [{:never, :collision}]}
      iex> Lab.Scenario.new(options: [robots: 2], script: [{500, {:reset}}])
      {:error, "scenario option script.1: expected times within the run, got {500.0, {:reset}}: the run ends after 120 s"}
      iex> Lab.Scenario.new(expect: [{:formd, by_s: 60}])
      ...> |> elem(1) |> String.split("; ") |> List.last()
      "did you mean formed?"
  """
  @spec new(keyword()) :: {:ok, t()} | {:error, line :: String.t()}
  def new(given) do
    with :ok <- known(given),
         {options, given} = Keyword.pop(given, :options, []),
         :ok <- plain(options),
         {:ok, values} <- read(Keyword.merge(options, given)),
         [] <- problems(values) do
      {:ok, build(values)}
    else
      {:error, line} when is_binary(line) -> {:error, line}
      {:error, problems} -> {:error, Options.line(problems, "scenario")}
      problems -> {:error, Options.line(problems, "scenario")}
    end
  end

  # Options beside these four would otherwise be taken for options of the run.
  defp known(given) do
    if Keyword.keyword?(given) and Keyword.keys(given) -- @keys == [],
      do: :ok,
      else: {:error, "a scenario has about:, options:, script: and expect:"}
  end

  defp plain(options) do
    if Keyword.keyword?(options) and not Enum.any?(@keys, &Keyword.has_key?(options, &1)),
      do: :ok,
      else: {:error, "the options of a scenario are [key: value], without a script"}
  end

  defp read(values), do: Type.read({:keys, table()}, values)

  @doc "The table of a scenario's file: `about`, the options of the run, `script` and `expect`."
  @spec table() :: Options.table()
  def table do
    run = Keyword.drop(Trial.Options.table(), [:script, :robots])

    [
      about: {:check, &about?/1, "text of at most #{@longest} bytes, in quotes,"},
      robots:
        {:check, &Names.read/1,
         "a number of robots, 1 to 100, or a list of names, [:mag1, :burger1] or [\"rex\"] with bodies:,"}
    ] ++
      run ++
      [script: Event.script_type(), expect: Expectation.list_type()]
  end

  defp about?(text),
    do: is_binary(text) and byte_size(text) <= @longest and String.printable?(text)

  @doc """
  What is wrong with the values of such a table that each key by itself does not show: robots that
  the run does not have, and times after its end.
  """
  @spec problems(keyword()) :: [Type.problem()]
  def problems(values) do
    %{robots: robots, duration_s: duration_s} = given = Map.merge(defaults(), Map.new(values))
    expect = Keyword.get(values, :expect, [])
    timed = "no run in lockstep has hardware: serial lines have a time of their own"

    Trial.Options.problems(given) ++
      for(_id <- Enum.take(given.hardware, 1), do: {["hardware"], timed}) ++
      late(given.script, duration_s) ++ expected(expect, robots, duration_s)
  end

  defp defaults, do: Map.new(Options.defaults(Trial.Options.table()))

  defp late(script, duration_s) do
    for {{at_s, _event} = entry, n} <- Enum.with_index(script, 1),
        at_s > duration_s,
        do:
          {["script", "#{n}"],
           "expected times within the run, got #{inspect(entry)}: #{ends(duration_s)}"}
  end

  defp expected(expectations, robots, duration_s) do
    for {expectation, n} <- Enum.with_index(expectations, 1),
        words <- strange(expectation, robots) ++ never(expectation, duration_s),
        do: {["expect", "#{n}"], "expected what can hold, got #{inspect(expectation)}: #{words}"}
  end

  defp strange(expectation, robots) do
    known = [:all | robots]

    for who <- Expectation.robots(expectation), who not in known do
      "#{inspect(who)} is no robot of this run#{Suggest.hint(inspect(who), known)}"
    end
  end

  defp never(expectation, duration_s),
    do: if(Expectation.until_s(expectation) > duration_s, do: [ends(duration_s)], else: [])

  defp ends(duration_s), do: "the run ends after #{duration_s} s"

  @doc "The scenario of values of such a table without problems."
  @spec build(keyword()) :: t()
  def build(values) do
    {own, options} = Keyword.split(values, [:about, :script, :expect])
    struct!(__MODULE__, [{:options, options} | own])
  end

  @doc "The options for `Lab.Trial.new/1`."
  @spec trial(t()) :: map()
  def trial(%__MODULE__{options: options, script: script}) do
    plan = Trial.Options.plan(options[:mission])
    options |> Map.new() |> Map.put(:script, script) |> Map.put_new(:plan, plan)
  end

  @doc "How long the run may take, in simulated seconds."
  @spec duration_s(t()) :: number()
  def duration_s(%__MODULE__{options: options}),
    do: Keyword.get(options, :duration_s, defaults().duration_s)
end
