defmodule Soak.State do
  @moduledoc "Holds the state of a run of `bin/soak`, and what is noted in it."
  alias Lab.Node.Log
  alias Soak.{Journal, Judge}

  @enforce_keys [:fleet, :journal, :journal_path, :judge, :plan, :duration_ms, :mark, :progress]
  defstruct @enforce_keys ++
              [
                begun_us: nil,
                offsets: %{},
                vms: %{},
                frozen: MapSet.new(),
                ended: %{},
                processes: %{},
                stranger: nil,
                recorded: [],
                counts: %{},
                violations: [],
                recent: [],
                formation: :line,
                start_until_us: 0,
                start_next_us: 0,
                reset?: false,
                gave_up: 0,
                restarts: 0,
                cpu: %{},
                signal: nil,
                kept: nil,
                ticks: 0
              ]

  @typedoc """
  `vms` are the nodes that are up, `ended` those that were killed by us and have not been seen to end,
  `processes` when a process of a node was killed last, `recent` the last lines of the journal, `kept` where
  the logs of the nodes are after a violation.
  """
  @type t :: %__MODULE__{}

  @doc "How long it has run, in milliseconds."
  @spec elapsed_ms(t()) :: non_neg_integer()
  def elapsed_ms(%{begun_us: nil}), do: 0
  def elapsed_ms(s), do: div(Log.now() - s.begun_us, 1000)

  @doc "Takes an event of the run itself, or of a robot."
  @spec note(t(), Judge.event()) :: t()
  def note(s, event) do
    {lines, judge} = Judge.note(s.judge, event)
    Enum.reduce(lines, %{s | judge: judge}, &violation(&2, &1))
  end

  @doc "Lets the judge look at how things stand."
  @spec judge(t()) :: t()
  def judge(s) do
    {lines, judge} = Judge.judge(s.judge, Log.now())
    Enum.reduce(lines, %{s | judge: judge}, &violation(&2, &1))
  end

  @doc "Writes a line into the journal."
  @spec write(t(), String.t()) :: t()
  def write(s, words) do
    :ok = Journal.write(s.journal, elapsed_ms(s), words)
    %{s | recent: Enum.take([{elapsed_ms(s), words} | s.recent], 12)}
  end

  @doc "Tells a violation, with what was done before it."
  @spec violation(t(), String.t()) :: t()
  def violation(s, line) do
    s = %{s | violations: s.violations ++ [{elapsed_ms(s), line, s.recent}]}
    write(s, "VIOLATION: " <> line)
  end

  @doc "Whether a node is up and not frozen."
  @spec here?(t(), atom()) :: boolean()
  def here?(s, name), do: is_map_key(s.vms, name) and name not in s.frozen

  @doc "Counts a disturbance."
  @spec count(t(), atom()) :: t()
  def count(s, kind), do: %{s | counts: Map.update(s.counts, kind, 1, &(&1 + 1))}
end
