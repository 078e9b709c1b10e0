defmodule Mcap.Writer.Summary do
  @moduledoc "Remembers what a writer wrote, and the end of the file that is made of it. Pure."

  defstruct counts: %{}, start_ns: nil, end_ns: nil, chunks: {0, []}, metadata: {0, []}, bytes: 0

  @typedoc "Messages by channel; index records with their number, newest first, and how many bytes these have."
  @type t :: %__MODULE__{
          counts: %{non_neg_integer() => pos_integer()},
          start_ns: non_neg_integer() | nil,
          end_ns: non_neg_integer() | nil,
          chunks: {non_neg_integer(), [binary()]},
          metadata: {non_neg_integer(), [binary()]},
          bytes: non_neg_integer()
        }

  @doc "How many messages of a channel were written."
  @spec count(t(), non_neg_integer()) :: non_neg_integer()
  def count(summary, id), do: Map.get(summary.counts, id, 0)

  @doc "Adds a chunk that was written."
  @spec add_chunk(t(), map()) :: t()
  def add_chunk(summary, index) do
    record = IO.iodata_to_binary(Mcap.Record.chunk_index(index))
    {n, records} = summary.chunks

    %{
      summary
      | chunks: {n + 1, [record | records]},
        counts: Map.merge(summary.counts, index.counts, fn _id, a, b -> a + b end),
        bytes: summary.bytes + byte_size(record),
        start_ns: min(summary.start_ns, index.start_ns),
        end_ns: max(summary.end_ns || 0, index.end_ns)
    }
  end

  @doc "Adds a note that was written at this place, with this length."
  @spec add_metadata(t(), String.t(), non_neg_integer(), pos_integer()) :: t()
  def add_metadata(summary, name, offset, length) do
    record = IO.iodata_to_binary(Mcap.Record.metadata_index(offset, length, name))
    {n, records} = summary.metadata
    bytes = summary.bytes + byte_size(record)
    %{summary | metadata: {n + 1, [record | records]}, bytes: bytes}
  end

  @doc "The summary, which begins at this place of the file, and the footer."
  @spec bytes(t(), map(), non_neg_integer(), boolean()) :: iodata()
  def bytes(summary, registered, start, offsets?) do
    groups =
      for {opcode, records} <- groups(summary, registered),
          length = IO.iodata_length(records),
          length > 0,
          do: {opcode, length, records}

    {offsets, behind} =
      Enum.map_reduce(groups, start, fn {opcode, length, _records}, place ->
        {Mcap.Record.summary_offset(opcode, place, length), place + length}
      end)

    {offsets, offsets_start} = if offsets?, do: {offsets, behind}, else: {[], 0}

    covered = [
      for({_opcode, _length, records} <- groups, do: records),
      offsets,
      <<0x02, 20::little-64, start::little-64, offsets_start::little-64>>
    ]

    [covered, <<:erlang.crc32(covered)::little-32>>]
  end

  @doc "How many bytes that has at most."
  @spec most_bytes(t(), map()) :: non_neg_integer()
  def most_bytes(summary, registered) do
    [{0x03, schemas}, {0x04, channels}, {0x0B, statistics} | _indexes] =
      groups(%{summary | chunks: {0, []}, metadata: {0, []}}, registered)

    IO.iodata_length([schemas, channels, statistics]) + summary.bytes + 5 * 26 + 29
  end

  defp groups(summary, registered) do
    used = for {id, _n} <- Enum.sort(summary.counts), do: {id, Map.fetch!(registered, id)}

    schemas =
      for({_id, {schema_id, record, _}} <- used, schema_id > 0, do: {schema_id, record})
      |> Enum.uniq()
      |> Enum.sort()

    {chunks, chunk_indexes} = summary.chunks
    {metadata, metadata_indexes} = summary.metadata

    statistics = %{
      counts: summary.counts,
      schemas: length(schemas),
      channels: length(used),
      metadata: metadata,
      chunks: chunks,
      start_ns: summary.start_ns || 0,
      end_ns: summary.end_ns || 0
    }

    [
      {0x03, for({_id, record} <- schemas, do: record)},
      {0x04, for({_id, {_schema_id, _schema, record}} <- used, do: record)},
      {0x0B, Mcap.Record.statistics(statistics)},
      {0x08, Enum.reverse(chunk_indexes)},
      {0x0D, Enum.reverse(metadata_indexes)}
    ]
  end
end
