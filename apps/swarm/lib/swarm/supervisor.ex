defmodule Swarm.Supervisor do
  @moduledoc """
  Supervises the processes of which a node has one each, however many robots run on it.

      Swarm.Supervisor (no restarts to give)
      |-- Robot.Names                   the processes of this node's robots
      |-- Swarm.Supervisor.Parts (one_for_one), each in the care of a Swarm.Supervisor.BackoffSupervisor
      |   |-- Swarm.Directory           finds robots on all nodes
      |   |-- Swarm.Blackboard          what robots publish about themselves, and for each other
      |   |-- Swarm.Discovery.Presence  notifies of robots that join and leave
      |   |-- Swarm.EStop.Broadcaster   calls all robots to stop
      |   |-- Swarm.Replacement         gives the robots of this node other missions
      |   |-- Mesh.Supervisor           the other nodes, where there is a mesh; Swarm.MeshConsumer hears it
      |   |-- Swarm.Host.Systemd        tells systemd, where there is one
      |   `-- the recorder              records the robot, if its file says so (`Swarm.MemberSpec.recorders/1`)
      `-- Robot.Fleet                   the robots

  Robots can do without these parts: they drive on, and enter a new directory by themselves.
  However often a part crashes, it is started again, and no robot ends because of it. If the fleet
  or the names end, they cannot be replaced by empty ones, with which the node would look well
  without its robots: then the application ends, and the machine's supervisor starts it again.
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
      recorder = for {:recorder, recorder} <- options, do: recorder

      children = [
        Swarm.Directory,
        Swarm.Blackboard,
        Swarm.Discovery.Presence,
        Swarm.EStop.Broadcaster,
        Swarm.Replacement | mesh ++ machine ++ recorder
      ]

      tireless = for child <- children, do: {BackoffSupervisor, child}
      Supervisor.init(tireless, strategy: :one_for_one, max_restarts: 5, max_seconds: 5)
    end
  end

  @doc """
  Starts the parts of the node, without a robot; `mesh` comes from `Mesh.Options.prepare/1`,
  `machine` are the options of `Swarm.Host.Systemd`, `recorder` a child that records the robot.
  """
  @spec start_link(keyword()) :: Supervisor.on_start()
  def start_link(options), do: Supervisor.start_link(__MODULE__, options)

  @impl Supervisor
  def init(options) do
    children = [Robot.Names, {Parts, options}, {Robot.Fleet, name: Robot.Fleet}]
    Supervisor.init(children, strategy: :rest_for_one, max_restarts: 0)
  end
end
