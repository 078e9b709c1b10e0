defmodule Mcap.FileWriter.Output do
  @moduledoc """
  Writes to a file; or, with a limit, to a folder of numbered files. All functions return the error as one line; the
  file then ends with the last chunk that was written whole, finished if that is still possible.

  `Mcap.FileWriter` is the process around it. A process that has one already calls it from there.
  """
  alias Mcap.FileWriter.{Disk, Folder}
  alias Mcap.Writer

  @enforce_keys [:path, :file, :writer]
  defstruct @enforce_keys ++ [limit: nil, files: [], number: nil, notes: []]

  @typedoc "With a `limit`, `path` is the folder, `files` what lies there beside file `number`, and `notes` are repeated in each file."
  @type t :: %__MODULE__{
          path: Path.t(),
          file: :file.io_device(),
          writer: Writer.t(),
          limit: pos_integer() | nil,
          files: [Folder.file()],
          number: pos_integer() | nil,
          notes: [{String.t(), map()}]
        }
  @type result :: {:ok, t()} | {:error, line :: String.t()}

  # Chunks and messages are a part of a file, and files a part of the limit.
  @files 8
  @chunks 16
  @message 4
  @notes 64

  @doc """
  Opens the file, or the next one of the folder. A file that is there already is not touched; with `overwrite: true` it is
  emptied. The other options are those of `Mcap.Writer.new/1`.
  """
  @spec open(Path.t(), pos_integer() | nil, keyword()) :: result()
  def open(path, nil, options) do
    {overwrite?, options} = Keyword.pop(options, :overwrite, false)

    with {:ok, file} <- Disk.create(path, overwrite?) do
      {writer, head} = Writer.new(options)
      write(%__MODULE__{path: path, file: file, writer: writer}, writer, head, 0)
    end
  end

  def open(path, limit, options) do
    chunk_bytes = min(options[:chunk_bytes] || 0x10_0000, div(limit, @chunks))

    with {:ok, file, number, files} <- begin(path) do
      {writer, head} = Writer.new(Keyword.put(options, :chunk_bytes, chunk_bytes))

      write(
        %__MODULE__{
          path: path,
          file: file,
          writer: writer,
          limit: limit,
          files: files,
          number: number
        },
        writer,
        head,
        0
      )
    end
  end

  # Another process, such as the recorder before this one, may have begun that file meanwhile.
  defp begin(path, tried \\ 0) do
    with {:ok, files} <- Disk.named(Folder.list(path), path) do
      number = Folder.next(files)

      case Disk.create(Path.join(path, Folder.name(number))) do
        {:ok, file} -> {:ok, file, number, files}
        {:error, _taken} when number > tried -> begin(path, number)
        error -> error
      end
    end
  end

  @doc "Adds a message. One that is too large is `refused`, and nothing else changes."
  @spec message(t(), pos_integer(), non_neg_integer(), binary()) ::
          result() | {:refused, line :: String.t()}
  def message(%{limit: limit}, id, _ns, data)
      when limit != nil and byte_size(data) > div(limit, @message) do
    {:refused,
     "a message of #{byte_size(data)} bytes on channel #{id} is more than a quarter of limit_bytes, #{limit}"}
  end

  def message(t, id, ns, data) do
    {writer, iodata} = Writer.message(t.writer, id, ns, data)
    write(t, writer, iodata)
  end

  @doc "Adds a note; with a limit, all files have those of the last 64 names."
  @spec metadata(t(), String.t(), %{String.t() => String.t()}) ::
          result() | {:refused, line :: String.t()}
  def metadata(t, name, pairs) do
    {writer, iodata} = Writer.metadata(t.writer, name, pairs)
    bytes = IO.iodata_length(iodata)
    most = t.limit && div(t.limit, @message * @notes)

    if most && bytes > most,
      do: {:refused, "a note of #{bytes} bytes is more than limit_bytes allows, #{most}"},
      else: with({:ok, t} <- write(t, writer, iodata), do: {:ok, keep(t, {name, pairs})})
  end

  defp keep(%{limit: nil} = t, _note), do: t

  defp keep(t, {name, _pairs} = note),
    do: %{t | notes: Enum.take([note | List.keydelete(t.notes, name, 0)], @notes)}

  @doc "Writes the open chunk."
  @spec flush(t()) :: result()
  def flush(t) do
    {writer, iodata} = Writer.flush(t.writer)
    write(t, writer, iodata)
  end

  @doc "Ends the file."
  @spec finish(t()) :: {:ok, t()} | {:error, line :: String.t()}
  def finish(t) do
    {from, iodata} = {Writer.bytes(t.writer), Writer.finish(t.writer)}
    bytes = from + IO.iodata_length(iodata)

    with {:ok, t} <- room(t, bytes),
         {:ok, t} <- put_or_free(t, iodata, from),
         :ok <- Disk.close(t.file, name(t)) do
      {:ok, %{t | files: t.files ++ [{t.number, bytes}]}}
    else
      {:error, line} ->
        give_up(t)
        {:error, line}
    end
  end

  @doc "Writes what calls of `Mcap.Writer` returned, beginning with the writer in `writer` of this, and keeps that which they left."
  @spec write(t(), Writer.t(), iodata()) :: result()
  def write(t, writer, iodata), do: write(t, writer, iodata, nil)

  defp write(t, writer, [], _from), do: {:ok, %{t | writer: writer}}

  defp write(t, writer, iodata, from) do
    from = from || Writer.bytes(t.writer)

    with {:ok, t} <- room(t, Writer.bytes(writer) + Writer.finish_bytes(writer)),
         {:ok, t} <- put_or_free(t, iodata, from) do
      next(%{t | writer: writer})
    else
      {:error, line} ->
        give_up(t)
        {:error, line}
    end
  end

  # What was written before stays readable; the bytes of the summary mostly find room where a chunk did not.
  defp give_up(t) do
    writer = Writer.drop(t.writer)
    _cut_then = append(t, Writer.finish(writer), Writer.bytes(writer))
    _ = Disk.close(t.file, name(t))
    :ok
  end

  defp room(%{limit: nil} = t, _bytes), do: {:ok, t}

  defp room(t, bytes) do
    case Folder.surplus(t.files, bytes, t.limit) do
      {gone, kept} ->
        delete(t, gone, kept)

      :error ->
        {:error,
         "#{name(t)} cannot be written: #{bytes} bytes are more than limit_bytes, #{t.limit}"}
    end
  end

  defp delete(t, [], kept), do: {:ok, %{t | files: kept}}

  defp delete(t, [{number, _bytes} | gone], kept) do
    with :ok <- Disk.delete(Path.join(t.path, Folder.name(number))), do: delete(t, gone, kept)
  end

  # Where a disk is full before the limit is reached, the oldest files make room, too.
  defp put_or_free(t, iodata, from) do
    case {append(t, iodata, from), t.files} do
      {:ok, _files} ->
        {:ok, t}

      {{:error, _line}, [oldest | files]} ->
        with {:ok, t} <- delete(t, [oldest], files), do: put_or_free(t, iodata, from)

      {error, []} ->
        error
    end
  end

  # A file that is long enough is ended, and the next one begun.
  defp next(%{limit: nil} = t), do: {:ok, t}

  defp next(t) do
    if Writer.bytes(t.writer) < div(t.limit, @files), do: {:ok, t}, else: turn(t)
  end

  defp turn(t) do
    with {:ok, t} <- finish(t),
         {:ok, file, number, _files} <- begin(t.path) do
      {writer, head} = Writer.next(t.writer)

      {notes, writer} =
        Enum.map_reduce(Enum.reverse(t.notes), writer, fn {name, pairs}, writer ->
          {writer, note} = Writer.metadata(writer, name, pairs)
          {note, writer}
        end)

      write(%{t | file: file, number: number}, writer, [head | notes], 0)
    end
  end

  defp append(t, iodata, from), do: Disk.append(t.file, name(t), iodata, from)

  @doc "The path of the file that is written now."
  @spec name(t()) :: Path.t()
  def name(%{number: nil} = t), do: t.path
  def name(t), do: Path.join(t.path, Folder.name(t.number))
end
