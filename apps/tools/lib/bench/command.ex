defmodule Bench.Command do
  @moduledoc "Runs a command `mix bench NAME`: reads its options by its table, or prints its help."
  alias Bench.Load
  alias Console.Cli.{MapName, Output, Progress}
  alias Hal.Cli.Arguments

  @doc "Measures with the options given, by their names; each error is one line. `more` ends the help."
  @spec run([String.t()], String.t(), [Arguments.option()], (map() -> result), more :: String.t()) ::
          result | :ok | {:error, [String.t()]}
        when result: term()
  def run(arguments, name, table, measure, more \\ "") do
    with {:ok, pairs} <- Arguments.parse(arguments, table) do
      given = Map.new(pairs)

      if given["help"],
        do: IO.puts("  mix bench #{name} [options]\n\n#{Arguments.help(table)}#{more}"),
        else: measure.(given)
    end
  end

  @doc """
  Measures jobs, two at a time, and shows how far it is; `named` is a job in words. The results stand beside their jobs, in
  their order.
  """
  @spec each([job], (job -> result), (job -> String.t())) :: [{job, result}]
        when job: term(), result: term()
  def each(jobs, measure, named) do
    output = Output.to(:stderr)

    results =
      jobs
      |> Task.async_stream(&alone(&1, measure), max_concurrency: 2, timeout: :infinity)
      |> Enum.with_index(1)
      |> Enum.map(fn {{:ok, {job, _} = result}, done} ->
        progress(output, done, length(jobs), named.(job))
        result
      end)

    Output.finish(output)
    results
  end

  defp alone(job, measure) do
    Lab.Trial.Memory.prepare()
    {job, measure.(job)}
  end

  @doc "What was measured with a progress line, and the load of the machine before and after it."
  @spec loaded((Output.t() -> result)) :: {result, %{atom() => term()}} when result: term()
  def loaded(measure) do
    output = Output.to(:stderr)
    before = Load.now()
    result = measure.(output)
    Output.finish(output)

    {result,
     %{load_before: before, load_after: Load.now(), schedulers: System.schedulers_online()}}
  end

  @doc "Shows what a bench does now."
  @spec note(Output.t()) :: (String.t() -> :ok)
  def note(output), do: &Output.progress(output, "bench: " <> &1)

  @doc "Shows how far a bench is."
  @spec progress(Output.t(), number(), number(), String.t()) :: :ok
  def progress(output, done, all, note),
    do: Output.progress(output, Progress.line(done, all, note, (output.columns || 80) - 1))

  @doc "What the command answers when jobs have failed with these lines, or none has."
  @spec failed([String.t()]) :: :ok | {:error, [String.t()]}
  def failed([]), do: :ok
  def failed(lines), do: {:error, lines}

  @doc "Measures in a folder that is removed afterwards."
  @spec in_folder(name :: String.t(), (Path.t() -> result)) :: result when result: term()
  def in_folder(name, measure) do
    folder = Path.join(System.tmp_dir!(), "convoy-#{name}-#{System.unique_integer([:positive])}")
    File.mkdir_p!(folder)

    try do
      measure.(folder)
    after
      File.rm_rf!(folder)
    end
  end

  @doc "The option `maps`: which maps, if not these."
  @spec maps([String.t(), ...]) :: Arguments.option()
  def maps(usual) do
    says = "which maps: names, FILE.yaml, FILE.png:WIDTHxHEIGHT or FILE.pgm:…"
    {"maps", "NAME,NAME", &MapName.list/1, "#{says}\n(#{Enum.join(usual, ",")})"}
  end

  @doc "The cases of a bench, for its help."
  @spec cases([%{:name => atom(), :says => String.t(), optional(atom()) => term()}]) :: String.t()
  def cases(cases),
    do:
      "\n\nCases\n" <>
        Enum.map_join(cases, "\n", &"  #{String.pad_trailing("#{&1.name}", 10)}#{&1.says}")
end
