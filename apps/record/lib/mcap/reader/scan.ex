defmodule Mcap.Reader.Scan do
  @moduledoc false
  # Finds the messages of a file record by record, from its begin: for files without a summary, which were cut or are
  # of another writer. It ends at the first record that is not whole. A chunk that is whole, but damaged, is kept as
  # such; at the very end of a file that was cut it is part of the cut: a disk may lose the last bytes of a file that
  # it has made longer.
  alias Mcap.Reader.{Chunk, Source}
  alias Mcap.Record.Parse

  # Messages outside of chunks are taken together up to here.
  @run 0x10_0000

  @empty %{
    schemas: %{},
    channels: %{},
    counts: %{},
    chunks: [],
    metadata: [],
    run: nil,
    ended?: false,
    chunked?: false
  }

  @doc "Scans from behind the magic. `{:compression, name}` is a chunk that only other readers open."
  @spec read(Source.t(), whole? :: boolean()) ::
          {:ok, map()} | {:error, {:compression, String.t()}}
  def read(source, whole?) do
    with {:ok, found, offset} <- records(source, 8, @empty) do
      found = close_run(source, found)
      {found, offset} = if whole?, do: {found, offset}, else: drop_damaged(found, offset)
      good = for %{damaged: nil} = chunk <- found.chunks, chunk.count > 0, do: chunk

      {:ok,
       Map.merge(found, %{
         metadata: Enum.reverse(found.metadata),
         count: found.counts |> Map.values() |> Enum.sum(),
         start_ns: good |> Enum.map(& &1.start_ns) |> Enum.min(fn -> 0 end),
         end_ns: good |> Enum.map(& &1.end_ns) |> Enum.max(fn -> 0 end),
         cut_at: if(found.ended?, do: nil, else: offset)
       })}
    end
  end

  defp drop_damaged(%{chunks: [%{damaged: text} = chunk | chunks]} = found, _offset)
       when text != nil,
       do: drop_damaged(%{found | chunks: chunks}, chunk.offset)

  defp drop_damaged(found, offset), do: {found, offset}

  defp records(source, offset, found) do
    with {:ok, opcode, length} <- Source.head(source, offset),
         {:ok, found} <- record(opcode, source, offset, length, found) do
      if found.ended?, do: {:ok, found, offset}, else: records(source, offset + length, found)
    else
      {:error, reason} -> {:error, reason}
      :error -> {:ok, found, offset}
    end
  end

  # In a file with chunks no message is outside of them: this one is damage that looks like a message.
  defp record(0x05, _source, _offset, _length, %{chunked?: true} = found), do: {:ok, found}

  # Schemas, channels and messages wait until they are some, or until something else comes.
  defp record(opcode, source, offset, length, found) when opcode in [0x03, 0x04, 0x05] do
    case found.run do
      {start, bytes} when bytes + length <= @run ->
        {:ok, %{found | run: {start, bytes + length}}}

      _none_or_full ->
        {:ok, %{close_run(source, found) | run: {offset, length}}}
    end
  end

  defp record(opcode, source, offset, length, found),
    do: other(opcode, source, offset, length, close_run(source, found))

  defp other(0x06, source, offset, length, found) do
    with {:ok, content} <- Source.record(source, 0x06, offset, length) do
      case Chunk.decode(content, offset + 9, found) do
        {:error, {:compression, _name} = reason} -> {:error, reason}
        decoded -> {:ok, chunk(found, entry(:chunk, offset, length), decoded, content)}
      end
    end
  end

  defp other(0x0C, source, offset, length, found) do
    with {:ok, content} <- Source.record(source, 0x0C, offset, length),
         {:ok, name, pairs} <- Parse.metadata(content) do
      {:ok, %{found | metadata: [{name, pairs} | found.metadata]}}
    end
  end

  defp other(opcode, _source, _offset, _length, found) when opcode in [0x02, 0x0F],
    do: {:ok, %{found | ended?: true}}

  defp other(_opcode, _source, _offset, _length, found), do: {:ok, found}

  defp chunk(found, entry, decoded, content),
    do: add(%{found | chunked?: true}, entry, decoded, content)

  defp close_run(_source, %{run: nil} = found), do: found

  defp close_run(source, %{run: {offset, length}} = found) do
    decoded =
      with {:ok, records} <- Source.read(source, offset, length),
           do: Chunk.run(records, offset, found)

    decoded = if decoded == :error, do: {:error, "it cannot be read"}, else: decoded
    add(%{found | run: nil}, entry(:run, offset, length), decoded, <<>>)
  end

  defp entry(kind, offset, length),
    do: %{kind: kind, offset: offset, length: length, channels: :any, damaged: nil}

  defp add(found, entry, {:ok, decoded}, _content) do
    times = for {{ns, _place}, _channel, _data} <- decoded.messages, do: ns
    counts = Enum.frequencies_by(decoded.messages, fn {_key, channel, _data} -> channel.id end)

    entry =
      Map.merge(entry, %{
        start_ns: Enum.min(times, fn -> 0 end),
        end_ns: Enum.max(times, fn -> 0 end),
        count: length(times)
      })

    %{
      found
      | schemas: decoded.schemas,
        channels: decoded.channels,
        counts: Map.merge(found.counts, counts, fn _id, a, b -> a + b end),
        chunks: [entry | found.chunks]
    }
  end

  # When it was is what its head says, for want of something better.
  defp add(found, entry, {:error, text}, content) do
    {first, last} =
      case Parse.chunk_head(content) do
        {:ok, head} -> {head.start_ns, head.end_ns}
        :error -> {0, 0xFFFF_FFFF_FFFF_FFFF}
      end

    about = %{start_ns: first, end_ns: max(first, last), count: 0, damaged: text}
    %{found | chunks: [Map.merge(entry, about) | found.chunks]}
  end
end
