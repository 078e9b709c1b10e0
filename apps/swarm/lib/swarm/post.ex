defmodule Swarm.Post do
  @moduledoc """
  How one process sends to another that may be on another node: so that nothing ever waits for a
  node that has gone silent. Without these options a send waits for a full buffer, or dials a node
  that is gone. What cannot be sent now is lost.

  The ways of the mesh (`Swarm.Mesh`), where there is one, are here too: on a node without a mesh they
  lead nowhere. The mesh hands on to robots, and so it cannot be called by name from below them.
  """

  @mesh :"Elixir.Swarm.Mesh"

  @doc "Casts to a `GenServer`, wherever it is."
  @spec cast(pid(), term()) :: :ok
  def cast(pid, term) do
    :erlang.send(pid, {:"$gen_cast", term}, [:nosuspend, :noconnect])
    :ok
  end

  @doc "Answers to who asked with this reference, an alias (`Swarm.Door.Ask`)."
  @spec answer(reference(), term()) :: :ok
  def answer(ref, answer) do
    :erlang.send(ref, {ref, answer}, [:nosuspend, :noconnect])
    :ok
  end

  @doc "A signed datagram to all other nodes, which may be lost."
  @spec radio(service :: atom(), term()) :: :ok
  def radio(service, term) do
    if function_exported?(@mesh, :cast, 2), do: apply(@mesh, :cast, [service, term])
    :ok
  end

  @doc "The robots of other nodes that the mesh hears, with their nodes."
  @spec heard() :: %{atom() => node()}
  def heard do
    if function_exported?(@mesh, :robots, 0), do: apply(@mesh, :robots, []), else: %{}
  end

  @doc "Casts to the link of a robot that is not connected, over nodes that are; the answer comes to `ref`."
  @spec relay(robot :: atom(), term(), reference()) :: :ok
  def relay(robot, term, ref) do
    if function_exported?(@mesh, :relay, 3), do: apply(@mesh, :relay, [robot, term, ref])
    :ok
  end
end
