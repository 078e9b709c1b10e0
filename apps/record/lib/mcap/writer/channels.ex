defmodule Mcap.Writer.Channels do
  @moduledoc "Holds the channels and schemas that a writer has: their ids, counted from 1, and their records. Pure."
  alias Mcap.Channel

  defstruct ids: %{}, schema_ids: %{}, records: %{}

  @typedoc "What was registered by what it is, and `{schema_id, schema, channel}` by the id of a channel."
  @type t :: %__MODULE__{ids: map(), schema_ids: map(), records: %{(1..0xFFFF) => record()}}
  @type record :: {0..0xFFFF, schema :: binary(), channel :: binary()}

  @doc "The id of a channel, registered if it is new. Raises `ArgumentError` for what is no text, and for too many."
  @spec register(t(), String.t(), String.t(), Channel.schema() | nil, map()) :: {1..0xFFFF, t()}
  def register(channels, topic, message_encoding, schema, metadata) do
    key = {topic, message_encoding, schema, metadata}

    case channels.ids do
      %{^key => id} -> {id, channels}
      _new -> add(channels, key)
    end
  end

  defp add(channels, {topic, message_encoding, schema, metadata} = key) do
    {schema_id, channels} = schema_id(channels, schema)
    id = fresh(map_size(channels.ids), "channels")

    channel = %Channel{
      id: id,
      topic: text!(topic),
      message_encoding: text!(message_encoding),
      schema: schema,
      metadata: pairs!(metadata)
    }

    # Binaries, because chunk after chunk repeats them.
    record = {
      schema_id,
      if(schema, do: IO.iodata_to_binary(Mcap.Record.schema(schema_id, schema)), else: ""),
      IO.iodata_to_binary(Mcap.Record.channel(channel, schema_id))
    }

    {ids, records} = {Map.put(channels.ids, key, id), Map.put(channels.records, id, record)}
    {id, %{channels | ids: ids, records: records}}
  end

  defp schema_id(channels, nil), do: {0, channels}

  defp schema_id(channels, {name, encoding, data} = schema) when is_binary(data) do
    case channels.schema_ids do
      %{^schema => id} ->
        {id, channels}

      _new ->
        _ = {text!(name), text!(encoding)}
        id = fresh(map_size(channels.schema_ids), "schemas")
        {id, %{channels | schema_ids: Map.put(channels.schema_ids, schema, id)}}
    end
  end

  defp schema_id(_channels, other),
    do: raise(ArgumentError, "no schema: #{inspect(other)}: {name, encoding, data} or nil is one")

  defp fresh(count, _what) when count < 0xFFFF, do: count + 1
  defp fresh(count, what), do: raise(ArgumentError, "a file has room for #{count} #{what}")

  @doc "Whether this is text."
  @spec text?(term()) :: boolean()
  def text?(text), do: is_binary(text) and String.valid?(text)

  @doc "The same text, or an `ArgumentError`."
  @spec text!(term()) :: String.t()
  def text!(text) do
    if text?(text), do: text, else: raise(ArgumentError, "not UTF-8 text: #{inspect(text)}")
  end

  @doc "The same texts, or an `ArgumentError`."
  @spec pairs!(map()) :: %{String.t() => String.t()}
  def pairs!(pairs) when is_map(pairs) do
    for {key, value} <- pairs, do: {text!(key), text!(value)}
    pairs
  end
end
