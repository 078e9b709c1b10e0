defmodule Agents.Inbox do
  @moduledoc """
  Lets a process read its envelopes by the rules of `Agents.Mailbox`, since the VM's own mailbox
  has neither a limit nor classes.

  Whatever arrives is first moved into the mailbox, which costs a microsecond, and only then is
  one envelope handled: the process sends itself a *turn*, a message that queues behind all that
  has arrived so far. So an urgent envelope is handled right after the current one, and the queue
  is bounded.

      def handle_info(message, s) do
        case Agents.Inbox.arrived(s.inbox, message) do
          {:handle, envelope, inbox} -> {:noreply, handle(envelope, %{s | inbox: inbox})}
          {:wait, inbox} -> {:noreply, %{s | inbox: inbox}}
        end
      end

  A message that is not an envelope, or a malformed one, is dropped and counted (`rejected`), and
  so is an envelope that the template does not match (`unwanted`).
  """
  alias Agents.{Envelope, Mailbox, Template}

  @limit 1_000

  @enforce_keys [:mailbox, :template, :turn]
  defstruct @enforce_keys ++ [due?: false, rejected: 0, unwanted: 0]

  @typedoc "`due?` says whether a turn is on its way."
  @type t :: %__MODULE__{
          mailbox: Mailbox.t(),
          template: Template.t(),
          turn: reference(),
          due?: boolean(),
          rejected: non_neg_integer(),
          unwanted: non_neg_integer()
        }

  @doc "An empty inbox. Options: `:limit` (default #{@limit}), `:template` (default `[]`, everything); wrong ones raise."
  @spec new(keyword()) :: t()
  def new(options \\ []) do
    options = Keyword.validate!(options, limit: @limit, template: [])

    with {:ok, limit} <- Mailbox.limit(options[:limit]),
         {:ok, template} <- Template.check(options[:template]) do
      %__MODULE__{mailbox: Mailbox.new(limit), template: template, turn: make_ref()}
    else
      {:error, line} -> raise ArgumentError, line
    end
  end

  @doc """
  Takes in a message that has arrived, and returns whether there is an envelope to handle now.
  Only for the process that owns the inbox.
  """
  @spec arrived(t(), message :: term()) :: {:handle, Envelope.t(), t()} | {:wait, t()}
  def arrived(%{turn: turn} = inbox, {__MODULE__, turn}), do: take(%{inbox | due?: false})

  def arrived(inbox, message) do
    with {:ok, envelope} <- Envelope.check(message),
         true <- Template.match?(inbox.template, envelope) do
      put(inbox, envelope)
    else
      {:error, _reason} -> {:wait, %{inbox | rejected: inbox.rejected + 1}}
      false -> {:wait, %{inbox | unwanted: inbox.unwanted + 1}}
    end
  end

  @doc "How many messages were dropped so far, by reason."
  @spec counts(t()) :: %{atom() => non_neg_integer()}
  def counts(inbox) do
    inbox.mailbox.dropped
    |> Map.merge(%{rejected: inbox.rejected, unwanted: inbox.unwanted})
    |> Map.put(:waiting, Mailbox.size(inbox.mailbox))
  end

  # Nothing else waits, here or in the VM's mailbox, so there is nothing to put in order.
  defp put(%{due?: false} = inbox, envelope) do
    case Process.info(self(), :message_queue_len) do
      {:message_queue_len, 0} -> {:handle, envelope, inbox}
      _more -> {:wait, turn(%{inbox | mailbox: Mailbox.put(inbox.mailbox, envelope)})}
    end
  end

  defp put(inbox, envelope),
    do: {:wait, %{inbox | mailbox: Mailbox.put(inbox.mailbox, envelope)}}

  defp take(inbox) do
    case Mailbox.take(inbox.mailbox) do
      {nil, mailbox} -> {:wait, %{inbox | mailbox: mailbox}}
      {envelope, mailbox} -> {:handle, envelope, turn(%{inbox | mailbox: mailbox})}
    end
  end

  # If nothing is left to take, no turn is needed.
  defp turn(%{mailbox: %{size: 0, urgent_size: 0}} = inbox), do: inbox

  defp turn(inbox) do
    send(self(), {__MODULE__, inbox.turn})
    %{inbox | due?: true}
  end
end
