defmodule Robot.Recorder.Output do
  @moduledoc false
  # Writes a recorder's file with its channels: what is written of the entries of a second. The errors are those of
  # `Mcap.FileWriter`, one line each.
  alias Mcap.FileWriter
  alias Robot.{Recording, Replay}
  alias Robot.Recording.Topics

  @enforce_keys [:writer, :channels, :file, :robots, :topics]
  defstruct @enforce_keys

  @typedoc "`file` is the one that is written now; `robots` what it says of them."
  @type t :: %__MODULE__{
          writer: pid(),
          channels: %{term() => pos_integer()},
          file: Path.t(),
          robots: Recording.robots(),
          topics: Topics.t()
        }
  @type picture :: {robot :: atom(), Vision.View.Picture.t()}
  @type result :: {:ok, t()} | {:error, line :: String.t()}

  @doc """
  Opens a file, or the next one of a folder (options of `Mcap.FileWriter`), for these robots, with
  pictures or without.
  """
  @spec open(keyword(), [atom()], pictures? :: boolean()) :: result()
  def open(options, ids, pictures?) do
    {:ok, writer} = FileWriter.start_link(options)
    {robots, trace, encoding} = Recording.topics()

    topics =
      for(topic <- [robots, trace], do: {topic, topic, encoding, nil}) ++
        for {key, topic, schema} <- Topics.list(ids, pictures?), do: {key, topic, "json", schema}

    with :ok <- FileWriter.metadata(writer, "convoy", Recording.metadata(ids)),
         {:ok, channels} <- channels(writer, topics, %{}),
         {:ok, file} <- FileWriter.file(writer) do
      {:ok,
       %__MODULE__{
         writer: writer,
         channels: channels,
         file: file,
         robots: %{},
         topics: %Topics{pictures?: pictures?}
       }}
    else
      {:error, line} ->
        end_writer(writer)
        {:error, line}
    end
  end

  defp channels(_writer, [], channels), do: {:ok, channels}

  defp channels(writer, [{key, topic, encoding, schema} | rest], channels) do
    with {:ok, id} <- FileWriter.channel(writer, topic, encoding, schema),
         do: channels(writer, rest, Map.put(channels, key, id))
  end

  @doc """
  Writes the entries and the pictures of the last second, at a time in ns since 1970, and puts them on
  the disk. `turned?` says whether a new file of the folder was begun, which has no states yet.
  """
  @spec write(t(), [Replay.entry()], [picture()], Recording.robots(), ns :: non_neg_integer()) ::
          {:ok, t(), turned? :: boolean()} | {:error, line :: String.t()}
  def write(%__MODULE__{} = output, entries, pictures, robots, ns) do
    {about, trace, _encoding} = Recording.topics()
    {said, topics} = Enum.flat_map_reduce(entries, output.topics, &said(&1, &2, robots))
    shown = Enum.flat_map(pictures, &picture(&1, robots))

    # What viewers read is in the order of its times; clocks are read in ms, and differ by some.
    ns =
      for {key, at_ns, data} <- Enum.sort_by(said ++ shown, &elem(&1, 1)), reduce: ns do
        ns ->
          message(output, key, at_ns, data)
          max(ns, at_ns)
      end

    if output.robots != robots, do: message(output, about, ns, Recording.robots(robots))
    if entries != [], do: message(output, trace, ns, Recording.trace(entries, robots))

    with :ok <- FileWriter.flush(output.writer),
         {:ok, file} <- FileWriter.file(output.writer) do
      turned? = file != output.file
      known = if turned?, do: %{}, else: robots
      {:ok, %{output | file: file, robots: known, topics: topics}, turned?}
    end
  end

  # Nothing is shown of a robot whose clock is not known yet.
  defp said({id, entry}, topics, robots) do
    case robots do
      %{^id => %{offset_ms: offset_ms}} when offset_ms != nil ->
        {topics, messages} = Topics.entry(topics, id, entry, offset_ms)
        {messages, topics}

      _unknown ->
        {[], topics}
    end
  end

  defp picture({id, picture}, robots) do
    case robots do
      %{^id => %{offset_ms: offset_ms}} when offset_ms != nil ->
        [Topics.picture(id, picture, offset_ms)]

      _unknown ->
        []
    end
  end

  defp message(output, key, ns, data),
    do: FileWriter.message(output.writer, Map.fetch!(output.channels, key), ns, data)

  @doc "Ends the file."
  @spec close(t()) :: :ok | {:error, line :: String.t()}
  def close(%__MODULE__{writer: writer}), do: FileWriter.close(writer)

  @doc "Gives the file up: its disk is full, or hangs."
  @spec abandon(t()) :: :ok
  def abandon(%__MODULE__{writer: writer}), do: end_writer(writer)

  # It may hang in a call to the disk, which nothing ends.
  defp end_writer(writer) do
    Process.unlink(writer)
    Process.exit(writer, :kill)
    :ok
  end
end
