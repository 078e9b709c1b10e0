defmodule Agents.Envelope do
  @moduledoc """
  Carries a message between programs on robots, with its intention, sender and conversation. Pure, except for the
  reference of a new conversation.

  Robots' own talk (heartbeats, rounds) is `Swarm.Message`. An envelope is for everything else: a
  service asks another, a mission assigns tasks, a topic publishes news. `check/1` checks whatever
  arrives; after it, no reader needs to check an envelope again, but its content is the sender's, and
  a reader must check that. Nothing becomes an atom here.

  | field | meaning |
  |---|---|
  | `performative` | what is meant: `:inform` reports, `:request` and `:query` ask, `:agree`, `:refuse` and `:failure` answer, `:cfp`, `:propose`, `:accept` and `:reject` trade a task, `:cancel` ends, `:subscribe` asks for news |
  | `from` | the sender's name, a robot's or another program's |
  | `conversation` | a reference, or `{name, counter}`; the same in all envelopes of one exchange |
  | `reply_to` | where answers go: a process, or an alias of one; `nil` if none is wanted |
  | `in_reply_to` | the `reply_to` of the envelope that this answers; `nil` in an opening one |
  | `epoch` | the leadership it belongs to, or `nil` |
  | `topic` | the topic it was published under, or `nil` |
  | `class` | `:telemetry` is dropped first, then `:data`; `:urgent` is handled first (`Agents.Mailbox`) |
  | `content` | any term |
  """
  alias Swarm.Wire

  @performatives [
    :inform,
    :request,
    :query,
    :agree,
    :refuse,
    :failure,
    :cfp,
    :propose,
    :accept,
    :reject,
    :cancel,
    :subscribe
  ]
  @classes [:telemetry, :data, :urgent]
  @options [:conversation, :reply_to, :in_reply_to, :epoch, :topic, :class]
  @longest_topic 255
  # The same as `Swarm.Wire.counter?/1`, which is not a guard.
  @highest 0xFFFFFFFFFFFFFFFF

  @enforce_keys [:performative, :from, :conversation]
  defstruct @enforce_keys ++
              [
                reply_to: nil,
                in_reply_to: nil,
                epoch: nil,
                topic: nil,
                class: :data,
                content: nil
              ]

  @size 10

  @type performative ::
          :inform
          | :request
          | :query
          | :agree
          | :refuse
          | :failure
          | :cfp
          | :propose
          | :accept
          | :reject
          | :cancel
          | :subscribe
  @type class :: :telemetry | :data | :urgent
  @type conversation :: reference() | {atom(), non_neg_integer()}
  @type address :: pid() | reference()
  @type topic :: atom() | String.t()
  @type t :: %__MODULE__{
          performative: performative(),
          from: atom(),
          conversation: conversation(),
          reply_to: address() | nil,
          in_reply_to: address() | nil,
          epoch: non_neg_integer() | nil,
          topic: topic() | nil,
          class: class(),
          content: term()
        }
  @type error ::
          :not_an_envelope
          | :performative
          | :from
          | :conversation
          | :reply_to
          | :in_reply_to
          | :epoch
          | :topic
          | :class

  @doc "The performatives: what an envelope can mean."
  @spec performatives() :: [performative(), ...]
  def performatives, do: @performatives

  @doc """
  An envelope, in a conversation of its own unless one is given. Options: `:conversation`,
  `:reply_to`, `:in_reply_to`, `:epoch`, `:topic`, `:class` (default `:data`). A value that an
  envelope cannot hold raises `ArgumentError`.

      iex> e = Agents.Envelope.new(:request, :mag1, :battery, class: :urgent)
      iex> {e.performative, e.from, e.content, e.class, is_reference(e.conversation)}
      {:request, :mag1, :battery, :urgent, true}
  """
  @spec new(performative(), atom(), term(), keyword()) :: t()
  def new(performative, from, content, options \\ []) do
    envelope = %__MODULE__{
      performative: performative,
      from: from,
      content: content,
      conversation: nil
    }

    envelope = Enum.reduce(options!(options), envelope, &put/2)

    %{envelope | conversation: envelope.conversation || make_ref()}
    |> check()
    |> checked!()
  end

  @doc """
  The answer to an envelope: it has the same conversation, epoch and class, and its `in_reply_to`
  is the envelope's `reply_to`. Options as in `new/4`.

      iex> asked = Agents.Envelope.new(:request, :mag1, :battery, reply_to: self())
      iex> answer = Agents.Envelope.reply(asked, :inform, :min1, 11.8)
      iex> {answer.conversation == asked.conversation, answer.in_reply_to == self(), answer.content}
      {true, true, 11.8}
  """
  @spec reply(t(), performative(), atom(), term(), keyword()) :: t()
  def reply(envelope, performative, from, content, options \\ [])

  # A fast path for the usual answer: a hundred robots write ten thousand at once.
  def reply(%__MODULE__{} = envelope, performative, from, content, [])
      when performative in @performatives and is_atom(from) and from not in [nil, true, false] do
    %{
      envelope
      | performative: performative,
        from: from,
        reply_to: nil,
        in_reply_to: envelope.reply_to,
        topic: nil,
        content: content
    }
  end

  def reply(%__MODULE__{} = envelope, performative, from, content, options) do
    same = [
      conversation: envelope.conversation,
      in_reply_to: envelope.reply_to,
      epoch: envelope.epoch,
      class: envelope.class
    ]

    new(performative, from, content, Keyword.merge(same, options))
  end

  @doc """
  Checks whether a term is an envelope; the error names the field that is wrong.

      iex> Agents.Envelope.check(%{junk: 1})
      {:error, :not_an_envelope}
      iex> Agents.Envelope.check(%{Agents.Envelope.new(:inform, :mag1, 1) | epoch: -1})
      {:error, :epoch}
  """
  @spec check(term()) :: {:ok, t()} | {:error, error()}
  def check(
        %__MODULE__{
          performative: performative,
          from: from,
          conversation: conversation,
          reply_to: reply_to,
          in_reply_to: in_reply_to,
          epoch: epoch,
          topic: topic,
          class: class,
          content: _anything
        } = envelope
      )
      when map_size(envelope) == @size and performative in @performatives and
             is_atom(from) and from not in [nil, true, false] and
             is_reference(conversation) and
             (is_pid(reply_to) or is_reference(reply_to) or reply_to == nil) and
             (is_pid(in_reply_to) or is_reference(in_reply_to) or in_reply_to == nil) and
             (epoch == nil or (is_integer(epoch) and epoch in 0..@highest)) and
             is_atom(topic) and topic not in [true, false] and
             class in @classes,
      do: {:ok, envelope}

  # The rarer cases, and the wrong ones.
  def check(term) do
    if Wire.whole?(term, __MODULE__) do
      case Enum.find(Map.keys(term), &(not valid?(&1, Map.fetch!(term, &1)))) do
        nil -> {:ok, term}
        field -> {:error, field}
      end
    else
      {:error, :not_an_envelope}
    end
  end

  @doc """
  Whether a term can name a topic: an atom of the program, or text of 1 to 255 bytes.

      iex> for term <- [:poses, "poses", "", nil, 5], do: Agents.Envelope.topic?(term)
      [true, true, false, false, false]
  """
  @spec topic?(term()) :: boolean()
  def topic?(topic) when is_binary(topic),
    do: byte_size(topic) in 1..@longest_topic and String.valid?(topic)

  def topic?(topic), do: Wire.name?(topic)

  defp valid?(:performative, performative), do: performative in @performatives
  defp valid?(:from, from), do: Wire.name?(from)

  defp valid?(:conversation, {name, counter}),
    do: Wire.name?(name) and Wire.count?(counter)

  defp valid?(:conversation, conversation), do: is_reference(conversation)

  defp valid?(field, address) when field in [:reply_to, :in_reply_to],
    do: address == nil or is_pid(address) or is_reference(address)

  defp valid?(:epoch, epoch), do: epoch == nil or Wire.counter?(epoch)
  defp valid?(:topic, topic), do: topic == nil or topic?(topic)
  defp valid?(:class, class), do: class in @classes
  defp valid?(field, _anything) when field in [:__struct__, :content], do: true

  defp options!(options) do
    if is_list(options) and not List.improper?(options),
      do: options,
      else:
        raise(
          ArgumentError,
          "the options of an envelope are a list, not #{inspect(options, limit: 5)}"
        )
  end

  defp put({option, value}, envelope) when option in @options,
    do: Map.replace!(envelope, option, value)

  defp put(other, _envelope) do
    raise ArgumentError,
          "envelope: expected options among #{inspect(@options)}, got #{inspect(other)}"
  end

  defp checked!({:ok, envelope}), do: envelope

  defp checked!({:error, field}),
    do: raise(ArgumentError, "this #{field} is not valid in an envelope; see Agents.Envelope")
end
