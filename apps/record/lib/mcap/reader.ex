defmodule Mcap.Reader do
  @moduledoc """
  Reads MCAP files without compression: a whole one by its summary; one that was cut, by a `kill -9` or a full disk,
  by scanning it as far as its last whole chunk.

      {:ok, recording} = Mcap.Reader.open("run.mcap")
      recording |> Mcap.Reader.messages(topics: ["/mag1/pose"]) |> Enum.take(10)

  A file may be anybody's. What is wrong with it as a whole, is an error of `open/1`. A damaged chunk in the middle is
  found when its turn comes: then taking messages raises `Mcap.DamagedError`, whose message is one line; with
  `damaged: :skip` its messages are left out. All messages that are returned had the right checksum, if the writer
  wrote one.
  """
  alias Mcap.Channel
  alias Mcap.Reader.{Index, Merge, Scan, Source}
  alias Mcap.Record.Parse

  @options [
    topics: [{:or, :all, {:list, {:check, &is_binary/1, "a topic"}, 65_535}}, default: :all],
    from_ns: [{:integer, 0, 0xFFFF_FFFF_FFFF_FFFF, "ns"}, default: 0],
    to_ns: [{:or, :infinity, {:integer, 0, 0xFFFF_FFFF_FFFF_FFFF, "ns"}}, default: :infinity],
    damaged: [{:one_of, [:raise, :skip]}, default: :raise]
  ]

  @enforce_keys [:path, :found, :summary]
  defstruct @enforce_keys

  @opaque t :: %__MODULE__{}

  @typedoc """
  `counts` has the messages by channel, `count` all; `start_ns` and `end_ns` are the times of the first and the last,
  0 when there is none. `metadata` are the notes in the order of the file. `whole?` is whether the file ends as a
  finished one does; `cut_at` the offset from which on nothing could be read, `nil` when all was.
  """
  @type summary :: %{
          channels: [Channel.t()],
          counts: %{(channel_id :: 0..0xFFFF) => non_neg_integer()},
          count: non_neg_integer(),
          start_ns: non_neg_integer(),
          end_ns: non_neg_integer(),
          metadata: [{name :: String.t(), %{String.t() => String.t()}}],
          library: String.t(),
          bytes: non_neg_integer(),
          chunks: non_neg_integer(),
          whole?: boolean(),
          cut_at: non_neg_integer() | nil
        }

  @typedoc "`data` is part of a whole chunk, which stays in memory with it: to keep it, copy it (`:binary.copy/1`)."
  @type message ::
          {topic :: String.t(), Channel.t(), log_time_ns :: non_neg_integer(), data :: binary()}

  @doc "Opens a recording. The error is one line that names the file."
  @spec open(Path.t()) :: {:ok, t()} | {:error, line :: String.t()}
  def open(path) do
    with {:ok, source} <- Source.open(path) do
      result = read(source, path)
      Source.close(source)
      result
    end
  end

  defp read(source, path) do
    with :ok <- magic(source, path),
         {:ok, library} <- library(source, path),
         whole? = Source.size(source) >= 16 and ends_with_magic?(source),
         {:ok, found} <- find(source, path, whole?),
         :ok <- plain(found.chunks, path) do
      channels = found.channels |> Map.values() |> Enum.sort_by(& &1.id)

      summary =
        found
        |> Map.take([:counts, :count, :start_ns, :end_ns, :metadata, :cut_at])
        |> Map.merge(%{channels: channels, library: library, whole?: whole?})
        |> Map.merge(%{bytes: Source.size(source), chunks: length(found.chunks)})

      {:ok, %__MODULE__{path: path, found: found, summary: summary}}
    end
  end

  defp magic(source, path) do
    magic = Mcap.magic()

    case Source.read(source, 0, min(8, Source.size(source))) do
      {:ok, ^magic} ->
        :ok

      {:ok, bytes} when bytes == binary_part(magic, 0, byte_size(bytes)) ->
        {:error, "#{path} has no messages: it ends within its first 8 bytes"}

      _other ->
        {:error, "#{path} is not an MCAP file of version 0: it does not begin like one"}
    end
  end

  defp ends_with_magic?(source),
    do: Source.read(source, Source.size(source) - 8, 8) == {:ok, Mcap.magic()}

  defp library(source, path) do
    with {:ok, 0x01, length} <- Source.head(source, 8),
         {:ok, content} <- Source.record(source, 0x01, 8, length),
         {:ok, _profile, library} <- Parse.header(content) do
      {:ok, library}
    else
      _no -> {:error, "#{path} has no messages: its header is cut or damaged"}
    end
  end

  defp find(source, path, whole?) do
    with :error <- if(whole?, do: Index.read(source), else: :error),
         {:error, {:compression, name}} <- Scan.read(source, whole?) do
      {:error, compressed(path, name)}
    else
      {:ok, found} -> {:ok, Map.put_new(found, :cut_at, nil)}
    end
  end

  defp plain(chunks, path) do
    case Enum.find(chunks, &(Map.get(&1, :compression, "") != "")) do
      nil -> :ok
      %{compression: name} -> {:error, compressed(path, name)}
    end
  end

  defp compressed(path, name) do
    name = if String.printable?(name), do: name, else: inspect(name)
    "#{path} is compressed with #{name}: only files without compression can be read"
  end

  @doc "What the recording has, as far as it could be read."
  @spec summary(t()) :: summary()
  def summary(%__MODULE__{summary: summary}), do: summary

  @doc """
  The messages in order of log time, those of equal time in the order of the file; read chunk by chunk while they are
  taken. Options: `topics` (`:all` or a list), `from_ns` (included), `to_ns` (no longer included, or `:infinity`),
  `damaged` (`:raise` or `:skip`). Raises `ArgumentError` for others, `Mcap.DamagedError` while they are taken.
  """
  @spec messages(t(), keyword()) :: Enumerable.t()
  def messages(%__MODULE__{} = t, options \\ []) do
    query = Map.new(Hal.Options.check!(options, @options, "recording"))
    topics = if query.topics == :all, do: :all, else: MapSet.new(query.topics)

    Merge.stream(
      Map.merge(query, %{path: t.path, known: t.found, chunks: t.found.chunks, topics: topics})
    )
  end
end
