defmodule Mcap.Record do
  @moduledoc """
  Encodes the records of an MCAP file as bytes: an opcode, the length of the content, the content. Pure;
  `Mcap.Record.Parse` is the other direction.
  """

  @u32 0xFFFF_FFFF

  @doc """
  A record of this opcode.

      iex> Mcap.Record.frame(0x0F, <<7, 0, 0, 0>>) |> IO.iodata_to_binary()
      <<0x0F, 4, 0, 0, 0, 0, 0, 0, 0, 7, 0, 0, 0>>
  """
  @spec frame(byte(), iodata()) :: iodata()
  def frame(opcode, content),
    do: [<<opcode, IO.iodata_length(content)::little-64>> | content]

  @doc false
  @spec header(String.t(), String.t()) :: iodata()
  def header(profile, library), do: frame(0x01, [text(profile), text(library)])

  @doc false
  @spec schema(pos_integer(), Mcap.Channel.schema()) :: iodata()
  def schema(id, {name, encoding, data}),
    do: frame(0x03, [<<id::little-16>>, text(name), text(encoding), text(data)])

  @doc false
  @spec channel(Mcap.Channel.t(), non_neg_integer()) :: iodata()
  def channel(channel, schema_id) do
    frame(0x04, [
      <<channel.id::little-16, schema_id::little-16>>,
      text(channel.topic),
      text(channel.message_encoding),
      texts(channel.metadata)
    ])
  end

  @doc "The bytes of a message before its payload, which has this many bytes."
  @spec message_head(non_neg_integer(), non_neg_integer(), non_neg_integer(), non_neg_integer()) ::
          binary()
  def message_head(channel_id, sequence, time_ns, bytes) do
    <<0x05, bytes + 22::little-64, channel_id::little-16, sequence::little-32, time_ns::little-64,
      time_ns::little-64>>
  end

  @doc "The bytes of a chunk before its records, which are not compressed."
  @spec chunk_head(non_neg_integer(), non_neg_integer(), non_neg_integer(), non_neg_integer()) ::
          binary()
  def chunk_head(start_ns, end_ns, bytes, crc) do
    <<0x06, bytes + 40::little-64, start_ns::little-64, end_ns::little-64, bytes::little-64,
      crc::little-32, 0::little-32, bytes::little-64>>
  end

  @doc false
  @spec message_index(non_neg_integer(), [binary()]) :: iodata()
  def message_index(channel_id, entries),
    do: frame(0x07, [<<channel_id::little-16, 16 * length(entries)::little-32>> | entries])

  @doc false
  @spec chunk_index(map()) :: iodata()
  def chunk_index(index) do
    frame(0x08, [
      <<index.start_ns::little-64, index.end_ns::little-64, index.offset::little-64,
        index.length::little-64>>,
      numbers(index.message_indexes),
      <<index.message_index_length::little-64, 0::little-32, index.bytes::little-64,
        index.bytes::little-64>>
    ])
  end

  @doc false
  @spec statistics(map()) :: iodata()
  def statistics(statistics) do
    count = statistics.counts |> Enum.map(&elem(&1, 1)) |> Enum.sum()

    frame(0x0B, [
      <<count::little-64, statistics.schemas::little-16, statistics.channels::little-32,
        0::little-32, statistics.metadata::little-32, statistics.chunks::little-32,
        statistics.start_ns::little-64, statistics.end_ns::little-64>>,
      numbers(statistics.counts)
    ])
  end

  @doc false
  @spec metadata(String.t(), %{String.t() => String.t()}) :: iodata()
  def metadata(name, pairs), do: frame(0x0C, [text(name), texts(pairs)])

  @doc false
  @spec metadata_index(non_neg_integer(), non_neg_integer(), String.t()) :: iodata()
  def metadata_index(offset, length, name),
    do: frame(0x0D, [<<offset::little-64, length::little-64>>, text(name)])

  @doc false
  @spec summary_offset(byte(), non_neg_integer(), non_neg_integer()) :: iodata()
  def summary_offset(opcode, start, length),
    do: frame(0x0E, <<opcode, start::little-64, length::little-64>>)

  @doc false
  @spec data_end(non_neg_integer()) :: iodata()
  def data_end(crc), do: frame(0x0F, <<crc::little-32>>)

  @doc """
  A text behind its length in bytes.

      iex> Mcap.Record.text("ü") |> IO.iodata_to_binary()
      <<2, 0, 0, 0, 0xC3, 0xBC>>
  """
  @spec text(binary()) :: iodata()
  def text(text) when byte_size(text) <= @u32, do: [<<byte_size(text)::little-32>>, text]

  # Sorted: the same map gives the same bytes.
  defp texts(pairs), do: block(for {key, value} <- Enum.sort(pairs), do: [text(key), text(value)])

  defp numbers(pairs),
    do: block(for {id, n} <- Enum.sort(pairs), do: <<id::little-16, n::little-64>>)

  # The length of a map or array is in bytes, not in entries.
  defp block(entries), do: [<<IO.iodata_length(entries)::little-32>> | entries]
end
