defmodule Mesh.Supervisor do
  @moduledoc """
  Supervises the processes of a node's mesh.

      Mesh.Supervisor (rest_for_one)
      |-- Mesh.Server                    signed datagrams: beacons, heartbeats, rounds, rows, stops
      |-- Mesh.Dialer       connects the distribution, again and again
      |-- Mesh.CommandRelay              commands to nodes that this one is not connected to
      `-- Mesh.Distribution.Libcluster   where its topologies are configured

  A server that restarts has a new session: for the others it is a node that was away for a
  moment.
  """
  use Supervisor
  alias Mesh.{CommandRelay, Options}
  alias Mesh.Distribution.Libcluster
  alias Mesh.Dialer

  @doc """
  Starts the mesh of this node, with options from `Mesh.Options.prepare/1` and the module that
  receives what it hears (`Mesh.Consumer`).
  """
  @spec start_link({Options.t(), consumer :: module()}) :: Supervisor.on_start()
  def start_link({%Options{}, _consumer} = start),
    do: Supervisor.start_link(__MODULE__, start)

  @impl Supervisor
  def init({options, consumer} = start) do
    children =
      [{Mesh.Server, start}, {Dialer, options}, {CommandRelay, consumer}] ++ libcluster(options)

    Supervisor.init(children, strategy: :rest_for_one, max_restarts: 5, max_seconds: 5)
  end

  defp libcluster(%{topologies: []}), do: []

  defp libcluster(%{topologies: topologies}), do: [{Libcluster, topologies}]
end
