defmodule Swarm.Supervisor do
  @moduledoc """
  The processes of which a node has one each, however many robots run on it.

      Swarm.Supervisor (no restarts to give)
      |-- Robot.Names                   who is who on this node
      |-- Swarm.Supervisor.Parts (one_for_one), each in the care of a Swarm.Supervisor.BackoffSupervisor
      |   |-- Swarm.Directory           who is where in the fleet
      |   |-- Swarm.Blackboard          what the robots tell of themselves, and leave for each other
      |   |-- Swarm.Directory.Presence  tells who joins and leaves
      |   |-- Swarm.EStop.Broadcaster   calls all robots to stop
      |   |-- Mesh.Supervisor           the other nodes, where there is a mesh; Swarm.MeshConsumer hears it
      |   `-- Swarm.Host.Systemd        tells systemd, where there is one
      `-- Robot.Fleet                   the robots

  Robots do without these parts: they drive on, and enter a new directory by themselves. However
  often a part falls, it is started again, and no robot ends for it. A fleet that
  ended, and names that are gone, cannot be replaced by empty ones, under which the node would look
  well without its robots: then the application ends, and the machine's supervisor starts it afresh.
  """
  use Supervisor

  defmodule Parts do
    @moduledoc false
    use Supervisor
    alias Swarm.MeshConsumer
    alias Swarm.Supervisor.BackoffSupervisor

    @doc false
    def start_link(options), do: Supervisor.start_link(__MODULE__, options)

    @impl Supervisor
    def init(options) do
      mesh = for mesh <- List.wrap(options[:mesh]), do: {Mesh.Supervisor, {mesh, MeshConsumer}}

      machine = for {:machine, machine} <- options, do: {Swarm.Host.Systemd, machine}

      children = [
        Swarm.Directory,
        Swarm.Blackboard,
        Swarm.Directory.Presence,
        Swarm.EStop.Broadcaster | mesh ++ machine
      ]

      tireless = for child <- children, do: {BackoffSupervisor, child}
      Supervisor.init(tireless, strategy: :one_for_one, max_restarts: 5, max_seconds: 5)
    end
  end

  @doc """
  Starts the node's parts, without a robot; `mesh` as prepared by `Mesh.Options.prepare/1`, `machine` the
  options of `Swarm.Host.Systemd`.
  """
  @spec start_link(keyword()) :: Supervisor.on_start()
  def start_link(options), do: Supervisor.start_link(__MODULE__, options)

  @impl Supervisor
  def init(options) do
    children = [Robot.Names, {Parts, options}, {Robot.Fleet, name: Robot.Fleet}]
    Supervisor.init(children, strategy: :rest_for_one, max_restarts: 0)
  end
end
