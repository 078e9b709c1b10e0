defmodule Record.Recorder.Output do
  @moduledoc false
  # Writes a recorder's file with its channels: what is written of the entries of a second. The errors are those of
  # `Mcap.FileWriter`, one line each.
  alias Mcap.FileWriter
  alias Record.{Recording, Replay}
  alias Record.Recording.Topics

  # Two readings of a clock that stands still by the other one.
  @same_ms 100

  @enforce_keys [:writer, :keys, :topics]
  defstruct @enforce_keys ++
              [channels: %{}, file: nil, names: MapSet.new(), said: nil, question: nil]

  @typedoc """
  `file` is the one that is written now, `nil` until it is open; `names` are all that were written, `said` the robots and the names that
  the file tells. `question` is what the writer was asked and has not answered yet.
  """
  @type t :: %__MODULE__{
          writer: pid(),
          keys: [term()],
          channels: %{term() => pos_integer()},
          file: Path.t() | nil,
          names: Recording.Names.t(),
          said: {Recording.robots(), Recording.Names.t()} | nil,
          topics: Topics.t(),
          question: FileWriter.question() | nil
        }
  @type picture :: {robot :: atom(), Vision.View.Picture.t()}

  @doc """
  Begins to open a file, or the next one of a folder (options of `Mcap.FileWriter`), for these robots, with
  pictures or without.
  """
  @spec open(keyword(), [atom()], pictures? :: boolean()) :: t()
  def open(options, ids, pictures?) do
    {:ok, writer} = FileWriter.start_link(options)
    {robots, trace, encoding} = Recording.topics()

    topics =
      for(topic <- [robots, trace], do: {topic, {topic, encoding, nil}}) ++
        for {key, topic, schema} <- Topics.list(ids, pictures?),
            do: {key, {topic, "json", schema}}

    note = {"convoy", Recording.metadata(ids)}

    %__MODULE__{
      writer: writer,
      keys: Enum.map(topics, &elem(&1, 0)),
      topics: %Topics{pictures?: pictures?},
      question: FileWriter.begin(writer, note, Enum.map(topics, &elem(&1, 1)))
    }
  end

  @typedoc """
  The file is open, or what was sent is on the disk (`turned?`: and a new file of the folder was begun, which has no
  states yet).
  """
  @type news ::
          {:open, t()} | {:written, t(), turned? :: boolean()} | {:error, line :: String.t()}

  @doc "What a message of the writer says; `nil` for one that answers no question."
  @spec heard(t(), message :: term()) :: news() | nil
  def heard(%__MODULE__{question: nil}, _message), do: nil

  def heard(%__MODULE__{question: question} = output, message),
    do:
      with(
        answer when answer != nil <- FileWriter.answer(message, question),
        do: news(output, answer)
      )

  @doc "Waits for the answer to the question."
  @spec await(t()) :: news()
  def await(%__MODULE__{question: question} = output),
    do: news(output, FileWriter.await(question))

  defp news(output, {:ok, ids, file}) do
    channels = output.keys |> Enum.zip(ids) |> Map.new()
    {:open, %{output | channels: channels, file: file, question: nil}}
  end

  defp news(output, {:ok, file}) do
    turned? = file != output.file
    said = if turned?, do: nil, else: output.said
    {:written, %{output | file: file, said: said, question: nil}, turned?}
  end

  defp news(_output, {:error, _line} = error), do: error

  @doc """
  Writes the entries and the pictures of the last second, at a time in ns since 1970, and asks for their being on the
  disk.
  """
  @spec write(t(), [Replay.entry()], [picture()], Recording.robots(), ns :: non_neg_integer()) ::
          t()
  def write(%__MODULE__{question: nil} = output, entries, pictures, robots, ns) do
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

    {bytes, names} = Recording.trace(entries, robots, output.names)
    now = {robots, names}
    if output.said != now, do: message(output, about, ns, Recording.robots(robots, names))
    if entries != [], do: message(output, trace, ns, bytes)

    question = FileWriter.written(output.writer)
    %{output | names: names, said: now, topics: topics, question: question}
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

  @doc "What is known of robots after a state of one: it tells the body, and the time at which it was sent the offset of the robot's clock."
  @spec know(Recording.robots(), atom(), state :: struct(), offset_ms :: integer()) ::
          Recording.robots()
  def know(robots, id, state, offset_ms) do
    robot = robots[id]
    profile = robot.profile || Map.get(state, :profile)
    known? = robot.offset_ms != nil and abs(robot.offset_ms - offset_ms) < @same_ms
    offset_ms = if known?, do: robot.offset_ms, else: offset_ms
    Map.put(robots, id, %{offset_ms: offset_ms, profile: profile})
  end

  @doc "Ends the file."
  @spec close(t()) :: :ok | {:error, line :: String.t()}
  def close(%__MODULE__{writer: writer}), do: FileWriter.close(writer)

  @doc "Gives the file up: its disk is full, or hangs."
  @spec abandon(t()) :: :ok
  # It may hang in a call to the disk, which nothing ends.
  def abandon(%__MODULE__{writer: writer}) do
    Process.unlink(writer)
    Process.exit(writer, :kill)
    :ok
  end
end
