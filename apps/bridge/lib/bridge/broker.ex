defmodule Bridge.Broker do
  @moduledoc """
  Decides which messages of which topics go to which client, and which of them a client that is slow does not get. Pure; time in
  ms.

  What waits for a client is bounded: of a topic whose newest message is all that counts one message waits, of `:events` the
  newest hundred. Nothing is said on a topic that no client asked for.
  """

  @most_events 100

  @enforce_keys [:topics]
  defstruct @enforce_keys ++ [clients: %{}]

  @typedoc """
  How often a topic is said, at most: each so many ms, `:once` and again to each client that asks for it, when it has changed
  (`:changes`, likewise), or as things happen (`:events`).
  """
  @type pace :: pos_integer() | :once | :changes | :events
  @type key :: term()
  @type client :: term()
  @typedoc "What a client calls its subscription."
  @type tag :: term()

  @type t :: %__MODULE__{
          topics: %{key() => %{pace: pace(), said_ms: integer() | nil, kept: term()}},
          clients: %{
            client() => %{
              asked: %{
                key() => {tag(), every_ms :: non_neg_integer(), said_ms :: integer() | nil}
              },
              waiting: [{key(), message :: term()}]
            }
          }
        }

  @doc "A broker of these topics."
  @spec new([{key(), pace()}]) :: t()
  def new(topics), do: add(%__MODULE__{topics: %{}}, topics)

  @doc "More topics."
  @spec add(t(), [{key(), pace()}]) :: t()
  def add(broker, topics) do
    new = Map.new(topics, fn {key, pace} -> {key, %{pace: pace, said_ms: nil, kept: nil}} end)
    %{broker | topics: Map.merge(new, broker.topics)}
  end

  @doc "A client without topics."
  @spec join(t(), client()) :: t()
  def join(broker, client), do: put_in(broker.clients[client], %{asked: %{}, waiting: []})

  @doc "A client has gone, with all that waited for it."
  @spec leave(t(), client()) :: t()
  def leave(broker, client), do: %{broker | clients: Map.delete(broker.clients, client)}

  @doc """
  A client asks for a topic, each `every_ms` at most; asked again, what it said last counts. A topic or a client that there is not changes
  nothing.

      iex> alias Bridge.Broker
      iex> broker = Broker.new([{"/tf", 100}, {"/log", :events}]) |> Broker.join(:ann) |> Broker.join(:bob)
      iex> broker = broker |> Broker.ask(:ann, "/tf", 7) |> Broker.ask(:bob, "/log", 1)
      iex> {Broker.due(broker, 1_000), Broker.waiting?(broker, :ann)}
      {["/tf"], false}
      iex> broker = broker |> Broker.say("/tf", 1, 1_000) |> Broker.say("/tf", 2, 1_100) |> Broker.say("/log", :a, 1_100)
      iex> {messages, broker} = Broker.take(broker, :ann)
      iex> {messages, Broker.due(broker, 1_150)}
      {[{7, 2}], []}
  """
  @spec ask(t(), client(), key(), tag(), every_ms :: non_neg_integer()) :: t()
  def ask(broker, client, key, tag, every_ms \\ 0) do
    case {broker.clients, broker.topics} do
      {%{^client => asking}, %{^key => topic}} ->
        asking = put_in(asking.asked[key], {tag, every_ms, nil})
        asking = if topic.kept == nil, do: asking, else: queue(asking, key, topic.kept, 1)
        put_in(broker.clients[client], asking)

      _neither ->
        broker
    end
  end

  @doc "A client wants no more of a topic."
  @spec drop(t(), client(), key()) :: t()
  def drop(broker, client, key) do
    case broker.clients do
      %{^client => asking} ->
        waiting = Enum.reject(asking.waiting, fn {of, _message} -> of == key end)
        asking = %{asking | asked: Map.delete(asking.asked, key), waiting: waiting}
        put_in(broker.clients[client], asking)

      _gone ->
        broker
    end
  end

  @doc "Whether some client asked for a topic."
  @spec asked?(t(), key()) :: boolean()
  def asked?(broker, key),
    do: Enum.any?(broker.clients, fn {_client, %{asked: asked}} -> is_map_key(asked, key) end)

  @doc "The topics that are to be said now, sorted: somebody asked for them, and their time has come."
  @spec due(t(), now_ms :: integer()) :: [key()]
  def due(broker, now_ms) do
    asked = for {_client, %{asked: asked}} <- broker.clients, key <- Map.keys(asked), do: key
    for key <- Enum.sort(Enum.uniq(asked)), due?(broker.topics[key], now_ms), do: key
  end

  defp due?(%{pace: :once, said_ms: said_ms}, _now_ms), do: said_ms == nil
  defp due?(%{pace: :changes}, _now_ms), do: true
  defp due?(%{pace: :events}, _now_ms), do: false
  defp due?(%{said_ms: nil}, _now_ms), do: true
  defp due?(%{pace: every_ms, said_ms: said_ms}, now_ms), do: now_ms - said_ms >= every_ms

  @doc "Says a message on a topic; `nil` says nothing, and counts as said."
  @spec say(t(), key(), message :: term(), now_ms :: integer()) :: t()
  def say(broker, key, message, now_ms) do
    topic = %{broker.topics[key] | said_ms: now_ms}

    cond do
      message == nil or (topic.pace == :changes and topic.kept == message) ->
        put_in(broker.topics[key], topic)

      topic.pace in [:once, :changes] ->
        put_in(broker.topics[key], %{topic | kept: message}) |> tell(key, message, 1, now_ms)

      true ->
        most = if topic.pace == :events, do: @most_events, else: 1
        put_in(broker.topics[key], topic) |> tell(key, message, most, now_ms)
    end
  end

  defp tell(broker, key, message, most, now_ms) do
    clients =
      Map.new(broker.clients, fn {client, asking} ->
        case asking.asked do
          %{^key => {tag, every_ms, said_ms}}
          when said_ms == nil or now_ms - said_ms >= every_ms ->
            asking = put_in(asking.asked[key], {tag, every_ms, now_ms})
            {client, queue(asking, key, message, most)}

          _not_now ->
            {client, asking}
        end
      end)

    %{broker | clients: clients}
  end

  # The newest first.
  defp queue(%{waiting: waiting} = asking, key, message, most) do
    same = Enum.count(waiting, fn {of, _message} -> of == key end)
    waiting = if same >= most, do: without_oldest(waiting, key), else: waiting
    %{asking | waiting: [{key, message} | waiting]}
  end

  defp without_oldest(waiting, key) do
    waiting |> Enum.reverse() |> List.keydelete(key, 0) |> Enum.reverse()
  end

  @doc "Whether something waits for a client."
  @spec waiting?(t(), client()) :: boolean()
  def waiting?(broker, client), do: match?(%{^client => %{waiting: [_ | _]}}, broker.clients)

  @doc "What waits for a client, oldest first, each message with what the client calls its subscription."
  @spec take(t(), client()) :: {[{tag(), message :: term()}], t()}
  def take(broker, client) do
    %{asked: asked, waiting: waiting} = asking = Map.fetch!(broker.clients, client)
    messages = for {key, message} <- Enum.reverse(waiting), do: {elem(asked[key], 0), message}
    {messages, put_in(broker.clients[client], %{asking | waiting: []})}
  end
end
