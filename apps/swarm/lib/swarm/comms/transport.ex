defmodule Swarm.Comms.Transport do
  @moduledoc """
  How a robot's messages reach others: those of this node get them straight into their comms processes, those
  of other nodes by the mesh's datagrams. A node without a mesh speaks to those that somebody has
  connected by hand, over Erlang's distribution.
  """
  alias Robot.Names
  alias Mesh.Nonblocking
  alias Swarm.{Directory, Message}

  @doc """
  All robots that can be spoken to, sorted: in the directory, heard by radio from nodes that this one
  is not connected to, or heard by others that are.
  """
  @spec robots() :: [atom()]
  def robots do
    case Map.keys(Mesh.robots()) do
      [] -> Directory.robots()
      heard -> Enum.uniq(Enum.sort(Directory.robots() ++ heard ++ Mesh.beyond()))
    end
  end

  @doc """
  The transport of links (`Swarm.Comms`): to these robots, or to all others that can be reached without asking who
  that is. Nobody is waited for.
  """
  @spec transmit(from :: atom(), :all | [atom()], Message.t()) :: :ok
  def transmit(from, to, %Message{} = message) do
    if Mesh.running?(),
      do: by_mesh(from, to, message),
      else: by_distribution(from, to, message)
  end

  defp by_mesh(from, :all, message) do
    own = Names.whereis(from, :comms)
    for link <- Names.all(:comms), link != own, do: GenServer.cast(link, {:hear, message})
    Mesh.speak(:all, message)
  end

  defp by_mesh(_from, ids, message) do
    {here, there} = Enum.split_with(ids, &(Names.whereis(&1, :comms) != nil))
    for id <- here, do: GenServer.cast(Names.via(id, :comms), {:hear, message})
    if there != [], do: Mesh.speak(there, message), else: :ok
  end

  defp by_distribution(from, :all, message),
    do: by_distribution(from, List.delete(Directory.robots(), from), message)

  defp by_distribution(_from, ids, message) do
    for id <- ids,
        link <- Directory.members({:robot, id}),
        do: Nonblocking.cast(link, {:hear, message})

    :ok
  end
end
