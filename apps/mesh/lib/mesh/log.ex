defmodule Mesh.Log do
  @moduledoc """
  Logs events of the mesh: one line for what a person may want to know. Everything else in the
  mesh emits only events.
  """
  require Logger
  alias Hal.Event

  @events [
    :up,
    :gone,
    :connected,
    :disconnected,
    :no_network,
    :network,
    :unknown_node,
    :foreign,
    :duplicate_node,
    :unique_node,
    :libcluster
  ]

  @doc "Attaches the log to the mesh's events; once per node."
  @spec attach() :: :ok
  def attach do
    for event <- @events do
      _ = Event.attach({__MODULE__, event}, [:mesh, event], &__MODULE__.write/4, nil)
    end

    :ok
  end

  @doc false
  @spec write(Event.name(), map(), map(), term()) :: :ok
  def write([:mesh, event], _measurements, about, _config) do
    {level, line} = line(event, about)
    Logger.log(level, line)
  end

  @doc """
  The log line of an event.

      iex> Mesh.Log.line(:gone, %{node: :mag1@lab})
      {:info, "mesh: mag1@lab is gone"}
  """
  @spec line(atom(), map()) :: {Logger.level(), String.t()}
  def line(:up, %{node: node}), do: {:info, "mesh: hears #{node}"}
  def line(:gone, %{node: node}), do: {:info, "mesh: #{node} is gone"}
  def line(:connected, %{node: node}), do: {:debug, "mesh: connected to #{node}"}
  def line(:disconnected, %{node: node}), do: {:debug, "mesh: not connected to #{node} any more"}

  def line(:no_network, %{line: line}),
    do: {:warning, "mesh: no network, other robots are neither heard nor reached: #{line}"}

  def line(:network, _about), do: {:info, "mesh: the network is there again"}

  def line(:unknown_node, %{name: name, address: {ip, _port}}) do
    {:warning,
     "mesh: #{inspect(name)} at #{:inet.ntoa(ip)} has the fleet's secret, but is not in this node's " <>
       "fleet or has another host part; see the option fleet"}
  end

  def line(:foreign, %{name: name, address: {ip, port}}) do
    {:warning,
     "mesh: a datagram of #{name} came from #{:inet.ntoa(ip)}:#{port}, which is not an address of that node: " <>
       "somebody forwards it, or a router changes addresses; see the option addresses"}
  end

  def line(:libcluster, %{reason: reason}),
    do: {:warning, "mesh: libcluster ended, and starts again: #{inspect(reason, limit: 10)}"}

  def line(:duplicate_node, %{node: node, address: ip}) do
    {:error,
     "mesh: another node, at #{:inet.ntoa(ip)}, calls itself #{node}, too; others hear one of the two only; " <>
       "rename one"}
  end

  def line(:unique_node, %{node: node}),
    do: {:warning, "mesh: no other node calls itself #{node} any more"}
end
