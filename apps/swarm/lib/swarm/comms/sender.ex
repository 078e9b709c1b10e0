defmodule Swarm.Comms.Sender do
  @moduledoc false
  # Sends a robot's messages and heartbeats. It sends five heartbeats a second; when the emergency
  # stop changes, one at once and then ten a second for a second, so that the change spreads within
  # 200 ms.
  alias Robot.Board
  alias Swarm.{EStop, Message}
  alias Swarm.Comms.OwnHeartbeat
  alias Swarm.Message.Receiver
  alias Swarm.Membership.Heartbeat

  @urgent_ticks 10

  @enforce_keys [:config, :board, :transport, :boot, :held]
  defstruct @enforce_keys ++
              [sequence: 0, ticks: 0, beat_ms: nil, urgent: 0, sent: 0, silent?: false]

  @typedoc """
  `sequence` is the number of its last heartbeat, `held` what it last sent about the emergency
  stop, `urgent` how many faster heartbeats are left.
  """
  @type t :: %__MODULE__{
          config: Robot.Config.t(),
          board: Board.t(),
          transport: Robot.Config.call(),
          boot: integer(),
          held: [EStop.State.tag()],
          sequence: non_neg_integer(),
          ticks: non_neg_integer(),
          beat_ms: integer() | nil,
          urgent: non_neg_integer(),
          sent: non_neg_integer(),
          silent?: boolean()
        }

  @doc "The state before anything is sent, in the life of this number."
  @spec new(Robot.Config.t(), Board.t(), Robot.Config.call(), boot :: integer()) :: t()
  def new(config, board, transport, boot),
    do: %__MODULE__{
      config: config,
      board: board,
      transport: transport,
      boot: boot,
      held: EStop.written(board).held
    }

  @doc "Sends a message to these robots, or to all; a robot that has fallen silent does not."
  @spec speak(t(), :all | [atom()], Message.t()) :: t()
  def speak(%__MODULE__{silent?: true} = sender, _to, _message), do: sender

  def speak(%__MODULE__{transport: {m, f, a}} = sender, to, message) do
    apply(m, f, a ++ [sender.config.id, to, message])
    %{sender | sent: sender.sent + 1}
  end

  @doc "Called every tenth of a second: sends a heartbeat if one is due."
  @spec tick(t(), Receiver.t(), integer()) :: t()
  def tick(%__MODULE__{} = sender, receiver, at_ms) do
    sender = notice(%{sender | ticks: sender.ticks + 1})
    due? = sender.urgent > 0 or Heartbeat.due?(sender.beat_ms, at_ms)
    sender = if due?, do: beat(sender, receiver, at_ms), else: sender
    %{sender | urgent: max(sender.urgent - 1, 0)}
  end

  @doc "Called when the emergency stop may have changed: others must know soon."
  @spec urge(t(), Receiver.t()) :: t()
  def urge(%__MODULE__{} = sender, receiver) do
    case notice(sender) do
      ^sender -> sender
      hurried -> beat(hurried, receiver, Robot.Config.now(sender.config))
    end
  end

  # If a test or a trial decides when a robot acts, the next heartbeat carries it.
  defp notice(%{config: %{pace: :manual}} = sender), do: sender

  defp notice(sender) do
    case EStop.written(sender.board).held do
      same when same == sender.held -> sender
      held -> %{sender | held: held, urgent: @urgent_ticks}
    end
  end

  defp beat(sender, receiver, at_ms) do
    sequence = sender.sequence + 1
    from = {sender.boot, sequence}

    case OwnHeartbeat.message(sender.config, sender.board, receiver, from, at_ms) do
      {:ok, message} ->
        speak(%{sender | sequence: sequence, beat_ms: at_ms}, :all, message)

      :error ->
        sender
    end
  end
end
