defmodule Mcap.Reader.Index do
  @moduledoc "Describes what the summary at the end of a whole file tells, or `:error`: then the file is scanned (`Mcap.Reader.Scan`)."
  alias Mcap.Reader.{Chunk, Source}
  alias Mcap.Record.Parse

  # Footer and magic.
  @tail 37

  @doc """
  Reads it. It counts only if its checksum is right, and if it lists all chunks and channels that it counts: other
  writers may leave them out.
  """
  @spec read(Source.t()) :: {:ok, map()} | :error
  def read(source) do
    with {:ok, tail} <- Source.read(source, max(Source.size(source) - @tail, 0), @tail),
         <<0x02, 20::little-64, start::little-64, _offsets::64, crc::little-32, _magic::64>> <-
           tail,
         true <- start > 0,
         length = Source.size(source) - 12 - start,
         true <- length > 17,
         {:ok, bytes} <- Source.read(source, start, length),
         true <- crc in [0, :erlang.crc32(bytes)],
         empty = %{schemas: %{}, channels: %{}, chunks: [], notes: [], statistics: nil},
         {:ok, found} <- records(binary_part(bytes, 0, length - 17), empty),
         %{statistics: %{} = statistics} <- found,
         true <- complete?(found, statistics),
         {:ok, metadata} <- metadata(source, Enum.reverse(found.notes), []) do
      {:ok,
       found |> Map.merge(statistics) |> Map.merge(%{chunks: found.chunks, metadata: metadata})}
    else
      _no -> :error
    end
  end

  defp complete?(found, statistics) do
    length(found.chunks) == statistics.chunks and apart?(found.chunks) and
      (found.chunks != [] or statistics.count == 0) and
      map_size(found.channels) == statistics.channels and
      length(found.notes) == statistics.metadata and
      Enum.all?(Map.keys(statistics.counts), &is_map_key(found.channels, &1))
  end

  # A chunk that is listed again and again would make a small file a long one.
  defp apart?(chunks) do
    places = chunks |> Enum.map(&{&1.offset, &1.length}) |> Enum.sort()

    places
    |> Enum.zip(Enum.drop(places, 1))
    |> Enum.all?(fn {{offset, length}, {next, _length}} -> offset + length <= next end)
  end

  defp records(<<>>, found), do: {:ok, found}

  defp records(bytes, found) do
    with {:ok, opcode, content, rest} <- Parse.record(bytes),
         {:ok, found} <- record(opcode, content, found),
         do: records(rest, found)
  end

  defp record(opcode, content, found) when opcode in [0x03, 0x04],
    do: Chunk.define(opcode, content, found)

  defp record(0x08, content, found) do
    with {:ok, index} <- Parse.chunk_index(content) do
      chunk = Map.merge(index, %{kind: :chunk, damaged: nil})
      {:ok, %{found | chunks: [chunk | found.chunks]}}
    end
  end

  defp record(0x0B, content, found) do
    with {:ok, statistics} <- Parse.statistics(content),
         do: {:ok, %{found | statistics: statistics}}
  end

  defp record(0x0D, <<offset::little-64, length::little-64, _name::binary>>, found),
    do: {:ok, %{found | notes: [{offset, length} | found.notes]}}

  defp record(opcode, _content, found) when opcode in [0x0A, 0x0E] or opcode > 0x0F,
    do: {:ok, found}

  defp record(_opcode, _content, _found), do: :error

  defp metadata(_source, [], notes), do: {:ok, Enum.reverse(notes)}

  defp metadata(source, [{offset, length} | others], notes) do
    with {:ok, content} <- Source.record(source, 0x0C, offset, length),
         {:ok, name, pairs} <- Parse.metadata(content),
         do: metadata(source, others, [{name, pairs} | notes])
  end
end
