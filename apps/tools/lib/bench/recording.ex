defmodule Bench.Recording do
  @moduledoc """
  Measures what a recording costs a run in lockstep: the same run by turns without and with one, in
  processor time of the whole VM and in wall time. Both look at the scene of each tick, as the demo does.
  """
  alias Bench.Table
  alias Lab.{Recorder, Run, Trial}

  @typedoc "A run: processor time and wall time in ms, ticks, and the recording's bytes."
  @type run :: %{
          cpu_ms: non_neg_integer(),
          wall_ms: number(),
          ticks: pos_integer(),
          bytes: non_neg_integer()
        }

  @typedoc "All rounds of the runs of one number of robots, without (`plain`) and with recording."
  @type measured :: %{
          robots: pos_integer(),
          seed: non_neg_integer(),
          plain: [run()],
          recorded: [run()]
        }

  @doc "Measures one seed for so many rounds, after one that does not count; the file is in `folder`."
  @spec measure(pos_integer(), non_neg_integer(), pos_integer(), Path.t()) ::
          {:ok, measured()} | {:error, line :: String.t()}
  def measure(robots, seed, rounds, folder) do
    with {:ok, setup} <- Trial.setup(%{robots: Console.Fleet.of(robots), seed: seed}) do
      path = Path.join(folder, "run.mcap")
      _first = {run(setup, nil), run(setup, path)}
      pairs = for _round <- 1..rounds, do: {run(setup, nil), run(setup, path)}
      {plain, recorded} = Enum.unzip(pairs)
      {:ok, %{robots: robots, seed: seed, plain: plain, recorded: recorded}}
    end
  end

  # In a process of its own, so that no run has to collect what the one before has left; with the heap
  # that a demo's has.
  defp run(setup, path) do
    played =
      Task.async(fn ->
        Trial.Memory.prepare()
        timed(fn -> play(setup, path) end, path)
      end)

    Task.await(played, :infinity)
  end

  defp timed(play, path) do
    {cpu_ms, _since} = :erlang.statistics(:runtime)
    started = System.monotonic_time(:microsecond)
    ticks = play.()
    wall_ms = (System.monotonic_time(:microsecond) - started) / 1_000
    {then_ms, _since} = :erlang.statistics(:runtime)
    bytes = if path, do: File.stat!(path).size, else: 0
    %{cpu_ms: then_ms - cpu_ms, wall_ms: wall_ms, ticks: ticks, bytes: bytes}
  end

  defp play(setup, nil), do: steps(Trial.begin(setup), &looked/2)

  # A new file each time: to write over one costs more.
  defp play(setup, path) do
    _none_at_first = File.rm(path)
    {:ok, recorder} = Recorder.start_link(path, setup)
    ticks = steps(Trial.begin(setup, record: true), &Recorder.step(recorder, &1, &2))
    :ok = Recorder.close(recorder)
    ticks
  end

  defp looked(_before, trial) do
    _scene = Trial.scene(trial)
    trial
  end

  defp steps(trial, record) do
    each = fn before, run, ticks ->
      {%{run | source: record.(before.source, run.source)}, ticks + 1}
    end

    {_run, ticks} = trial |> Run.new() |> Run.fold(0, &Run.done?/1, each)
    ticks
  end

  @doc """
  The figures of some seeds: the median times of a run without recording, and what recording adds to
  them in per cent, the quartiles and the median of all pairs of runs; MB a robot and minute. A run and
  the next one share what else the machine does, so that pairs tell more than sums.

      iex> run = fn cpu_ms, bytes -> %{cpu_ms: cpu_ms, wall_ms: 2 * cpu_ms, ticks: 600, bytes: bytes} end
      iex> one = %{robots: 2, seed: 1, plain: [run.(100, 0)], recorded: [run.(104, 3_000_000)]}
      iex> Bench.Recording.figures([one])
      %{cpu_s: 0.1, cpu_percent: {4.0, 4.0, 4.0}, wall_s: 0.2, wall_percent: {4.0, 4.0, 4.0}, mb: 1.5, most_mb: 1.5}
  """
  @spec figures([measured()]) :: %{atom() => float() | {float(), float(), float()}}
  def figures(measured) do
    sizes = Enum.map(measured, &megabytes/1)

    %{
      cpu_s: seconds(measured, :cpu_ms),
      cpu_percent: percent(measured, :cpu_ms),
      wall_s: seconds(measured, :wall_ms),
      wall_percent: percent(measured, :wall_ms),
      mb: Float.round(Enum.sum(sizes) / length(sizes), 2),
      most_mb: Float.round(Enum.max(sizes), 2)
    }
  end

  defp seconds(measured, what) do
    times = for one <- measured, run <- one.plain, do: Map.fetch!(run, what)
    Float.round(Table.quantile(times, 0.5) / 1_000, 2)
  end

  defp percent(measured, what) do
    added =
      for one <- measured, {plain, recorded} <- Enum.zip(one.plain, one.recorded) do
        100 * (Map.fetch!(recorded, what) / Map.fetch!(plain, what) - 1)
      end

    [low, middle, high] = for share <- [0.25, 0.5, 0.75], do: Table.quantile(added, share)
    {Float.round(low, 1), Float.round(middle, 1), Float.round(high, 1)}
  end

  defp megabytes(%{robots: robots, recorded: [%{ticks: ticks, bytes: bytes} | _]}),
    do: bytes / 1.0e6 / robots / (ticks / 600)
end
