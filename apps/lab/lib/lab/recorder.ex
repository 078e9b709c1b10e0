defmodule Lab.Recorder do
  @moduledoc """
  Writes the recording of a run into a file, beside the run: the run hands over what happened in a
  tick and goes on. What was written is on the disk at least once a second of the run's time, and is
  readable even if the program is killed then.

  The run's times count from zero, so that a run from a seed gives the same file. A write that
  fails ends the recording, not the run, and what was written before stays whole; an ffmpeg that fails ends the pictures;
  `close/1` says so. A disk that does not answer for a second is told on standard error, and the run waits for it after 5 s of its time.
  """
  use GenServer
  alias Mcap.FileWriter.{Disk, Output}
  alias Mcap.Writer
  alias Hal.Frame
  alias Record.Camera
  alias Lab.{Recording, Trial}
  alias Lab.Recording.{Pictures, Topics}
  alias Lab.Trial.Setup

  # The run waits for its recorder after so many ticks, so that it never gets far ahead.
  @ahead 50
  @chunk_ms 1_000
  @hangs_ms 1_000
  # A tick makes ten thousand words of garbage.
  @room [min_heap_size: 100_000]

  @doc """
  Opens the file, which is overwritten, and records the start; the error is one line. With
  `pictures: true` there may be camera pictures in its ticks, for which ffmpeg must be installed.
  """
  @spec start_link(Path.t(), Setup.t(), pictures: boolean()) ::
          {:ok, pid()} | {:error, String.t()}
  def start_link(path, setup, options \\ []) do
    pictures? = Keyword.get(options, :pictures, false)

    # Whether it can be opened is known before there is a process that would end for it.
    with :ok <- if(pictures?, do: able(path), else: :ok),
         :ok <- Disk.named(patient(path, fn -> File.write(path, "") end), path),
         do: GenServer.start_link(__MODULE__, {path, setup, pictures?}, spawn_opt: @room)
  end

  defp able(path) do
    with {:error, line} <- Camera.able(), do: {:error, "#{path} would have no pictures: #{line}"}
  end

  @doc """
  Records a tick, the scene at its end, and the pictures that were due at its begin
  (`Lab.Recording.Pictures.due/2`), of robots that saw something then: not of those that are blind,
  frozen or dead. Seldom waits for the disk.
  """
  @spec tick(pid(), Recording.tick(), Sim.Scene.t(), [{atom(), Frame.t()}]) :: :ok
  def tick(recorder, {at_ms, _entries} = tick, scene, frames \\ []) do
    {_at_ms, _bytes, facts} = tick = Topics.prepare(tick, for({id, _frame} <- frames, do: id))
    frames = for {id, frame} <- frames, List.keymember?(facts.seen, id, 0), do: {id, frame}
    GenServer.cast(recorder, {:tick, tick, scene, frames})

    if rem(div(at_ms, 100), @ahead) == 0,
      do: GenServer.call(recorder, :reached, :infinity),
      else: :ok
  end

  @doc """
  Records the step that a trial has made since `before`, with so many pictures a second of each robot (`nil`: none), and returns
  the trial without what happened in it. A step that raised was none.
  """
  @spec step(pid(), before :: Trial.t(), Trial.t(), number() | nil) :: Trial.t()
  def step(recorder, before, trial, pictures \\ nil)
  def step(_recorder, trial, trial, _pictures), do: trial

  def step(recorder, before, trial, pictures) do
    {entries, trial} = Trial.take_entries(trial)
    frames = Pictures.due(before, pictures)
    :ok = tick(recorder, {trial.at_ms, entries}, Trial.scene(trial), frames)
    trial
  end

  # Calls to a disk that may hang; the process that waits for it cannot say so. The commands that record are silent in the log.
  defp patient(path, function) do
    line = "#{path}: its disk does not answer; the run waits for it"
    {:ok, timer} = :timer.apply_after(@hangs_ms, IO, :puts, [:stderr, line])
    result = function.()
    {:ok, :cancel} = :timer.cancel(timer)
    result
  end

  @doc "Ends the recording; the error says in one line why it is not whole."
  @spec close(pid()) :: :ok | {:error, String.t()}
  def close(recorder) do
    result = GenServer.call(recorder, :close, :infinity)
    :ok = GenServer.stop(recorder)
    result
  end

  @impl GenServer
  def init({path, setup, pictures?}) do
    # So that the end of an ffmpeg is a message.
    if pictures?, do: Process.flag(:trap_exit, true)

    s = %{
      path: path,
      output: nil,
      written: :ok,
      topics: nil,
      flushed_ms: 0,
      camera: nil,
      blind: nil
    }

    case patient(path, fn -> Output.open(path, nil, library: "convoy", overwrite: true) end) do
      {:ok, output} -> {:ok, begin(%{s | output: output}, setup, pictures?)}
      {:error, line} -> {:ok, %{s | written: {:error, line}}}
    end
  end

  # The start is on the disk before anything happens.
  defp begin(s, setup, pictures?) do
    {writer, note} = Writer.metadata(s.output.writer, "convoy", Recording.metadata(setup))
    {topics, writer, first} = Topics.open(writer, setup, pictures?)
    %{s | topics: topics} |> write(writer, [note, first]) |> flush(0)
  end

  @impl GenServer
  def handle_call(:reached, _from, s), do: {:reply, :ok, s}

  def handle_call(:close, _from, s) do
    s = took(s, s.output && patient(s.path, fn -> Output.finish(s.output) end))
    :ok = Camera.close(s.camera)
    {:reply, with(:ok <- s.written, do: s.blind || :ok), %{s | output: nil, camera: nil}}
  end

  @impl GenServer
  def handle_cast({:tick, _tick, _scene, _frames}, %{written: {:error, _reason}} = s),
    do: {:noreply, s}

  def handle_cast({:tick, {at_ms, _bytes, _facts} = tick, scene, frames}, s) do
    {pictures, s} = Enum.flat_map_reduce(frames, s, &picture/2)
    {topics, writer, bytes} = Topics.tick(s.topics, s.output.writer, tick, scene, pictures)
    s = write(%{s | topics: topics}, writer, bytes)
    {:noreply, if(at_ms - s.flushed_ms >= @chunk_ms, do: flush(s, at_ms), else: s)}
  end

  @impl GenServer
  def handle_info(_from_an_ffmpeg_that_ended, s), do: {:noreply, s}

  defp picture(_frame, %{blind: {:error, _line}} = s), do: {[], s}

  defp picture({id, frame}, s) do
    case Camera.jpeg(s.camera, frame) do
      {{:ok, jpeg}, camera} ->
        {[{id, Pictures.picture(id, frame.at_ms, jpeg)}], %{s | camera: camera}}

      {{:error, line}, camera} ->
        line = "#{s.path} has no pictures from #{frame.at_ms / 1000} s on: #{line}"
        {[], %{s | camera: camera, blind: {:error, line}}}
    end
  end

  defp flush(%{output: nil} = s, _at_ms), do: s

  defp flush(s, at_ms),
    do: took(%{s | flushed_ms: at_ms}, patient(s.path, fn -> Output.flush(s.output) end))

  defp write(s, writer, []), do: took(s, Output.write(s.output, writer, []))

  defp write(s, writer, bytes),
    do: took(s, patient(s.path, fn -> Output.write(s.output, writer, bytes) end))

  defp took(s, nil), do: s
  defp took(s, {:ok, output}), do: %{s | output: output}
  defp took(s, {:error, _line} = error), do: %{s | output: nil, written: error}
end
