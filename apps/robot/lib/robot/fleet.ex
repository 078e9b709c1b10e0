defmodule Robot.Fleet do
  @moduledoc """
  Supervises the robots of this node: one on a real machine, any number in a simulation.

  A simulated robot whose supervisor ends is not restarted, and the others continue
  (`:temporary`). A real robot is `:permanent`: the fleet has a restart budget of zero, so it ends
  with the robot, and so does the application; the machine's supervisor is expected to start
  everything afresh.
  """
  use DynamicSupervisor
  alias Robot.Names

  @doc "Starts a fleet without robots. `:name` as in `GenServer`."
  @spec start_link(keyword()) :: Supervisor.on_start()
  def start_link(options),
    do: DynamicSupervisor.start_link(__MODULE__, [], Keyword.take(options, [:name]))

  @doc "Starts a robot. `restart` determines whether its end also ends the fleet, see above."
  @spec start_robot(Supervisor.supervisor(), Robot.Config.t(), :temporary | :permanent) ::
          {:ok, pid()} | {:error, {:already_started, pid()} | term()}
  def start_robot(fleet, %Robot.Config{} = config, restart \\ :temporary)
      when restart in [:temporary, :permanent] do
    child = Supervisor.child_spec({Robot.Supervisor, config}, restart: restart)
    DynamicSupervisor.start_child(fleet, child)
  end

  @doc "Ends a robot; the drive's device stops the wheels."
  @spec stop_robot(Supervisor.supervisor(), robot :: atom()) :: :ok | {:error, :unknown}
  def stop_robot(fleet, robot) do
    with pid when is_pid(pid) <- Names.whereis(robot, :robot),
         :ok <- DynamicSupervisor.terminate_child(fleet, pid) do
      :ok
    else
      _none_or_another_fleets -> {:error, :unknown}
    end
  end

  @impl DynamicSupervisor
  def init([]), do: DynamicSupervisor.init(strategy: :one_for_one, max_restarts: 0)
end
