defmodule Mcap.Writer.Chunk do
  @moduledoc false
  # Holds the open chunk of a writer: the records of some messages, to be written as one. Pure.
  #
  # It holds the schema and the channel of its messages itself, so that a whole chunk can be read alone.

  defstruct records: [],
            bytes: 0,
            start_ns: nil,
            end_ns: nil,
            first_ns: nil,
            schemas: %{},
            index: %{}

  @type t :: %__MODULE__{
          records: iodata(),
          bytes: non_neg_integer(),
          start_ns: non_neg_integer() | nil,
          end_ns: non_neg_integer() | nil,
          first_ns: non_neg_integer() | nil,
          schemas: %{non_neg_integer() => true},
          index: %{non_neg_integer() => {non_neg_integer(), [binary()]}}
        }

  @doc """
  Adds a message; `registered` is its channel's schema id with both records, `{schema_id, schema, channel}`, and
  `before` is how many messages the channel has in earlier chunks.
  """
  @spec add(t(), tuple(), non_neg_integer(), non_neg_integer(), non_neg_integer(), iodata()) ::
          t()
  def add(chunk, registered, id, before, time_ns, data) do
    chunk = if is_map_key(chunk.index, id), do: chunk, else: introduce(chunk, registered, id)
    data = IO.iodata_to_binary(data)
    bytes = byte_size(data)
    entry = <<time_ns::little-64, chunk.bytes::little-64>>
    %{^id => {count, entries}} = chunk.index

    %{
      chunk
      | records: [
          chunk.records,
          Mcap.Record.message_head(id, before + count, time_ns, bytes) | data
        ],
        bytes: chunk.bytes + 31 + bytes,
        # `nil`, an atom, is above all numbers.
        start_ns: min(chunk.start_ns, time_ns),
        end_ns: if(chunk.end_ns, do: max(chunk.end_ns, time_ns), else: time_ns),
        first_ns: chunk.first_ns || time_ns,
        index: %{chunk.index | id => {count + 1, [entry | entries]}}
    }
  end

  defp introduce(chunk, {schema_id, schema, channel}, id) do
    schema = if is_map_key(chunk.schemas, schema_id), do: [], else: schema
    bytes = IO.iodata_length(schema) + IO.iodata_length(channel)

    %{
      chunk
      | records: [chunk.records, schema | channel],
        bytes: chunk.bytes + bytes,
        schemas: Map.put(chunk.schemas, schema_id, true),
        index: Map.put(chunk.index, id, {0, []})
    }
  end

  @doc """
  Its head, its records with their checksum, and the indexes of its messages, in this order, for this place of the
  file; and its line in the file's index.
  """
  @spec close(t(), offset :: non_neg_integer()) ::
          {{head :: iodata(), {records :: binary(), crc :: non_neg_integer()},
            indexes :: iodata()}, index :: map()}
  def close(chunk, offset) do
    records = IO.iodata_to_binary(chunk.records)
    crc = :erlang.crc32(records)
    head = Mcap.Record.chunk_head(chunk.start_ns, chunk.end_ns, chunk.bytes, crc)
    length = byte_size(head) + chunk.bytes

    {indexes, {places, behind}} =
      chunk.index
      |> Enum.sort()
      |> Enum.map_reduce({[], offset + length}, fn {id, {_count, entries}}, {places, place} ->
        index = Mcap.Record.message_index(id, Enum.reverse(entries))
        {index, {[{id, place} | places], place + IO.iodata_length(index)}}
      end)

    {{head, {records, crc}, indexes},
     %{
       start_ns: chunk.start_ns,
       end_ns: chunk.end_ns,
       offset: offset,
       length: length,
       counts: Map.new(chunk.index, fn {id, {count, _entries}} -> {id, count} end),
       message_indexes: places,
       message_index_length: behind - offset - length,
       bytes: chunk.bytes
     }}
  end
end
