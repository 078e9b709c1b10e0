defmodule Lab.Recording.File do
  @moduledoc """
  Opens the recording of a run. What was cut, because its program was killed, is read as far as it
  is whole.
  """
  alias Lab.{Recording, Trial}

  @enforce_keys [:path, :setup, :reader, :whole?]
  defstruct @enforce_keys

  @typedoc "`whole?` says whether the recording was ended in order."
  @type t :: %__MODULE__{
          path: Path.t(),
          setup: Trial.Setup.t(),
          reader: Mcap.Reader.t(),
          whole?: boolean()
        }

  @doc "Opens a recording; the error is one line that names the file."
  @spec open(Path.t()) :: {:ok, t()} | {:error, line :: String.t()}
  def open(path) do
    {start, _ticks, _encoding} = Recording.topics()
    know()

    with {:ok, reader} <- Mcap.Reader.open(path),
         {:ok, bytes} <- first(reader, start, path),
         {:ok, setup} <- named(Recording.read_start(bytes), path) do
      whole? = Mcap.Reader.summary(reader).whole?
      {:ok, %__MODULE__{path: path, setup: setup, reader: reader, whole?: whole?}}
    end
  end

  @doc """
  The ticks from `from_ms` on, lazily. Raises `Mcap.DamagedError` at a damaged part of the file.
  """
  @spec ticks(t(), from_ms: non_neg_integer()) :: Enumerable.t()
  def ticks(%__MODULE__{path: path, reader: reader}, options \\ []) do
    {_start, ticks, _encoding} = Recording.topics()

    reader
    |> Mcap.Reader.messages(
      topics: [ticks],
      from_ns: Keyword.get(options, :from_ms, 0) * 1_000_000
    )
    |> Stream.map(fn {_topic, _channel, ns, bytes} ->
      case Recording.read_tick(bytes) do
        # Else a tick of another time than its message's would hide all that come behind it.
        {:ok, {at_ms, _entries} = tick} when at_ms * 1_000_000 == ns -> tick
        {:ok, _tick} -> raise Mcap.DamagedError, message: "#{path} has a tick of the wrong time"
        {:error, line} -> raise Mcap.DamagedError, message: "#{path} #{line}"
      end
    end)
  end

  @doc "The time of the last tick, in ms from the start."
  @spec last_ms(t()) :: non_neg_integer()
  def last_ms(%__MODULE__{reader: reader}), do: div(Mcap.Reader.summary(reader).end_ns, 1_000_000)

  defp first(reader, topic, path) do
    case reader |> Mcap.Reader.messages(topics: [topic]) |> Enum.take(1) do
      [{_topic, _channel, _ns, bytes}] -> {:ok, bytes}
      [] -> {:error, "#{path} #{without(Mcap.Reader.summary(reader), topic)}"}
    end
  end

  defp without(%{whole?: false, count: 0}, _topic),
    do: "was cut before its start was written: nothing of it can be replayed"

  defp without(%{channels: channels}, topic) do
    {live, _trace, _encoding} = Record.Recording.topics()

    if Enum.any?(channels, &(&1.topic == live)),
      do:
        "is a recording of live robots, which have no common ticks, and not of a run in lockstep",
      else: "is not a recording of a run: it has no topic #{topic}"
  end

  defp named({:error, line}, path), do: {:error, "#{path} #{line}"}
  defp named(ok, _path), do: ok

  @doc "Makes the atoms of missions exist that a recording of our robots can contain; it brings the names of robots along."
  @spec know() :: :ok
  def know, do: Swarm.MissionRegistry.load(:lab)
end
