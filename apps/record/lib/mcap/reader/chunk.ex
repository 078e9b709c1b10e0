defmodule Mcap.Reader.Chunk do
  @moduledoc "Turns the bytes of a chunk into its messages, after they were checked. Pure."
  alias Mcap.Record.Parse

  @typedoc "`place` is where the message is in the file, which decides between equal times."
  @type message ::
          {{log_time_ns :: non_neg_integer(), place :: non_neg_integer()}, Mcap.Channel.t(),
           data :: binary()}

  @type decoded :: %{
          schemas: %{pos_integer() => Mcap.Channel.schema()},
          channels: %{non_neg_integer() => Mcap.Channel.t()},
          messages: [message()]
        }

  @doc """
  The messages of a chunk record's content that lies at `place` of the file. `known` has the schemas and channels of
  the file. The error says what is wrong; `{:compression, name}` is a chunk that only other readers open.
  """
  @spec decode(binary(), non_neg_integer(), map()) ::
          {:ok, decoded()} | {:error, text :: String.t() | {:compression, String.t()}}
  def decode(content, place, known) do
    with {:ok, head} <- Parse.chunk_head(content),
         :ok <- plain(head.compression),
         <<bytes::little-64, records::binary-size(bytes), _more::binary>> <- head.records,
         true <- bytes == head.bytes,
         {:crc, true} <- {:crc, head.crc in [0, :erlang.crc32(records)]} do
      run(records, place + byte_size(content) - byte_size(head.records) + 8, known)
    else
      {:error, reason} -> {:error, reason}
      {:crc, false} -> {:error, "its checksum is wrong"}
      _no -> {:error, "its lengths do not fit"}
    end
  end

  # Damage must not pass for a foreign compression: all names that there are, are short words.
  defp plain(""), do: :ok

  defp plain(name) do
    if String.match?(name, ~r/\A[a-z0-9]{1,16}\z/),
      do: {:error, {:compression, name}},
      else: {:error, "its lengths do not fit"}
  end

  @doc "The same for schemas, channels and messages one behind the other, not compressed, from this place on."
  @spec run(binary(), non_neg_integer(), map()) :: {:ok, decoded()} | {:error, String.t()}
  def run(records, place, known) do
    known = Map.take(known, [:schemas, :channels])
    records(records, place, Map.put(known, :messages, []))
  end

  defp records(<<>>, _place, decoded),
    do: {:ok, %{decoded | messages: Enum.reverse(decoded.messages)}}

  defp records(bytes, place, decoded) do
    with {:ok, opcode, content, rest} <- Parse.record(bytes),
         {:ok, decoded} <- record(opcode, content, place, decoded) do
      records(rest, place + byte_size(content) + 9, decoded)
    else
      _no -> {:error, "the record at byte #{place} cannot be read"}
    end
  end

  defp record(
         0x05,
         <<id::little-16, _sequence::little-32, ns::little-64, _sent::64, data::binary>>,
         place,
         decoded
       ) do
    with {:ok, channel} <- Map.fetch(decoded.channels, id),
         do: {:ok, %{decoded | messages: [{{ns, place}, channel, data} | decoded.messages]}}
  end

  defp record(opcode, content, _place, decoded) when opcode in [0x03, 0x04],
    do: define(opcode, content, decoded)

  defp record(opcode, _content, _place, decoded) when opcode > 0x0F, do: {:ok, decoded}
  defp record(_opcode, _content, _place, _decoded), do: :error

  @doc "Adds the schema or channel of a record's content to those that are known. The first of an id holds."
  @spec define(3 | 4, binary(), known) :: {:ok, known} | :error when known: map()
  def define(0x03, content, known) do
    with {:ok, id, schema} <- Parse.schema(content),
         do: {:ok, %{known | schemas: Map.put_new(known.schemas, id, schema)}}
  end

  def define(0x04, content, known) do
    with {:ok, channel} <- Parse.channel(content, known.schemas),
         do: {:ok, %{known | channels: Map.put_new(known.channels, channel.id, channel)}}
  end
end
