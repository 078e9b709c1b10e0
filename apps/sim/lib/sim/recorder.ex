defmodule Sim.Recorder do
  @moduledoc """
  Writes the recording of a run into a file, beside the run: the run hands over what happened in a
  tick and goes on. What was written is on the disk at least once a second of the run's time, and is
  readable even if the program is killed then.

  The run's times count from zero, so that a run from a seed gives the same file. A write that
  fails ends the recording, not the run; an ffmpeg that fails ends the pictures; `close/1` says so.
  """
  use GenServer
  alias Mcap.Writer
  alias Hal.Frame
  alias Sim.Recorder.Camera
  alias Sim.Recording
  alias Sim.Recording.{Pictures, Topics}
  alias Sim.Trial.Setup

  # The run waits for its recorder after so many ticks, so that it never gets far ahead.
  @ahead 50
  @chunk_ms 1_000
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
         :ok <- explain(path, File.write(path, "")),
         do: GenServer.start_link(__MODULE__, {path, setup, pictures?}, spawn_opt: @room)
  end

  defp able(path) do
    with {:error, line} <- Camera.able(), do: {:error, "#{path} would have no pictures: #{line}"}
  end

  defp explain(_path, :ok), do: :ok

  defp explain(path, {:error, reason}),
    do: {:error, "#{path} cannot be written: #{:file.format_error(reason)}"}

  @doc """
  Records a tick, the scene at its end, and the pictures that were due at its begin
  (`Sim.Recording.Pictures.due/2`), of robots that saw something then: not of those that are blind,
  frozen or dead. Seldom waits for the disk.
  """
  @spec tick(pid(), Recording.tick(), Sim.Scene.t(), [{atom(), Frame.t()}]) :: :ok
  def tick(recorder, {at_ms, _entries} = tick, scene, frames \\ []) do
    {_at_ms, _bytes, facts} = tick = Topics.prepare(tick, for({id, _frame} <- frames, do: id))
    frames = for {id, frame} <- frames, List.keymember?(facts.seen, id, 0), do: {id, frame}
    GenServer.cast(recorder, {:tick, tick, scene, frames})
    if rem(div(at_ms, 100), @ahead) == 0, do: GenServer.call(recorder, :reached, :infinity)
    :ok
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
    {:ok, file} = :file.open(path, [:write, :raw, :binary])
    {writer, head} = Writer.new(library: "convoy")
    {writer, note} = Writer.metadata(writer, "convoy", Recording.metadata(setup))
    {topics, writer, first} = Topics.open(writer, setup, pictures?)

    s = %{
      path: path,
      file: file,
      written: :ok,
      writer: writer,
      topics: topics,
      flushed_ms: 0,
      camera: nil,
      blind: nil
    }

    # The start is on the disk before anything happens.
    {:ok, s |> write([head, note, first]) |> flush(0)}
  end

  @impl GenServer
  def handle_call(:reached, _from, s), do: {:reply, :ok, s}

  def handle_call(:close, _from, s) do
    s = write(s, Writer.finish(s.writer))
    :ok = :file.close(s.file)
    :ok = Camera.close(s.camera)
    {:reply, with(:ok <- explain(s.path, s.written), do: s.blind || :ok), %{s | camera: nil}}
  end

  @impl GenServer
  def handle_cast({:tick, _tick, _scene, _frames}, %{written: {:error, _reason}} = s),
    do: {:noreply, s}

  def handle_cast({:tick, {at_ms, _bytes, _facts} = tick, scene, frames}, s) do
    {pictures, s} = Enum.flat_map_reduce(frames, s, &picture/2)
    {topics, writer, bytes} = Topics.tick(s.topics, s.writer, tick, scene, pictures)
    s = write(%{s | topics: topics, writer: writer}, bytes)
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

  defp flush(s, at_ms) do
    {writer, bytes} = Writer.flush(s.writer)
    write(%{s | writer: writer, flushed_ms: at_ms}, bytes)
  end

  defp write(%{written: :ok} = s, bytes),
    do: if(bytes == [], do: s, else: %{s | written: :file.write(s.file, bytes)})

  defp write(s, _bytes), do: s
end
