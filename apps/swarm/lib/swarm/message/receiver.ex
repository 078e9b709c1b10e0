defmodule Swarm.Message.Receiver do
  @moduledoc """
  Handles the messages that a robot receives, as a function: tracks which robots are present,
  forwards to those that do not hear each other (`Swarm.Message.Forwarder`), and counts what was dropped. Pure; a part of
  `Swarm.Comms`.
  """
  alias Swarm.Membership.{Heartbeat, Peers}
  alias Swarm.Message
  alias Swarm.Message.Forwarder

  @enforce_keys [:me, :peers]
  defstruct @enforce_keys ++ [heard: 0, rejected: %{}, forwarder: Forwarder.new()]

  @type t :: %__MODULE__{
          me: atom(),
          peers: Peers.t(),
          heard: non_neg_integer(),
          rejected: %{atom() => pos_integer()},
          forwarder: Forwarder.t()
        }

  @typedoc """
    * `{:heartbeat, id, beat}` - of a peer, which is noted; the caller handles what it says about
      the emergency stop
    * `{:message, message}` - for the mission
    * `:nothing` - dropped
  """
  @type heard :: {:heartbeat, atom(), Heartbeat.t()} | {:message, Message.t()} | :nothing

  @doc "The state before anything is heard."
  @spec new(atom()) :: t()
  def new(me), do: %__MODULE__{me: me, peers: Peers.new(me)}

  @doc """
  Hears what was checked (`Swarm.Message.check/1`), on this node: once for all robots that hear it.

      iex> {heard, receiver} = Swarm.Message.Receiver.take(Swarm.Message.Receiver.new(:mag1), {:error, :not_a_message}, 0)
      iex> {heard, receiver.rejected}
      {:nothing, %{not_a_message: 1}}
  """
  @spec take(t(), {:ok, Message.t()} | {:error, atom()}, integer()) :: {heard(), t()}
  def take(%__MODULE__{me: me} = receiver, checked, now_ms) do
    case checked do
      # From another robot of this name: another module decides which of the two gives way.
      {:ok, %Message{from: ^me}} ->
        {:nothing, receiver}

      {:ok, %Message{kind: :relay, body: inner}} ->
        take(receiver, {:ok, inner}, now_ms)

      {:ok, %Message{kind: :heartbeat, from: from, body: beat, hops: hops}} ->
        peers = Peers.hear(receiver.peers, from, beat, now_ms, hops == 0)
        {{:heartbeat, from, beat}, %{receiver | peers: peers, heard: receiver.heard + 1}}

      {:ok, message} ->
        {{:message, message}, %{receiver | heard: receiver.heard + 1}}

      {:error, reason} ->
        {:nothing, reject(receiver, reason)}
    end
  end

  @doc "The heartbeats that this robot forwards at a tick, ten times a second."
  @spec forward(t(), integer()) :: {t(), [Forwarder.sending()]}
  def forward(%__MODULE__{me: me, peers: %{rows: rows}} = receiver, now_ms) do
    {forwarder, sendings} = Forwarder.beats(receiver.forwarder, me, rows, now_ms)
    {%{receiver | forwarder: forwarder}, sendings}
  end

  @doc "The same for a `{:message, message}` that was heard just now."
  @spec forward(t(), Message.t(), integer()) :: {t(), [Forwarder.sending()]}
  def forward(%__MODULE__{me: me, peers: %{rows: rows}} = receiver, message, now_ms) do
    {forwarder, sendings} = Forwarder.letter(receiver.forwarder, me, rows, message, now_ms)
    {%{receiver | forwarder: forwarder}, sendings}
  end

  @doc "Counts what was dropped, and why; possibly several of a kind at once."
  @spec reject(t(), atom(), pos_integer()) :: t()
  def reject(receiver, reason, number \\ 1),
    do: %{receiver | rejected: Map.update(receiver.rejected, reason, number, &(&1 + number))}

  @doc "The leader that each robot that is not gone follows or names."
  @spec leaders(t(), integer()) :: %{atom() => atom() | nil}
  def leaders(receiver, now_ms) do
    for {id, beat} <- Peers.beats(receiver.peers, now_ms), into: %{} do
      {id, if(beat.leader != id, do: beat.leader)}
    end
  end
end
