defmodule Swarm.Application do
  @moduledoc false
  use Application
  require Logger
  alias Mesh.{Log, Options}
  alias Mesh.Distribution.ConnectionLog
  alias Swarm.MemberSpec
  alias Swarm.Message.Checked
  alias Swarm.Host.{DepartureFile, ReleaseBoot, Systemd}

  # With `config :swarm, boot: true`, as in a release, the node is the robot that its environment
  # names.
  @impl Application
  def start(_type, _arguments) do
    :ok = ask_name_servers()
    :ok = Checked.begin()
    environment = System.get_env()
    :ok = Robot.Devices.Log.attach()

    with {:ok, robot} <- robot(Application.get_env(:swarm, :boot, false), environment),
         {:ok, mesh} <- mesh(Application.get_env(:swarm, :mesh, false), robot),
         {:ok, recorder} <- recorder(robot),
         machine = machine(robot, environment) ++ recorder,
         {:ok, supervisor} <- Swarm.Supervisor.start_link(mesh ++ machine),
         :ok <- begin(robot) do
      {:ok, supervisor}
    end
  end

  @impl Application
  def stop(_state), do: ask_none()

  defp robot(false, _environment), do: {:ok, :none}

  defp robot(true, environment) do
    case ReleaseBoot.robot(environment) do
      {:ok, {file, config}} ->
        {:ok,
         {file,
          %{
            config
            | departure_file: DepartureFile.prepare(DepartureFile.of(file.id, environment))
          }}}

      {:ok, nil} ->
        {:ok, nil}

      {:error, lines} ->
        Enum.each(lines, &Logger.error/1)
        {:error, hd(lines)}
    end
  end

  defp mesh(false, _robot), do: {:ok, []}

  defp mesh(options, robot) do
    network = with {file, _config} <- robot, do: MemberSpec.mesh(file), else: (_none -> [])

    with {:ok, mesh} <- Options.prepare(Keyword.merge(options, network)) do
      :ok = Log.attach()
      :ok = ConnectionLog.install()
      {:ok, [mesh: mesh]}
    end
  end

  defp machine(:none, _environment), do: []

  defp machine(robot, environment) do
    id = with {file, _config} <- robot, do: file.id

    case Systemd.from_env(environment, id, System.pid()) do
      nil -> []
      options -> [machine: options]
    end
  end

  defp recorder({file, _config}) do
    with {:ok, recorders} <- MemberSpec.recorders(file),
         do: {:ok, for(recorder <- recorders, do: {:recorder, recorder})}
  end

  defp recorder(_none), do: {:ok, []}

  defp begin({_file, config}) do
    with {:ok, _robot} <- Robot.Fleet.start_robot(Robot.Fleet, config, :permanent) do
      Logger.info("#{config.id} is up; its wheels #{wheels(config.arm)}")
    end
  end

  defp begin(_none), do: :ok

  defp wheels(:manual), do: "stand until a person arms them"
  defp wheels(:auto), do: "arm by themselves"

  # Lets a node ask name servers once it is up. Erlang asks for the name of its machine when it starts, and would wait for
  # a name server that does not answer; so the scripts start it with `RES_OPTIONS=attempts:0`, by which the C library asks
  # none, and keep in `CONVOY_RES_OPTIONS` what was there before. Programs that the node starts, such as one that reads a
  # camera by its name, inherit its environment.

  @kept "CONVOY_RES_OPTIONS"
  @options "RES_OPTIONS"

  # Name servers are asked from now on, by this node and by what it starts.
  defp ask_name_servers do
    case System.get_env(@kept) do
      nil -> :ok
      "" -> again(System.delete_env(@options))
      options -> again(System.put_env(@options, options))
    end
  end

  # The program that asks for Erlang still has the old environment.
  defp again(:ok) do
    _answer = :inet_gethost_native.control(:soft_restart)
    :ok
  end

  # As before the start, for a restart within the same process of the operating system.
  defp ask_none,
    do: if(System.get_env(@kept), do: System.put_env(@options, "attempts:0"), else: :ok)
end
