defmodule Swarm.Comms.Transport do
  @moduledoc """
  How a robot's messages reach others: those of this node get them straight into their comms processes, those
  of other nodes by the mesh's datagrams. A node without a mesh speaks to those that somebody has
  connected by hand, over Erlang's distribution.
  """
  alias Robot.Names
  alias Swarm.{Directory, Mesh, Message, Nonblocking}

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
  The transport of links (`Swarm.Comms`). With a mesh the robot's own heartbeats go to everybody known, whoever is named.
  Nobody is waited for.
  """
  @spec transmit(from :: atom(), [atom()], Message.t()) :: :ok
  def transmit(from, ids, %Message{} = message) do
    if Mesh.running?() do
      {here, there} = Enum.split_with(ids, &(Names.whereis(&1, :link) != nil))
      for id <- here, do: GenServer.cast(Names.via(id, :link), {:hear, message})
      to = if own_beat?(from, message), do: :all, else: there
      if to != [], do: Mesh.speak(to, message)
      :ok
    else
      for id <- ids,
          link <- Directory.members({:robot, id}),
          do: Nonblocking.cast(link, {:hear, message})

      :ok
    end
  end

  # One that is passed on for another robot is meant for those named.
  defp own_beat?(from, %Message{kind: kind, from: author}),
    do: kind == :heartbeat and author == from
end
