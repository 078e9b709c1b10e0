defmodule Agents.Mailbox do
  @moduledoc """
  Queues unread envelopes, up to a limit, urgent ones first. Pure.

    * Urgent envelopes are taken first, and are never dropped to make room.
    * All others are taken in the order they came.
    * When it is full, the oldest telemetry is dropped; if there is none, the oldest data. If
      there is only data, a new envelope of telemetry is dropped itself.
    * Urgent envelopes do not count towards the limit. No honest fleet has more of them waiting
      than the limit allows of all others: beyond that it is a flood, and the newest is refused,
      so that the first to arrive, which is the one that stopped something, stays.

  A process uses it through `Agents.Inbox`.
  """
  alias Agents.Envelope

  @enforce_keys [:limit]
  defstruct @enforce_keys ++
              [
                urgent: :queue.new(),
                urgent_size: 0,
                data: :queue.new(),
                telemetry: :queue.new(),
                size: 0,
                sequence: 0,
                dropped: %{telemetry: 0, data: 0, urgent: 0}
              ]

  @typedoc "`size` counts all but the urgent envelopes; `dropped` is never reset."
  @type t :: %__MODULE__{
          limit: pos_integer(),
          urgent: :queue.queue(Envelope.t()),
          urgent_size: non_neg_integer(),
          data: :queue.queue({non_neg_integer(), Envelope.t()}),
          telemetry: :queue.queue({non_neg_integer(), Envelope.t()}),
          size: non_neg_integer(),
          sequence: non_neg_integer(),
          dropped: %{Envelope.class() => non_neg_integer()}
        }

  @doc "An empty mailbox for at most `limit` envelopes."
  @spec new(pos_integer()) :: t()
  def new(limit) when is_integer(limit) and limit > 0, do: %__MODULE__{limit: limit}

  @doc """
  Checks the limit of a mailbox.

      iex> Agents.Mailbox.limit(0)
      {:error, "limit: expected a whole number above 0, got 0"}
  """
  @spec limit(term()) :: {:ok, pos_integer()} | {:error, line :: String.t()}
  def limit(limit) when is_integer(limit) and limit > 0, do: {:ok, limit}

  def limit(other),
    do: {:error, "limit: expected a whole number above 0, got #{inspect(other, limit: 5)}"}

  @doc "How many envelopes wait."
  @spec size(t()) :: non_neg_integer()
  def size(mailbox), do: mailbox.size + mailbox.urgent_size

  @doc """
  Puts one envelope in, and drops what there is no room for.

      iex> mailbox = Agents.Mailbox.new(1)
      iex> [old, new] = for n <- 1..2, do: Agents.Envelope.new(:inform, :mag1, n)
      iex> mailbox = mailbox |> Agents.Mailbox.put(old) |> Agents.Mailbox.put(new)
      iex> {^new, mailbox} = Agents.Mailbox.take(mailbox)
      iex> {Agents.Mailbox.size(mailbox), mailbox.dropped.data}
      {0, 1}
  """
  @spec put(t(), Envelope.t()) :: t()
  def put(%{urgent_size: full, limit: full} = mailbox, %{class: :urgent}),
    do: drop(mailbox, :urgent)

  def put(mailbox, %{class: :urgent} = envelope),
    do: %{
      mailbox
      | urgent: :queue.in(envelope, mailbox.urgent),
        urgent_size: mailbox.urgent_size + 1
    }

  def put(%{size: full, limit: full} = mailbox, envelope) do
    cond do
      not :queue.is_empty(mailbox.telemetry) ->
        %{mailbox | telemetry: :queue.drop(mailbox.telemetry), size: full - 1}
        |> drop(:telemetry)
        |> put(envelope)

      envelope.class == :telemetry ->
        drop(mailbox, :telemetry)

      true ->
        %{mailbox | data: :queue.drop(mailbox.data), size: full - 1}
        |> drop(:data)
        |> put(envelope)
    end
  end

  def put(mailbox, %{class: :data} = envelope),
    do: counted(%{mailbox | data: :queue.in({mailbox.sequence, envelope}, mailbox.data)})

  def put(mailbox, %{class: :telemetry} = envelope),
    do:
      counted(%{mailbox | telemetry: :queue.in({mailbox.sequence, envelope}, mailbox.telemetry)})

  defp counted(mailbox),
    do: %{mailbox | size: mailbox.size + 1, sequence: mailbox.sequence + 1}

  defp drop(mailbox, class),
    do: %{mailbox | dropped: Map.update!(mailbox.dropped, class, &(&1 + 1))}

  @doc "Takes the next envelope out; `nil` if there is none."
  @spec take(t()) :: {Envelope.t() | nil, t()}
  def take(%{urgent_size: 0, size: 0} = mailbox), do: {nil, mailbox}

  def take(%{urgent_size: 0} = mailbox) do
    mailbox = %{mailbox | size: mailbox.size - 1}

    # The smaller number came first; an atom, which stands for none, compares larger than any
    # number.
    if first(mailbox.data) < first(mailbox.telemetry) do
      {{:value, {_number, envelope}}, data} = :queue.out(mailbox.data)
      {envelope, %{mailbox | data: data}}
    else
      {{:value, {_number, envelope}}, telemetry} = :queue.out(mailbox.telemetry)
      {envelope, %{mailbox | telemetry: telemetry}}
    end
  end

  def take(mailbox) do
    {{:value, envelope}, urgent} = :queue.out(mailbox.urgent)
    {envelope, %{mailbox | urgent: urgent, urgent_size: mailbox.urgent_size - 1}}
  end

  defp first(queue) do
    case :queue.peek(queue) do
      {:value, {number, _envelope}} -> number
      :empty -> :none
    end
  end
end
