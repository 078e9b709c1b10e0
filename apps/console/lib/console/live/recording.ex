defmodule Console.Live.Recording do
  @moduledoc false
  # Records a live demo into one file: robots that are processes (`Record.Recorder`), or a run in
  # lockstep that is watched (`Lab.Recorder`).
  alias Console.Cli.Output
  alias Console.Options
  alias Lab.Trial.Setup

  @trace {Record.Recorder, :trace, []}
  @incidents_mb 100

  @doc "Says that so many robots are no processes, and keep nothing; the exit status."
  @spec refused_incidents(Options.t()) :: 1
  def refused_incidents(options),
    do:
      say(
        "--incidents: #{length(options.robots)} robots run in lockstep on this machine, where --record records all"
      )

  @doc """
  Runs `play` with the options, whose robots hand on what they are told and do if it is to be
  recorded; returns its exit status, or 1 with a line if the file is not whole.
  """
  @spec run(Options.t(), (Options.t() -> 0 | 1 | 2)) :: 0 | 1 | 2
  def run(%Options{incidents: folder} = options, play) when folder != nil do
    {:ok, _apps} = Application.ensure_all_started(:swarm)
    kept = [robots: options.robots, folder: folder, limit_mb: @incidents_mb]
    {:ok, incidents} = Record.Incidents.start_link(kept)
    # What becomes of it does not concern the demo.
    Process.unlink(incidents)

    try do
      run(%{options | incidents: nil, trace: @trace}, play)
    after
      Process.exit(incidents, :shutdown)
    end
  end

  def run(%Options{record: nil} = options, play), do: play.(options)

  def run(%Options{record: path} = options, play) do
    {:ok, _apps} = Application.ensure_all_started(:swarm)

    with :ok <- fresh(path),
         {:ok, recorder} <- recorder(options) do
      # What becomes of the recorder does not concern the demo before its end.
      Process.unlink(recorder)

      try do
        case opened(recorder) do
          :ok ->
            status = play.(%{options | record: nil, trace: @trace})
            recorder |> finished() |> told(options, status)

          {:error, line} ->
            refuse(line)
        end
      after
        # To a process that has ended it means nothing.
        Process.exit(recorder, :shutdown)
      end
    else
      {:error, line} -> refuse(line)
    end
  end

  @doc """
  Runs `play` in lockstep with the start of its trial and a recorder for its steps; returns its
  exit status, or 1 with a line if the trial cannot be made or the file is not whole.
  """
  @spec lockstep(Options.t(), (Options.t(), Setup.t(), recorder :: pid() -> 0 | 1 | 2)) ::
          0 | 1 | 2
  def lockstep(%Options{record: path} = options, play) do
    with {:setup, {:ok, setup}} <- {:setup, Lab.Trial.setup(Options.trial(options))},
         {:ok, recorder} <-
           Lab.Recorder.start_link(path, setup, pictures: options.record_pictures != nil) do
      status = play.(options, setup, recorder)
      with(:ok <- Lab.Recorder.close(recorder), do: {:ok, 0}) |> told(options, status)
    else
      {:setup, {:error, line}} -> say(line)
      {:error, line} -> refuse(line)
    end
  end

  defp recorder(options) do
    Record.Recorder.start_link(
      robots: options.robots,
      file: [path: options.record],
      pictures: options.record_pictures
    )
  end

  # As a recording in lockstep does.
  defp fresh(path) do
    case File.rm(path) do
      {:error, reason} when reason != :enoent ->
        {:error, "#{path} cannot be written: #{:file.format_error(reason)}"}

      _gone ->
        :ok
    end
  end

  defp opened(recorder) do
    case Record.Recorder.status(recorder) do
      %{failed: nil} -> :ok
      %{failed: line} -> {:error, line}
    end
  end

  defp finished(recorder) do
    %{lost: lost} = Record.Recorder.status(recorder)
    with :ok <- Record.Recorder.close(recorder), do: {:ok, lost}
  catch
    :exit, _reason -> {:error, "the recorder has ended before the run; what it has written stays"}
  end

  defp told({:ok, lost}, options, status) do
    output = Output.to(if(options.json == "-", do: :stderr, else: :stdio))
    without = if lost > 0, do: ", without #{lost} entries that were too many", else: ""
    Output.line(output, "Wrote #{options.record}#{without}")
    status
  end

  defp told({:error, line}, _options, _status), do: refuse(line)

  defp refuse(line), do: say("--record #{line}")

  defp say(line) do
    IO.puts(:stderr, "demo: #{line}")
    1
  end
end
