defmodule Robot.Recording.File do
  @moduledoc """
  Opens a recording of robots of processes. What was cut, because its program was killed, is read
  as far as it is whole.

  A replay runs the code of the missions and behaviours that the file names, with the options that
  it has: replay the files of your own robots only.
  """
  alias Robot.{Recording, Replay}

  @enforce_keys [:path, :robots, :reader, :whole?, :start_ms, :end_ms]
  defstruct @enforce_keys

  @typedoc "`start_ms` and `end_ms` are times of Unix; `whole?` says whether it was ended in order."
  @type t :: %__MODULE__{
          path: Path.t(),
          robots: Recording.robots(),
          reader: Mcap.Reader.t(),
          whole?: boolean(),
          start_ms: integer(),
          end_ms: integer()
        }

  # An entry is written within a second after it was made, or, on a disk that is slow, some later.
  @late_ms 120_000

  @doc """
  Opens a file; `:other` if it is not a recording of robots of processes. The error is one line
  that names the file. Of atoms only the names that it lists are created (`Robot.Recording.Names`).
  """
  @spec open(Path.t()) :: {:ok, t()} | :other | {:error, line :: String.t()}
  def open(path) do
    {about, _trace, _encoding} = Recording.topics()

    with {:ok, reader} <- Mcap.Reader.open(path),
         summary = Mcap.Reader.summary(reader),
         true <- Enum.any?(summary.channels, &(&1.topic == about)) || :other,
         {:ok, robots} <- robots(reader, about, path) do
      file = %__MODULE__{
        path: path,
        robots: robots,
        reader: reader,
        whole?: summary.whole?,
        start_ms: div(summary.start_ns, 1_000_000),
        end_ms: div(summary.end_ns, 1_000_000)
      }

      # Entries are written up to a second after they were made.
      case Enum.take(entries(file), 1) do
        [first] -> {:ok, %{file | start_ms: unix_ms(robots, first)}}
        [] -> {:ok, file}
      end
    end
  rescue
    error in Mcap.DamagedError -> {:error, Exception.message(error)}
  end

  # A robot's profile and clock may come later than its name.
  defp robots(reader, topic, path) do
    reader
    |> Mcap.Reader.messages(topics: [topic])
    |> Enum.reduce_while({:ok, %{}, Recording.Names.most()}, fn
      {_topic, _channel, _ns, bytes}, {:ok, known, left} ->
        case Recording.read_robots(bytes, left) do
          {:ok, robots, left} -> {:cont, {:ok, Map.merge(known, robots, &newer/3), left}}
          {:error, line} -> {:halt, {:error, "#{path} #{line}"}}
        end
    end)
    |> then(fn result -> with {:ok, robots, _left} <- result, do: {:ok, robots} end)
  end

  defp newer(_id, one, other),
    do: Map.merge(one, other, fn _key, a, b -> if(b == nil, do: a, else: b) end)

  @doc """
  The entries in their order, lazily; with `until_ms`, a time of Unix, those up to then of the
  robots whose clock is known. Raises `Mcap.DamagedError` at a damaged part of the file.
  """
  @spec entries(t(), until_ms: integer()) :: Enumerable.t()
  def entries(%__MODULE__{path: path, reader: reader, robots: robots}, options \\ []) do
    {_about, trace, _encoding} = Recording.topics()
    until_ms = Keyword.get(options, :until_ms, :infinity)

    query =
      if until_ms == :infinity, do: [], else: [to_ns: max(until_ms + @late_ms, 0) * 1_000_000]

    reader
    |> Mcap.Reader.messages([{:topics, [trace]} | query])
    |> Stream.flat_map(fn {_topic, _channel, _ns, bytes} ->
      case Recording.read_trace(bytes, robots) do
        {:ok, entries} -> entries
        {:error, line} -> raise Mcap.DamagedError, message: "#{path} #{line}"
      end
    end)
    |> Stream.filter(&(until_ms == :infinity or unix_ms(robots, &1) <= until_ms))
  end

  defp unix_ms(robots, {id, {_role, _kind, _what, at_ms}}), do: at_ms + offset_ms(robots, id)

  @doc "The time of an entry of a robot's clock, in ms from the start of the file."
  @spec since_start_ms(t(), robot :: atom(), at_ms :: integer()) :: integer()
  def since_start_ms(%__MODULE__{robots: robots, start_ms: start_ms}, id, at_ms),
    do: at_ms + offset_ms(robots, id) - start_ms

  defp offset_ms(robots, id), do: get_in(robots, [id, :offset_ms]) || 0

  @doc "The robots, sorted."
  @spec ids(t()) :: [atom()]
  def ids(%__MODULE__{robots: robots}), do: robots |> Map.keys() |> Enum.sort()

  @doc "Replays all entries up to a time, with what was compared and all differences found."
  @spec replay(t(), until_ms: integer()) :: {Replay.t(), [Replay.difference()]}
  def replay(%__MODULE__{} = file, options \\ []) do
    {replay, differences} =
      file
      |> entries(options)
      |> Enum.reduce({Replay.new(), []}, fn entry, {replay, differences} ->
        {replay, difference} = Replay.step(replay, entry)
        {replay, List.wrap(difference) ++ differences}
      end)

    {replay, last} = Replay.finish(replay)
    {replay, Enum.reverse(differences) ++ last}
  end
end
