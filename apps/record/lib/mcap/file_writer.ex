defmodule Mcap.FileWriter do
  @moduledoc """
  Writes an MCAP file: a process, so that no disk holds up the recording program.

      {:ok, recorder} = Mcap.FileWriter.start_link(path: "run.mcap")
      {:ok, id} = Mcap.FileWriter.channel(recorder, "/log", "json", Mcap.Foxglove.schema("foxglove.Log"))
      :ok = Mcap.FileWriter.message(recorder, id, ns, payload)
      :ok = Mcap.FileWriter.close(recorder)

  `message/4` does not wait: a program that sends more than a disk takes calls `sync/1` now and then. A chunk is written when
  it is full, after a second of log time, and after a second: when the VM is killed, what is older is in the file.

  Nothing that goes wrong ends the caller: the first error is the answer of `sync/1`, `flush/1` and `close/1` from then
  on, and where the file cannot be written any more, later messages are dropped.
  """
  use GenServer
  alias Mcap.FileWriter.Output
  alias Mcap.{Channel, Writer}

  @second_ns 1_000_000_000
  @flush_ms 1000
  @call_ms 30_000
  @ended "the recorder has ended"
  @hangs "the recorder does not answer: its disk may hang"

  @options [
    path: [:path, required: true],
    limit_bytes: [{:integer, 0x40_0000, 0xFFFF_FFFF_FFFF, "bytes"}, default: nil],
    library: [{:check, &Writer.Channels.text?/1, "text"}, default: "convoy"],
    chunk_bytes: [{:integer, 1, 0x1000_0000, "bytes"}, default: 0x10_0000]
  ]

  defstruct [:path, :output, :error, :timer]

  @type recorder :: GenServer.server()

  @doc """
  Starts it. Options:

  - `path` (required): the file, which must not be there yet; with `limit_bytes`, the folder of `run-0001.mcap` and so
    on, which is made if it is missing
  - `limit_bytes` (from 4 MiB): the most that these files have together; the oldest are deleted. A message may have a
    quarter of it
  - `library` (`"convoy"`): the program that writes; `chunk_bytes` (1 MiB)
  - `name`: of the process, as `GenServer` takes it

  Raises `ArgumentError` with one line for other options. That a file cannot be made is the answer of `sync/1`.
  """
  @spec start_link(keyword()) :: {:ok, pid()}
  def start_link(options) do
    {name, options} = Keyword.pop(options, :name)
    options = Hal.Options.check!(options, @options, "recording")
    GenServer.start_link(__MODULE__, options, if(name, do: [name: name], else: []))
  end

  @typedoc "A question to a recorder, whose answer comes as a message (`answer/2`)."
  @opaque question :: :gen_server.request_id()

  @doc """
  Asks a recorder to add a note and channels `{topic, message_encoding, schema}`, without waiting for its disk. The answer is
  `{:ok, ids, file}`.
  """
  @spec begin(
          recorder(),
          note :: {String.t(), %{String.t() => String.t()}},
          [{String.t(), String.t(), Channel.schema() | nil}]
        ) :: question()
  def begin(recorder, note, channels),
    do: :gen_server.send_request(recorder, {:begin, note, channels})

  @doc "Asks when all that was sent before is in the file, without waiting. The answer is `{:ok, file}`."
  @spec written(recorder()) :: question()
  def written(recorder), do: :gen_server.send_request(recorder, :written)

  @typedoc "What its function says."
  @type answer ::
          {:ok, Path.t()} | {:ok, [pos_integer()], Path.t()} | {:error, line :: String.t()}

  @doc "What a message answers to a question; `nil` for any other message."
  @spec answer(message :: term(), question()) :: answer() | nil
  def answer(message, question), do: said(:gen_server.check_response(message, question))

  @doc "The answer to a question, for which this waits."
  @spec await(question()) :: answer()
  def await(question), do: said(:gen_server.wait_response(question, @call_ms))

  defp said({:reply, answer}), do: answer
  defp said({:error, _ended}), do: {:error, @ended}
  defp said(:timeout), do: {:error, @hangs}
  defp said(:no_reply), do: nil

  @doc "The id of a channel, as `Mcap.Writer.channel/5`; the same in all files of a folder."
  @spec channel(recorder(), String.t(), String.t(), Channel.schema() | nil, map()) ::
          {:ok, id :: pos_integer()} | {:error, line :: String.t()}
  def channel(recorder, topic, message_encoding, schema, metadata \\ %{})
      when is_binary(topic) and is_binary(message_encoding) and is_map(metadata),
      do: call(recorder, {:channel, topic, message_encoding, schema, metadata})

  @doc "Adds a message, without waiting."
  @spec message(recorder(), pos_integer(), log_time_ns :: non_neg_integer(), iodata()) :: :ok
  def message(recorder, id, ns, data) when ns in 0..0xFFFF_FFFF_FFFF_FFFF,
    do: GenServer.cast(recorder, {:message, id, ns, IO.iodata_to_binary(data)})

  @doc "Adds a note about the recording, which each file of a folder repeats."
  @spec metadata(recorder(), String.t(), %{String.t() => String.t()}) ::
          :ok | {:error, line :: String.t()}
  def metadata(recorder, name, pairs) when is_binary(name) and is_map(pairs),
    do: call(recorder, {:metadata, name, pairs})

  @doc "Waits until all that was sent before has been taken. The error is the first that there was."
  @spec sync(recorder()) :: :ok | {:error, line :: String.t()}
  def sync(recorder), do: call(recorder, :sync)

  @doc "The file that is written now: with `limit_bytes`, one of the folder. The error as in `sync/1`."
  @spec file(recorder()) :: {:ok, Path.t()} | {:error, line :: String.t()}
  def file(recorder), do: call(recorder, :file)

  @doc "Waits until all that was sent before is in the file, and survives a kill of this VM."
  @spec flush(recorder()) :: :ok | {:error, line :: String.t()}
  def flush(recorder), do: call(recorder, :flush)

  @doc "Ends the file, and this process. `:ok` means that all is in it."
  @spec close(recorder()) :: :ok | {:error, line :: String.t()}
  def close(recorder), do: call(recorder, :close)

  defp call(recorder, what) do
    GenServer.call(recorder, what, @call_ms)
  catch
    :exit, {:timeout, _call} -> {:error, @hangs}
    :exit, _reason -> {:error, @ended}
  end

  @impl GenServer
  def init(options) do
    # To end the file when the process that started this ends.
    Process.flag(:trap_exit, true)
    # A disk that hangs must not hold up the caller.
    {:ok, %__MODULE__{path: options[:path]}, {:continue, options}}
  end

  @impl GenServer
  def handle_continue(options, state) do
    {path, options} = Keyword.pop!(options, :path)
    {limit, options} = Keyword.pop!(options, :limit_bytes)
    {:noreply, took(state, Output.open(path, limit, [{:chunk_ns, @second_ns} | options]))}
  end

  @impl GenServer
  def handle_cast({:message, _id, _ns, _data}, %{output: nil} = state), do: {:noreply, state}

  def handle_cast({:message, id, ns, data}, state) do
    if Writer.channel?(state.output.writer, id) do
      {:noreply, state |> took(Output.message(state.output, id, ns, data)) |> flush_later()}
    else
      {:noreply, note(state, "#{state.path} has no channel #{inspect(id)}")}
    end
  end

  @impl GenServer
  def handle_call({:channel, _, _, _, _}, _from, %{output: nil} = state),
    do: {:reply, {:error, state.error}, state}

  def handle_call({:channel, topic, encoding, schema, metadata}, _from, state) do
    {id, writer} = Writer.channel(state.output.writer, topic, encoding, schema, metadata)
    {:reply, {:ok, id}, %{state | output: %{state.output | writer: writer}}}
  rescue
    error in ArgumentError -> {:reply, {:error, error.message}, state}
  end

  def handle_call({:metadata, name, pairs}, _from, %{output: %Output{}} = state) do
    answer(took(state, Output.metadata(state.output, name, pairs)))
  rescue
    error in ArgumentError -> {:reply, {:error, error.message}, state}
  end

  def handle_call({:begin, {name, pairs}, channels}, from, state) do
    with {:reply, :ok, state} <- handle_call({:metadata, name, pairs}, from, state) do
      {ids, state} = Enum.map_reduce(channels, state, &begun/2)
      {:reply, {:ok, ids, Output.name(state.output)}, state}
    end
  end

  def handle_call(:written, from, state) do
    with {:reply, :ok, %{output: %Output{}} = state} <- handle_call(:flush, from, state),
         do: {:reply, {:ok, Output.name(state.output)}, state}
  end

  def handle_call(:file, _from, %{error: nil, output: %Output{} = output} = state),
    do: {:reply, {:ok, Output.name(output)}, state}

  def handle_call(:flush, _from, %{output: %Output{}} = state), do: answer(flushed(state))

  def handle_call(:close, _from, state) do
    state = finished(state)
    {:stop, :normal, result(state), state}
  end

  def handle_call(_what, _from, state), do: answer(state)

  @impl GenServer
  def handle_info(:flush, state), do: {:noreply, flushed(%{state | timer: nil})}
  def handle_info(_other, state), do: {:noreply, state}

  @impl GenServer
  def terminate(_reason, state), do: finished(state)

  defp begun({topic, encoding, schema}, state) do
    {id, writer} = Writer.channel(state.output.writer, topic, encoding, schema)
    {id, %{state | output: %{state.output | writer: writer}}}
  end

  defp flush_later(%{timer: nil, output: %Output{}} = state),
    do: %{state | timer: Process.send_after(self(), :flush, @flush_ms)}

  defp flush_later(state), do: state

  defp flushed(%{output: nil} = state), do: state
  defp flushed(state), do: took(state, Output.flush(state.output))

  defp finished(%{output: nil} = state), do: state

  defp finished(state) do
    case Output.finish(state.output) do
      {:ok, _output} -> %{state | output: nil}
      {:error, line} -> note(%{state | output: nil}, line)
    end
  end

  defp took(state, {:ok, output}), do: %{state | output: output}
  defp took(state, {:refused, line}), do: note(state, line)
  defp took(state, {:error, line}), do: note(%{state | output: nil}, line)

  # The first error is the one that tells why.
  defp note(state, line), do: %{state | error: state.error || line}

  defp answer(state), do: {:reply, result(state), state}

  defp result(%{error: nil}), do: :ok
  defp result(%{error: line}), do: {:error, line}
end
