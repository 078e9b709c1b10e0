defmodule Swarm.MeshConsumer do
  @moduledoc """
  Receives what the mesh hears for the robots of this node: messages and commands go to their
  comms processes, the terms of services go to the blackboard and the emergency stop.
  """
  alias Robot.Names
  alias Swarm.Order.{Freshness, Giver}
  alias Swarm.{Blackboard, Comms, EStop, Message, MissionRegistry, Transport}

  @behaviour Mesh.Consumer

  # Atoms in messages are known once the modules that contain them are loaded, which without a
  # release happens at their first call: a robot that has just been switched on would not
  # understand what a leader sends.
  @impl Mesh.Consumer
  def services do
    :ok = MissionRegistry.load()
    %{rows: {Blackboard, :hear, []}, stop: {EStop, :hear, []}}
  end

  @impl Mesh.Consumer
  def late, do: [:stop]

  @impl Mesh.Consumer
  def read(term) do
    case Message.check(term) do
      {:ok, message} -> {:ok, message, %{robots: authors(message), beat: beat(message)}}
      {:error, _reason} -> :error
    end
  end

  defp authors(%Message{kind: :relay, from: from, body: inner}), do: [from | authors(inner)]
  defp authors(%Message{from: from}), do: [from]

  defp beat(%Message{kind: :heartbeat, body: beat}), do: {beat.boot, beat.sequence}
  defp beat(_other), do: nil

  @impl Mesh.Consumer
  def deliver(:all, node, message) do
    rival(message, node)
    Transport.hear(Names.all(:comms), message)
  end

  def deliver(ids, _node, message) do
    Transport.hear(for(id <- ids, comms = Names.whereis(id, :comms), do: comms), message)
  end

  # A robot on another node has the name of one of this node.
  defp rival(%Message{kind: :heartbeat, from: from, body: beat}, node),
    do: if(Names.whereis(from, :comms), do: Comms.rival(from, {beat.boot, node}))

  defp rival(_other, _node), do: :ok

  @impl Mesh.Consumer
  def command(robot, request) do
    comms = Names.whereis(robot, :comms)
    if comms != nil and relayed?(request), do: GenServer.cast(comms, named(request)), else: :error
  end

  # Otherwise it would seem to be given by the node of the reference, which is this one.
  defp named({:command, request, ref}), do: {:command, request, ref, {:by, "another node"}}

  defp named({:command, request, ref, stamp}),
    do: {:command, request, ref, stamp, "another node"}

  defp named(request), do: request

  # The reference is one of this node, so that only the stamp tells when an order was given.
  defp relayed?({:stamp, ref}), do: is_reference(ref)

  defp relayed?({:command, request, ref}),
    do: is_reference(ref) and not Freshness.needed?(request)

  defp relayed?({:command, _request, ref, stamp}),
    do: is_reference(ref) and Freshness.stamp?(stamp)

  defp relayed?({:command, request, ref, stamp, giver}),
    do: Giver.text(giver) != nil and relayed?({:command, request, ref, stamp})

  defp relayed?(_other), do: false
end
