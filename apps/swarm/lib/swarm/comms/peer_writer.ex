defmodule Swarm.Comms.PeerWriter do
  @moduledoc false
  # Writes the other robots to a robot's board: a row `{:peer, id}` for each, whenever it is heard
  # and once more when it is gone.
  alias Robot.Board
  alias Swarm.Membership.Peers

  @enforce_keys [:board]
  defstruct @enforce_keys ++ [gone: MapSet.new()]

  @type t :: %__MODULE__{board: Board.t(), gone: MapSet.t(atom())}

  @doc "The state before any robot is heard."
  @spec new(Board.t()) :: t()
  def new(board), do: %__MODULE__{board: board}

  @doc """
  Notes that a robot was heard. A hundred robots send each other fifty thousand heartbeats a
  second, so only its row is written.
  """
  @spec heard(t(), Peers.t(), atom(), integer()) :: t()
  def heard(%__MODULE__{} = writer, peers, id, at_ms) do
    show(writer, peers, id, at_ms)
    %{writer | gone: MapSet.delete(writer.gone, id)}
  end

  @doc "Writes which robots are gone, because nothing arrives from them that would."
  @spec grow_old(t(), Peers.t(), integer()) :: t()
  def grow_old(%__MODULE__{} = writer, peers, at_ms) do
    for id <- Peers.gone(peers, at_ms), id not in writer.gone, reduce: writer do
      writer ->
        show(writer, peers, id, at_ms)
        %{writer | gone: MapSet.put(writer.gone, id)}
    end
  end

  defp show(writer, peers, id, at_ms) do
    peer = Peers.percept(peers, id, at_ms)
    Board.put(writer.board, :comms, {:peer, id}, peer, peer.at_ms)
  end
end
