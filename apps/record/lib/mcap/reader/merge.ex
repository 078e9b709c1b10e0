defmodule Mcap.Reader.Merge do
  @moduledoc false
  # Reads the messages of a file in order of time, a chunk when its turn has come. As many chunks are in memory as overlap
  # in time: one, in a file that was written in order.
  alias Mcap.DamagedError
  alias Mcap.Reader.{Chunk, Source}

  @type query :: %{
          path: Path.t(),
          known: map(),
          chunks: [map()],
          topics: :all | MapSet.t(String.t()),
          from_ns: non_neg_integer(),
          to_ns: non_neg_integer() | :infinity,
          damaged: :raise | :skip
        }

  @doc "The messages that a query asks for. The file is open while they are taken."
  @spec stream(query()) :: Enumerable.t()
  def stream(query) do
    Stream.resource(
      fn ->
        {open(query.path), query.chunks |> Enum.filter(&wanted?(&1, query)) |> sort(), []}
      end,
      &step(&1, query),
      fn {source, _chunks, _waiting} -> Source.close(source) end
    )
  end

  defp open(path) do
    case Source.open(path) do
      {:ok, source} -> source
      {:error, line} -> raise DamagedError, line
    end
  end

  defp sort(chunks), do: Enum.sort_by(chunks, &{&1.start_ns, &1.offset})

  defp wanted?(chunk, query) do
    chunk.end_ns >= query.from_ns and before?(chunk.start_ns, query.to_ns) and
      (chunk.channels == :any or query.topics == :all or
         Enum.any?(chunk.channels, &wanted_channel?(query.known.channels[&1], query)))
  end

  # A chunk may bring a channel that is not known yet.
  defp wanted_channel?(nil, _query), do: true
  defp wanted_channel?(channel, query), do: channel.topic in query.topics

  # `:infinity`, an atom, is above all numbers.
  defp before?(ns, to_ns), do: ns < to_ns

  defp step({source, [], []}, _query), do: {:halt, {source, [], []}}
  defp step({source, [], waiting}, _query), do: {Enum.map(waiting, &show/1), {source, [], []}}

  # What is before the next chunk begins is done; at the same time, the place in the file decides.
  defp step({source, [chunk | chunks], waiting}, query) do
    case Enum.split_while(waiting, fn {{ns, _place}, _, _} -> ns < chunk.start_ns end) do
      {[], waiting} ->
        {[], {source, chunks, :lists.keymerge(1, waiting, load(source, chunk, query))}}

      {done, waiting} ->
        {Enum.map(done, &show/1), {source, [chunk | chunks], waiting}}
    end
  end

  defp show({{ns, _place}, channel, data}), do: {channel.topic, channel, ns, data}

  defp load(source, chunk, query) do
    with {:ok, decoded} <- decode(source, chunk, query.known),
         :ok <- check(decoded.messages, chunk) do
      decoded.messages
      |> Enum.filter(fn {{ns, _place}, channel, _data} ->
        ns >= query.from_ns and before?(ns, query.to_ns) and
          (query.topics == :all or channel.topic in query.topics)
      end)
      |> List.keysort(0)
    else
      error -> damaged(error, chunk, query)
    end
  end

  defp decode(_source, %{damaged: text}, _known) when text != nil, do: {:error, text}

  defp decode(source, %{kind: :chunk} = chunk, known) do
    with {:ok, content} <- Source.record(source, 0x06, chunk.offset, chunk.length),
         do: Chunk.decode(content, chunk.offset + 9, known)
  end

  defp decode(source, %{kind: :run} = chunk, known) do
    with {:ok, records} <- Source.read(source, chunk.offset, chunk.length),
         do: Chunk.run(records, chunk.offset, known)
  end

  # Else messages would come out of order, or be missed.
  defp check(messages, chunk) do
    if Enum.all?(messages, fn {{ns, _}, _, _} -> ns >= chunk.start_ns and ns <= chunk.end_ns end),
      do: :ok,
      else: {:error, "its messages are not of the time that the file's index says"}
  end

  defp damaged(_error, _chunk, %{damaged: :skip}), do: []

  defp damaged(error, chunk, query),
    do: raise(DamagedError, "#{query.path} is damaged at byte #{chunk.offset}: #{reason(error)}")

  defp reason(:error), do: "the chunk cannot be read"
  defp reason({:error, {:compression, name}}), do: "it is compressed with #{name}"
  defp reason({:error, text}), do: text
end
