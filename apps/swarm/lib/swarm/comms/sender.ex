defmodule Swarm.Comms.Sender do
  @moduledoc """
  What a robot says, and when: its transport, its heartbeats, and which of them it sent when
  (`Swarm.Commands.Freshness`). Five heartbeats a second; when the emergency stop changes, one at once and then ten
  a second for a second, so that it spreads within 200 ms.
  """
  alias Robot.{Board, Config}
  alias Swarm.Message
  alias Swarm.Commands.Freshness
  alias Swarm.Comms.Transport
  alias Swarm.Comms.{OwnHeartbeat, Receiver}

  @beat_every 2
  @urgent_ticks 10

  @enforce_keys [:config, :board, :transport, :stamps]
  defstruct @enforce_keys ++ [ticks: 0, urgent: 0, sent: 0, silent?: false]

  @type t :: %__MODULE__{
          config: Config.t(),
          board: Board.t(),
          transport: Config.call(),
          stamps: Freshness.t(),
          ticks: non_neg_integer(),
          urgent: non_neg_integer(),
          sent: non_neg_integer(),
          silent?: boolean()
        }

  @doc "A robot that has said nothing yet, in its life of this number."
  @spec new(Config.t(), Board.t(), Config.call(), boot :: integer()) :: t()
  def new(config, board, transport, boot),
    do: %__MODULE__{
      config: config,
      board: board,
      transport: transport,
      stamps: Freshness.new(boot)
    }

  @doc "Says something to these robots; one that has fallen silent does not."
  @spec speak(t(), [atom()], Message.t()) :: t()
  def speak(%__MODULE__{silent?: true} = mouth, _ids, _message), do: mouth

  def speak(%__MODULE__{transport: {m, f, a}} = mouth, ids, message) do
    apply(m, f, a ++ [mouth.config.id, ids, message])
    %{mouth | sent: mouth.sent + length(ids)}
  end

  @doc "A tenth of a second has passed: time for a heartbeat, or not."
  @spec tick(t(), Receiver.t(), integer()) :: t()
  def tick(%__MODULE__{} = mouth, ear, at_ms) do
    mouth = %{mouth | ticks: mouth.ticks + 1}
    due? = mouth.urgent > 0 or rem(mouth.ticks, @beat_every) == 1
    mouth = if due?, do: beat(mouth, ear, at_ms), else: mouth
    %{mouth | urgent: max(mouth.urgent - 1, 0)}
  end

  @doc """
  Something must be known everywhere soon. Where a test or a trial decides when a robot acts, the next
  heartbeat tells it.
  """
  @spec urge(t(), Receiver.t()) :: t()
  def urge(%__MODULE__{config: %{pace: :manual}} = mouth, _ear), do: mouth

  def urge(mouth, ear),
    do: beat(%{mouth | urgent: @urgent_ticks}, ear, Config.now(mouth.config))

  @doc "A stamp for somebody who asks."
  @spec stamp(t()) :: {Freshness.stamp(), t()}
  def stamp(%__MODULE__{} = mouth) do
    {stamp, stamps} = Freshness.issue(mouth.stamps, Config.now(mouth.config))
    {stamp, %{mouth | stamps: stamps}}
  end

  defp beat(mouth, ear, at_ms) do
    sequence = Freshness.last(mouth.stamps) + 1
    sender = {mouth.stamps.boot, sequence}

    case OwnHeartbeat.message(mouth.config, mouth.board, ear, sender, at_ms) do
      {:ok, message} ->
        mouth = %{mouth | stamps: Freshness.sent(mouth.stamps, sequence, at_ms)}
        speak(mouth, List.delete(Transport.robots(), mouth.config.id), message)

      :error ->
        mouth
    end
  end
end
