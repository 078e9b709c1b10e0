defmodule Mcap.Record.Parse do
  @moduledoc false
  # Parses the bytes of an MCAP file into records: the other direction of `Mcap.Record`. Pure, and for bytes of anybody: a
  # length that does not fit is `:error`, and nothing is allocated for it. Bytes behind the known fields are ignored.

  @doc """
  The first record of some bytes.

      iex> Mcap.Record.Parse.record(<<0x0F, 4, 0, 0, 0, 0, 0, 0, 0, 7, 0, 0, 0, "rest">>)
      {:ok, 0x0F, <<7, 0, 0, 0>>, "rest"}
      iex> Mcap.Record.Parse.record(<<0x0F, 255, 255, 255, 255, 255, 255, 255, 255, 7>>)
      :error
  """
  @spec record(binary()) :: {:ok, byte(), content :: binary(), rest :: binary()} | :error
  def record(<<opcode, length::little-64, content::binary-size(length), rest::binary>>),
    do: {:ok, opcode, content, rest}

  def record(_bytes), do: :error

  @doc false
  @spec header(binary()) :: {:ok, profile :: String.t(), library :: String.t()} | :error
  def header(content) do
    with {:ok, profile, rest} <- text(content),
         {:ok, library, _rest} <- text(rest),
         do: {:ok, profile, library}
  end

  @doc false
  @spec schema(binary()) :: {:ok, pos_integer(), Mcap.Channel.schema()} | :error
  def schema(<<id::little-16, rest::binary>>) when id > 0 do
    with {:ok, name, rest} <- text(rest),
         {:ok, encoding, rest} <- text(rest),
         {:ok, data, _rest} <- bytes(rest),
         do: {:ok, id, {name, encoding, :binary.copy(data)}}
  end

  def schema(_content), do: :error

  @doc "A channel by the schemas that are known; one that is not is an error."
  @spec channel(binary(), %{pos_integer() => Mcap.Channel.schema()}) ::
          {:ok, Mcap.Channel.t()} | :error
  def channel(<<id::little-16, schema_id::little-16, rest::binary>>, schemas)
      when schema_id == 0 or is_map_key(schemas, schema_id) do
    with {:ok, topic, rest} <- text(rest),
         {:ok, encoding, rest} <- text(rest),
         {:ok, metadata, _rest} <- texts(rest) do
      {:ok,
       %Mcap.Channel{
         id: id,
         topic: topic,
         message_encoding: encoding,
         schema: schemas[schema_id],
         metadata: metadata
       }}
    end
  end

  def channel(_content, _schemas), do: :error

  @doc false
  @spec chunk_head(binary()) :: {:ok, map()} | :error
  def chunk_head(
        <<start_ns::little-64, end_ns::little-64, bytes::little-64, crc::little-32, rest::binary>>
      ) do
    with {:ok, compression, rest} <- bytes(rest) do
      {:ok,
       %{
         start_ns: start_ns,
         end_ns: end_ns,
         bytes: bytes,
         crc: crc,
         compression: compression,
         records: rest
       }}
    end
  end

  def chunk_head(_content), do: :error

  @doc false
  @spec chunk_index(binary()) :: {:ok, map()} | :error
  def chunk_index(
        <<start_ns::little-64, end_ns::little-64, offset::little-64, length::little-64,
          n::little-32, places::binary-size(n), _indexes::little-64, rest::binary>>
      )
      when rem(n, 10) == 0 do
    with {:ok, compression, _rest} <- bytes(rest) do
      {:ok,
       %{
         start_ns: start_ns,
         end_ns: end_ns,
         offset: offset,
         length: length,
         channels: for(<<id::little-16, _place::little-64 <- places>>, do: id),
         compression: compression
       }}
    end
  end

  def chunk_index(_content), do: :error

  @doc false
  @spec statistics(binary()) :: {:ok, map()} | :error
  def statistics(
        <<count::little-64, _schemas::little-16, channels::little-32, _attachments::little-32,
          metadata::little-32, chunks::little-32, start_ns::little-64, end_ns::little-64,
          n::little-32, counts::binary-size(n), _rest::binary>>
      )
      when rem(n, 10) == 0 do
    {:ok,
     %{
       count: count,
       channels: channels,
       metadata: metadata,
       chunks: chunks,
       start_ns: start_ns,
       end_ns: end_ns,
       counts: for(<<id::little-16, n::little-64 <- counts>>, into: %{}, do: {id, n})
     }}
  end

  def statistics(_content), do: :error

  @doc false
  @spec metadata(binary()) :: {:ok, String.t(), %{String.t() => String.t()}} | :error
  def metadata(content) do
    with {:ok, name, rest} <- text(content),
         {:ok, pairs, _rest} <- texts(rest),
         do: {:ok, name, pairs}
  end

  defp bytes(<<n::little-32, bytes::binary-size(n), rest::binary>>), do: {:ok, bytes, rest}
  defp bytes(_bytes), do: :error

  # Copied: what is known of a file must not keep its chunks in memory.
  defp text(bytes) do
    with {:ok, text, rest} <- bytes(bytes),
         do: if(String.valid?(text), do: {:ok, :binary.copy(text), rest}, else: :error)
  end

  defp texts(bytes) do
    with {:ok, block, _rest} <- bytes(bytes),
         {:ok, pairs} <- pairs(block, []),
         do: {:ok, Map.new(pairs), <<>>}
  end

  defp pairs(<<>>, pairs), do: {:ok, pairs}

  defp pairs(block, pairs) do
    with {:ok, key, rest} <- text(block),
         {:ok, value, rest} <- text(rest),
         do: pairs(rest, [{key, value} | pairs])
  end
end
