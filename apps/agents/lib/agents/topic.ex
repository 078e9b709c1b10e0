defmodule Agents.Topic do
  @moduledoc """
  Publishes to subscribers on all connected nodes.

      {:ok, poses} = Agents.Topic.subscribe(:poses, template: [from: :mag1], limit: 20)
      Agents.Topic.publish(:poses, :mag1, {1.0, 2.0}, class: :telemetry)
      {:ok, envelope} = Agents.Topic.next(poses, 1_000)

  A topic is an atom of the program, or text; on each node `{:topic, name}` is a group of the
  directory. Nothing is kept for later subscribers, and publishing does not wait.

  Each subscription is a small process that keeps what its owner has not asked for yet, up to a
  limit, by the rules of `Agents.Mailbox`: a slow reader loses old telemetry, and no other
  loses anything. It ends with its owner. A process with other things to do calls `more/1`, and
  gets one message `{:topic, subscription, envelope}` for each call. An `Agents.Responder` uses
  its option `:topics` instead.
  """
  alias Agents.{Conversation, Envelope, Mailbox, Template}
  alias Swarm.Directory
  alias Agents.Topic.Subscription

  @limit 100

  @doc """
  Subscribes the calling process. Options: `:limit`, how many envelopes may wait (default
  #{@limit}), and `:template`, which ones (`Agents.Template`). Wrong options return an error that
  names what is allowed.
  """
  @spec subscribe(Envelope.topic(), keyword()) :: {:ok, pid()} | {:error, line :: String.t()}
  def subscribe(topic, options \\ []) do
    with :ok <- named(topic),
         :ok <- known(options),
         {:ok, limit} <- Mailbox.limit(Keyword.get(options, :limit, @limit)),
         {:ok, template} <- Template.check(Keyword.get(options, :template, [])),
         do: Subscription.start_link(self(), topic, limit, template)
  end

  @doc "Ends a subscription. What it has already sent may still be in the mailbox of its owner."
  @spec unsubscribe(subscription :: pid()) :: :ok
  def unsubscribe(subscription), do: GenServer.cast(subscription, {:unsubscribe, self()})

  @doc "Asks for one more envelope, which arrives as a message, at once or when there is one."
  @spec more(subscription :: pid()) :: :ok
  def more(subscription), do: GenServer.cast(subscription, {:more, self()})

  @doc """
  Waits for one envelope; do not mix it with `more/1`. Returns `:none` if nothing came within the
  time, or if the subscription is gone.
  """
  @spec next(subscription :: pid(), timeout_ms :: non_neg_integer()) ::
          {:ok, Envelope.t()} | :none
  def next(subscription, timeout_ms) do
    Conversation.patience!(timeout_ms)
    more(subscription)

    receive do
      {:topic, ^subscription, envelope} -> {:ok, envelope}
    after
      timeout_ms -> take_back(subscription)
    end
  end

  # Otherwise a later envelope would lie in the mailbox of a caller that no longer waits for it.
  # One that was on its way meanwhile is here before the answer is.
  defp take_back(subscription) do
    :ok = GenServer.call(subscription, :take_back)

    receive do
      {:topic, ^subscription, envelope} -> {:ok, envelope}
    after
      0 -> :none
    end
  catch
    :exit, _ended -> :none
  end

  @doc "How many envelopes a subscription has dropped so far, by reason, and how many wait."
  @spec counts(subscription :: pid()) :: %{atom() => non_neg_integer()}
  def counts(subscription), do: GenServer.call(subscription, :counts)

  @doc """
  Publishes to the subscribers of a topic on all nodes that this one is connected to, and returns
  how many there are. Options as in `Agents.Envelope.new/4`. A value that an envelope cannot hold
  raises `ArgumentError`.
  """
  @spec publish(Envelope.topic(), from :: atom(), content :: term(), keyword()) ::
          non_neg_integer()
  def publish(topic, from, content, options \\ []) do
    envelope = Envelope.new(:inform, from, content, under(topic, options))
    Enum.count(Directory.members({:topic, topic}), &(Conversation.post(&1, envelope) == :ok))
  end

  # The envelope refuses options that are not a list.
  defp under(topic, options) do
    if is_list(options) and not List.improper?(options),
      do: options ++ [topic: topic],
      else: options
  end

  defp named(topic) do
    if Envelope.topic?(topic),
      do: :ok,
      else: {:error, "#{inspect(topic)} is not a topic; write an atom, or text of 1 to 255 bytes"}
  end

  defp known(options) do
    cond do
      not Keyword.keyword?(options) ->
        {:error, "#{inspect(options)} is not a list of options; allowed are limit and template"}

      unknown = Enum.find(Keyword.keys(options), &(&1 not in [:limit, :template])) ->
        {:error, "unknown option #{inspect(unknown)}: allowed are limit and template"}

      true ->
        :ok
    end
  end
end
