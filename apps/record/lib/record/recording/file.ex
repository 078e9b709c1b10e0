defmodule Record.Recording.File do
  @moduledoc """
  Opens a recording of robots of processes. What was cut, because its program was killed, is read
  as far as it is whole.

  A replay runs the code of the missions and behaviours that the file names, with the options that
  it has: replay the files of your own robots only.
  """
  alias Record.{Recording, Replay}

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

  # As in lockstep. A robot's own ticks are that long, more or less.
  @tick_ms 100

  @typedoc "What was recorded within #{@tick_ms} ms, in the order of the file, and their end, in ms from the start of the file."
  @type tick :: {at_ms :: pos_integer(), [Replay.entry(), ...]}

  @doc """
  Opens a file; `:other` if it is not a recording of robots of processes. The error is one line
  that names the file. Of atoms only the names that it lists are created (`Record.Recording.Names`).
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

  @doc "The entries in their order, lazily. Raises `Mcap.DamagedError` at a damaged part of the file."
  @spec entries(t()) :: Enumerable.t()
  def entries(%__MODULE__{} = file), do: file |> written(0) |> Stream.flat_map(&elem(&1, 1))

  # What was written at once, from this time of Unix on, with the time in ms from the start of the file.
  defp written(%{path: path, robots: robots} = file, from_ms) do
    {_about, trace, _encoding} = Recording.topics()

    file.reader
    |> Mcap.Reader.messages(topics: [trace], from_ns: max(from_ms, 0) * 1_000_000)
    |> Stream.map(fn {_topic, _channel, ns, bytes} ->
      case Recording.read_trace(bytes, robots) do
        {:ok, entries} -> {div(ns, 1_000_000) - file.start_ms, entries}
        {:error, line} -> raise Mcap.DamagedError, message: "#{path} #{line}"
      end
    end)
  end

  @doc """
  The entries in ticks of #{@tick_ms} ms, lazily, from the one that ends at `from_ms` or later; a tick without entries is none.
  Entries stay in their order: one that was written behind a later one is in the tick of that. Raises as `entries/1` does.
  """
  @spec ticks(t(), from_ms: non_neg_integer()) :: Enumerable.t()
  def ticks(%__MODULE__{} = file, options \\ []) do
    from_ms = Keyword.get(options, :from_ms, 0)

    # No entry is in a later tick than that in which it was written: so those written before need not be read.
    file
    |> written(file.start_ms + from_ms - @tick_ms)
    |> Stream.flat_map(fn {written_ms, entries} ->
      last = number(written_ms)
      for entry <- entries, do: {min(number(since_start_ms(file, entry)), last), entry}
    end)
    |> Stream.transform(1, fn {number, entry}, newest ->
      {[{max(number, newest), entry}], max(number, newest)}
    end)
    |> Stream.filter(fn {number, _entry} -> number * @tick_ms >= from_ms end)
    |> Stream.chunk_by(&elem(&1, 0))
    |> Stream.map(fn [{number, _first} | _] = tick ->
      {number * @tick_ms, Enum.map(tick, &elem(&1, 1))}
    end)
  end

  defp number(since_ms), do: div(max(since_ms, 0), @tick_ms) + 1

  @doc "The end of the last tick at most, in ms from the start."
  @spec last_ms(t()) :: pos_integer()
  def last_ms(%__MODULE__{start_ms: start_ms, end_ms: end_ms}),
    do: number(end_ms - start_ms) * @tick_ms

  @doc """
  The ticks as those of another recording can be compared with them: all times `at_ms` of a robot count from the start of the
  file; the entries of each role stand together, and without the states, which follow from them. Of a recording that was cut the last tick is left out, as it may be
  cut, too.
  """
  @spec comparable(t()) :: Enumerable.t()
  def comparable(%__MODULE__{} = file) do
    file
    |> ticks()
    |> Stream.drop(if(file.whole?, do: 0, else: -1))
    |> Stream.map(fn {at_ms, entries} -> {at_ms, alike(file, entries)} end)
    |> Stream.reject(&match?({_at_ms, []}, &1))
  end

  defp alike(file, entries) do
    entries =
      for {id, {role, kind, what, at_ms}} when kind not in [:begin, :checkpoint] <- entries do
        shift_ms = since_start_ms(file, id, 0)
        {id, {role, kind, shifted(what, shift_ms), at_ms + shift_ms}}
      end

    Enum.sort_by(entries, fn {id, {role, _kind, _what, _at_ms}} -> {id, role} end)
  end

  defp shifted(%{at_ms: at_ms} = map, shift_ms) when is_integer(at_ms),
    do: map |> Map.delete(:at_ms) |> shifted(shift_ms) |> Map.put(:at_ms, at_ms + shift_ms)

  defp shifted(%{} = map, shift_ms), do: :maps.map(fn _k, v -> shifted(v, shift_ms) end, map)
  defp shifted([one | more], shift_ms), do: [shifted(one, shift_ms) | shifted(more, shift_ms)]

  defp shifted(tuple, shift_ms) when is_tuple(tuple),
    do: tuple |> Tuple.to_list() |> shifted(shift_ms) |> List.to_tuple()

  defp shifted(other, _shift_ms), do: other

  defp unix_ms(robots, {id, {_role, _kind, _what, at_ms}}), do: at_ms + offset_ms(robots, id)

  @doc "The time of an entry of a robot's clock, in ms from the start of the file."
  @spec since_start_ms(t(), robot :: atom(), at_ms :: integer()) :: integer()
  def since_start_ms(%__MODULE__{robots: robots, start_ms: start_ms}, id, at_ms),
    do: at_ms + offset_ms(robots, id) - start_ms

  defp since_start_ms(file, {id, {_role, _kind, _what, at_ms}}),
    do: since_start_ms(file, id, at_ms)

  defp offset_ms(robots, id), do: get_in(robots, [id, :offset_ms]) || 0

  @doc "The robots, sorted."
  @spec ids(t()) :: [atom()]
  def ids(%__MODULE__{robots: robots}), do: robots |> Map.keys() |> Enum.sort()
end
