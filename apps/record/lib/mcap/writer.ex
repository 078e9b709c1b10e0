defmodule Mcap.Writer do
  @moduledoc """
  Turns messages into the bytes of an MCAP file. Pure: the caller writes what it returns, in that order.

      {t, head} = Mcap.Writer.new(library: "convoy 0.1.0")
      {id, t} = Mcap.Writer.channel(t, "/mag1/pose", "json", Mcap.Foxglove.schema("foxglove.PoseInFrame"), %{})
      {t, now} = Mcap.Writer.message(t, id, ns, payload)
      rest = Mcap.Writer.finish(t)

  Messages are kept until their chunk closes: when it has `chunk_bytes` (1 MiB), when a message is `chunk_ns` (never)
  later than its first one, or by `flush/1`. Of what was written only the index is kept: some 100 bytes a chunk.
  """
  alias Mcap.Channel
  alias Mcap.Writer.{Channels, Chunk, Summary}

  @options [
    library: [{:check, &Channels.text?/1, "text"}, default: "convoy"],
    chunk_bytes: [{:integer, 1, 0x1000_0000, "bytes"}, default: 0x10_0000],
    chunk_ns: [{:integer, 1, 0xFFFF_FFFF_FFFF_FFFF, "ns"}, default: nil],
    summary_offsets: [:boolean, default: true]
  ]

  @enforce_keys [:options, :offset, :crc, :chunk, :summary]
  defstruct @enforce_keys ++ [channels: %Channels{}]

  @typedoc "`offset` is how many bytes were handed out, `crc` their checksum."
  @opaque t :: %__MODULE__{}

  @doc """
  A new file, and how it begins.

  Options: `library` (the program that writes it, `"convoy"`), `chunk_bytes` (1 MiB), `chunk_ns` (`nil`), `summary_offsets`
  (`true`; where the groups of the summary begin). Raises `ArgumentError` with one line for others.
  """
  @spec new(keyword()) :: {t(), iodata()}
  def new(options \\ []) do
    options = Map.new(Hal.Options.check!(options, @options, "recording"))
    begin(%__MODULE__{options: options, offset: 0, crc: 0, chunk: %Chunk{}, summary: %Summary{}})
  end

  @doc "One more file with the same channels under the same ids, and how it begins. The open chunk is dropped."
  @spec next(t()) :: {t(), iodata()}
  def next(t), do: begin(%{t | offset: 0, crc: 0, chunk: %Chunk{}, summary: %Summary{}})

  defp begin(t), do: hand_out(t, [Mcap.magic() | Mcap.Record.header("", t.options.library)])

  @doc """
  The id of a channel, which is registered when it is not yet. It is in the file once it has a message.

      iex> {t, _head} = Mcap.Writer.new()
      iex> {1, t} = Mcap.Writer.channel(t, "/log", "json", nil, %{})
      iex> {2, t} = Mcap.Writer.channel(t, "/poses", "json", {"Pose", "jsonschema", "{}"}, %{})
      iex> {1, _t} = Mcap.Writer.channel(t, "/log", "json", nil, %{})
  """
  @spec channel(t(), String.t(), String.t(), Channel.schema() | nil, %{String.t() => String.t()}) ::
          {id :: 1..0xFFFF, t()}
  def channel(t, topic, message_encoding, schema, metadata \\ %{}) do
    {id, channels} = Channels.register(t.channels, topic, message_encoding, schema, metadata)
    {id, %{t | channels: channels}}
  end

  @doc "Adds a message: a payload and when it was recorded. What is to be written now is mostly `[]`."
  @spec message(t(), 1..0xFFFF, log_time_ns :: non_neg_integer(), iodata()) :: {t(), iodata()}
  def message(%__MODULE__{} = t, id, ns, data) when ns in 0..0xFFFF_FFFF_FFFF_FFFF do
    {t, before} = if late?(t.chunk.first_ns, ns, t.options.chunk_ns), do: flush(t), else: {t, []}

    registered =
      Map.get(t.channels.records, id) || raise(ArgumentError, "no channel #{inspect(id)}")

    chunk = Chunk.add(t.chunk, registered, id, Summary.count(t.summary, id), ns, data)
    t = %{t | chunk: chunk}

    if chunk.bytes >= t.options.chunk_bytes do
      {t, closed} = flush(t)
      {t, [before | closed]}
    else
      {t, before}
    end
  end

  defp late?(first, ns, most), do: first != nil and most != nil and ns - first >= most

  @doc "Whether this is the id of a channel."
  @spec channel?(t(), term()) :: boolean()
  def channel?(t, id), do: is_map_key(t.channels.records, id)

  @doc "Forgets the messages of the open chunk: where they cannot be written."
  @spec drop(t()) :: t()
  def drop(t), do: %{t | chunk: %Chunk{}}

  @doc "How many bytes were handed out so far."
  @spec bytes(t()) :: non_neg_integer()
  def bytes(t), do: t.offset

  @doc "Closes the open chunk, if there is one."
  @spec flush(t()) :: {t(), iodata()}
  def flush(%__MODULE__{chunk: %{bytes: 0}} = t), do: {t, []}

  def flush(t) do
    {{head, {records, crc}, indexes}, index} = Chunk.close(t.chunk, t.offset)
    summary = Summary.add_chunk(t.summary, index)
    {t, head} = hand_out(%{t | chunk: %Chunk{}, summary: summary}, head)
    # The records are most of a file, and their checksum is known.
    t = %{
      t
      | offset: t.offset + byte_size(records),
        crc: :erlang.crc32_combine(t.crc, crc, byte_size(records))
    }

    {t, indexes} = hand_out(t, indexes)
    {t, [head, records | indexes]}
  end

  @doc "Adds a note of this name: what holds for the file as a whole, such as a version. Several may have one name."
  @spec metadata(t(), String.t(), %{String.t() => String.t()}) :: {t(), iodata()}
  def metadata(t, name, pairs) do
    record =
      IO.iodata_to_binary(Mcap.Record.metadata(Channels.text!(name), Channels.pairs!(pairs)))

    summary = Summary.add_metadata(t.summary, name, t.offset, byte_size(record))
    hand_out(%{t | summary: summary}, record)
  end

  @doc "The end of the file: the open chunk, and the summary, by which readers find every chunk."
  @spec finish(t()) :: iodata()
  def finish(t) do
    {t, chunk} = flush(t)
    {t, data_end} = hand_out(t, Mcap.Record.data_end(t.crc))
    summary = Summary.bytes(t.summary, t.channels.records, t.offset, t.options.summary_offsets)
    [chunk, data_end, summary | Mcap.magic()]
  end

  @doc "How many bytes `finish/1` has without the open chunk; at most, when there are no summary offsets."
  @spec finish_bytes(t()) :: non_neg_integer()
  def finish_bytes(t), do: 13 + Summary.most_bytes(t.summary, t.channels.records) + 8

  defp hand_out(t, iodata) do
    t = %{
      t
      | offset: t.offset + IO.iodata_length(iodata),
        crc: :erlang.crc32(t.crc, iodata)
    }

    {t, iodata}
  end
end
