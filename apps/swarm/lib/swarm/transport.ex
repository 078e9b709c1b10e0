defmodule Swarm.Transport do
  @moduledoc """
  Delivers a robot's messages to others: directly to the comms processes of robots on this node,
  and by the mesh's datagrams to those on other nodes. A node without a mesh reaches nodes that
  a person has connected by hand, through Erlang's distribution.
  """
  alias Robot.Names
  alias Mesh.Nonblocking
  alias Swarm.{Directory, Message}
  alias Swarm.Message.Checked

  @doc """
  All robots that can be reached, sorted: those in the directory, those heard through the mesh
  from nodes that this one is not connected to, and those heard by connected nodes.
  """
  @spec robots() :: [atom()]
  def robots do
    case Map.keys(Mesh.robots()) do
      [] -> Directory.robots()
      heard -> Enum.uniq(Enum.sort(Directory.robots() ++ heard ++ Mesh.beyond()))
    end
  end

  @doc """
  The transport of `Swarm.Comms`: sends to these robots, or to all others that can be reached; a heartbeat
  without asking which these are. Waits for no process.
  """
  @spec transmit(from :: atom(), :all | [atom()], Message.t()) :: :ok
  def transmit(from, :all, %Message{kind: kind} = message) when kind != :heartbeat,
    do: transmit(from, List.delete(robots(), from), message)

  def transmit(from, to, %Message{} = message) do
    if Mesh.running?(),
      do: by_mesh(from, to, message),
      else: by_distribution(from, to, message)
  end

  defp by_mesh(from, :all, message) do
    own = Names.whereis(from, :comms)
    hear(for(comms <- Names.all(:comms), comms != own, do: comms), message)
    Mesh.speak(:all, message)
  end

  defp by_mesh(_from, ids, message) do
    {here, there} = Enum.split_with(ids, &(Names.whereis(&1, :comms) != nil))
    hear(for(id <- here, comms = Names.whereis(id, :comms), do: comms), message)
    if there != [], do: Mesh.speak(there, message), else: :ok
  end

  defp by_distribution(from, :all, message),
    do: by_distribution(from, List.delete(Directory.robots(), from), message)

  defp by_distribution(_from, ids, message) do
    {here, there} =
      Enum.split_with(Enum.flat_map(ids, &Directory.members({:robot, &1})), &(node(&1) == node()))

    for comms <- there, do: Nonblocking.cast(comms, {:hear, message})
    hear(here, message)
  end

  @doc "Passes a message to comms processes of this node, checked once for all of them."
  @spec hear([pid()], Message.t()) :: :ok
  def hear([], _message), do: :ok

  def hear(here, message) do
    checked = Checked.mark(message)
    for comms <- here, do: GenServer.cast(comms, {:hear, checked})
    :ok
  end
end
