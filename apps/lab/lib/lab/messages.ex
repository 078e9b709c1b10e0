defmodule Lab.Messages do
  @moduledoc """
  Keeps what robots have said to each other of late, for people, as they sent it: 500 rows. Pure.

  What a robot says again within 2 s, in the same words and to the same robots, is in the row of what it said before. Heartbeats, which every robot sends
  ten times a second, are left out, also where another robot passes them on: what they say is in the scene.
  """
  alias Swarm.Message
  alias Swarm.Message.Words

  @kept 500
  @again_ms 2_000

  # Rows by their numbers, and the newest of each sender, addressees and words.
  defstruct count: 0, rows: %{}, newest: %{}

  @typedoc "A message at the moment at which it left its sender."
  @type sent :: {from :: atom(), to :: :all | atom() | [atom()], Message.t()}

  @typedoc "Message `n`, and those like it: `count` of them from `at_s` to `last_s`; `text` is what they say (`Swarm.Message.Words`)."
  @type entry :: %{
          n: pos_integer(),
          at_s: float(),
          last_s: float(),
          count: pos_integer(),
          from: atom() | (person :: String.t()),
          to: :all | [atom()],
          kind: Message.kind(),
          text: String.t()
        }

  @type t :: %__MODULE__{
          count: non_neg_integer(),
          rows: %{pos_integer() => entry()},
          newest: %{term() => pos_integer()}
        }

  @doc "The same with messages that were sent at this time, the first of them first."
  @spec note(t(), at_ms :: integer(), [sent()]) :: t()
  def note(%__MODULE__{} = messages, at_ms, sent) do
    Enum.reduce(sent, messages, fn {from, to, message}, messages ->
      if told?(message),
        do: add(messages, at_ms / 1000, {from, addressees(to), message.kind, Words.of(message)}),
        else: messages
    end)
  end

  @doc """
  The same with what a person wrote to these robots at this time (`Swarm.MissionRegistry.Text.message/2`).

      iex> [row] = %Lab.Messages{} |> Lab.Messages.person(1_500, [:mag1], "leg:leg=3") |> Lab.Messages.list()
      iex> {row.from, row.to, row.text}
      {"a person", [:mag1], "leg:leg=3"}
  """
  @spec person(t(), at_ms :: integer(), :all | [atom()], String.t()) :: t()
  def person(%__MODULE__{} = messages, at_ms, to, text),
    do: add(messages, at_ms / 1000, {"a person", addressees(to), :mission, text})

  defp addressees(:all), do: :all
  defp addressees(robots), do: List.wrap(robots)

  defp add(%{count: count, rows: rows, newest: newest}, at_s, {from, to, kind, text} = words) do
    count = count + 1

    case rows[newest[words]] do
      %{last_s: last_s} = row when at_s - last_s <= @again_ms / 1000 ->
        row = %{row | last_s: at_s, count: row.count + 1}
        %__MODULE__{count: count, rows: Map.put(rows, row.n, row), newest: newest}

      _long_ago_or_never ->
        row = %{n: count, at_s: at_s, last_s: at_s, count: 1}
        row = Map.merge(row, %{from: from, to: to, kind: kind, text: text})
        rows = Map.put(rows, count, row)
        bounded(%__MODULE__{count: count, rows: rows, newest: Map.put(newest, words, count)})
    end
  end

  # Twice as many before the older half is dropped, so that this is seldom done.
  defp bounded(%{rows: rows} = messages) when map_size(rows) < 2 * @kept, do: messages

  defp bounded(messages) do
    rows = for row <- list(messages), into: %{}, do: {row.n, row}
    newest = for {words, n} <- messages.newest, is_map_key(rows, n), into: %{}, do: {words, n}
    %{messages | rows: rows, newest: newest}
  end

  @doc "Whether a message is kept: all but heartbeats."
  @spec told?(Message.t()) :: boolean()
  def told?(%Message{kind: :heartbeat}), do: false
  def told?(%Message{kind: :relay, body: %Message{kind: :heartbeat}}), do: false
  def told?(%Message{}), do: true

  @doc "What the steps of a run in lockstep sent, in their order (`t:Lab.Trial.entry/0`)."
  @spec of_entries([term()]) :: [sent()]
  def of_entries(entries) do
    for {:step, id, _input, effects} <- entries,
        {:send, to, %Message{} = message} <- effects,
        do: {id, to, message}
  end

  @doc """
  The rows, the newest last.

      iex> letter = %Robot.Mission.Letter{to: :all, mission: Some.Mission, version: 1, kind: :seen, fields: [point: 3]}
      iex> sent = {:mag1, :all, Swarm.Message.of(:mag1, letter)}
      iex> %Lab.Messages{} |> Lab.Messages.note(1_500, [sent]) |> Lab.Messages.note(2_500, [sent]) |> Lab.Messages.list()
      [%{n: 1, at_s: 1.5, last_s: 2.5, count: 2, from: :mag1, to: :all, kind: :mission, text: "seen, point 3"}]
  """
  @spec list(t()) :: [entry()]
  def list(%__MODULE__{rows: rows}),
    do: rows |> Map.values() |> Enum.sort_by(&{&1.last_s, &1.n}) |> Enum.take(-@kept)
end
