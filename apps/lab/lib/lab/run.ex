defmodule Lab.Run do
  @moduledoc """
  Plays a run: the one loop of all that play missions, judge them and watch them. What is played is a run in lockstep
  (`Lab.Trial`), or a fleet of processes in real time (`Lab.Fleet`), which goes by itself and is looked at ten times a second.

  After each step the checks of the run get its moment: `Lab.Check`, `Lab.Check.Invariants`, or any struct with a `tick/2`. A run
  in lockstep that raises does so here, too; one that is `guarded` stays as it was before that step, and has crashed.
  """
  alias Lab.{Fleet, Moment, Trial}

  @look_ms 100

  @enforce_keys [:source, :moment, :checks, :guarded?]
  defstruct @enforce_keys

  @typedoc "A `Lab.Trial` or what has its functions, or the process of a `Lab.Fleet`."
  @type source :: struct() | pid()

  @typedoc "`moment` is the one that the checks have seen last; `nil` without checks."
  @type t :: %__MODULE__{
          source: source(),
          moment: Moment.t() | nil,
          checks: [check :: struct()],
          guarded?: boolean()
        }

  @doc "A run from where it is now, with its checks."
  @spec new(source(), [check :: struct()], guarded?: boolean()) :: t()
  def new(source, checks \\ [], options \\ []) do
    moment = if checks != [], do: start(source)
    guarded? = checks != [] and Keyword.get(options, :guarded?, false)
    %__MODULE__{source: source, moment: moment, checks: checks, guarded?: guarded?}
  end

  defp start(%Trial{} = trial), do: %{Moment.start(trial) | places: [], stops: %{}}
  defp start(fleet), do: Fleet.moment(fleet)

  @doc """
  Goes on until `over?` holds, which is asked before each step. After it `each` gets the run as it was before the step, and
  after it, with what it returned last (at first `memory`).
  """
  @spec fold(t(), memory, (t() -> boolean()), each) :: {t(), memory}
        when memory: term(), each: (before :: t(), t(), memory -> {t(), memory})
  def fold(run, memory, over?, each) do
    if over?.(run) do
      {run, memory}
    else
      {run, memory} = each.(run, step(run), memory)
      fold(run, memory, over?, each)
    end
  end

  @doc """
  Goes on to the end (`done?/1`), or until `over?` holds. A source alone is played without checks.

      iex> {:ok, trial} = Lab.Trial.new(%{robots: [:mag1], blobs: :direct, duration_s: 1})
      iex> for over? <- [nil, &(&1.at_ms >= 300)], do: Lab.Run.play(trial, over?).at_ms
      [1000, 300]
  """
  @spec play(t() | source(), (t() | source() -> boolean()) | nil) :: t() | source()
  def play(run, over? \\ nil)

  def play(%__MODULE__{} = run, over?) do
    {run, nil} = fold(run, nil, over? || (&done?/1), fn _, run, nil -> {run, nil} end)
    run
  end

  def play(source, over?), do: play(new(source), over? && (&over?.(&1.source))).source

  @doc "Goes on by 100 ms."
  @spec step(t()) :: t()
  def step(%__MODULE__{guarded?: true} = run) do
    case attempt(fn -> go_on(run) end) do
      {:ok, run} -> run
      {:exit, reason} -> note(run, run.source, %{run.moment | crash: {at_ms(run), reason}})
    end
  end

  def step(run), do: go_on(run)

  defp go_on(%{source: source} = run) do
    source = advance(source)

    cond do
      run.checks == [] -> %{run | source: source}
      is_pid(source) -> note(run, source, Fleet.moment(source))
      true -> note(run, source, Moment.of(source))
    end
  end

  defp advance(fleet) when is_pid(fleet) do
    receive do
    after
      @look_ms -> fleet
    end
  end

  defp advance(%kind{} = trial), do: kind.step(trial)

  defp note(run, source, moment) do
    checks = Enum.map(run.checks, fn %kind{} = check -> kind.tick(check, moment) end)
    %{run | source: source, moment: moment, checks: checks}
  end

  @doc """
  The value of a function, or the reason with which a process would end by what it raises.

      iex> Lab.Run.attempt(fn -> 1 + 1 end)
      {:ok, 2}
      iex> Lab.Run.attempt(fn -> exit(:why) end)
      {:exit, :why}
  """
  @spec attempt((... -> value)) :: {:ok, value} | {:exit, reason :: term()} when value: term()
  def attempt(function) do
    {:ok, function.()}
  catch
    :error, reason -> {:exit, {reason, __STACKTRACE__}}
    :throw, value -> {:exit, {{:nocatch, value}, __STACKTRACE__}}
    :exit, reason -> {:exit, reason}
  end

  @doc "Whether nothing is left to do (`Lab.Trial.done?/1`, `Lab.Fleet.done?/1`), or a step has raised."
  @spec done?(t()) :: boolean()
  def done?(run), do: crashed?(run) or ask(run, :done?)

  @doc "Whether a step has raised."
  @spec crashed?(t()) :: boolean()
  def crashed?(%{moment: moment}), do: moment != nil and moment.crash != nil

  @doc "Milliseconds since the start of the run."
  @spec at_ms(t()) :: non_neg_integer()
  def at_ms(%{source: %{at_ms: at_ms}}), do: at_ms
  def at_ms(%{moment: %{at_ms: at_ms}}), do: at_ms
  def at_ms(run), do: scene(run).at_ms

  @doc "What happened so far, the newest last."
  @spec stages(t()) :: [Sim.Scene.stage()]
  def stages(%{source: fleet, moment: %{run_log: log}}) when is_pid(fleet),
    do: Trial.RunLog.stages(log)

  def stages(run), do: scene(run).stages

  @doc "The scene now, for viewers."
  @spec scene(t()) :: Sim.Scene.t()
  def scene(run), do: ask(run, :scene)

  @doc "The report so far, without its wall time."
  @spec result(t()) :: map()
  def result(run), do: ask(run, :result)

  defp ask(%{source: fleet}, what) when is_pid(fleet), do: apply(Fleet, what, [fleet])
  defp ask(%{source: %kind{} = trial}, what), do: apply(kind, what, [trial])
end
