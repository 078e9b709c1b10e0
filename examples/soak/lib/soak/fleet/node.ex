defmodule Soak.Fleet.Node do
  @moduledoc """
  Describes what runs on a robot's node of `bin/soak`: the applications as in a release, whose end ends the node, one
  robot in the world of `Soak.WorldHost`, and the log of its doings (`Soak.Recorder`).
  """
  alias Soak.{Recorder, WorldHost}
  alias Lab.Fleet.Hardware
  alias Lab.Trial.Setup
  alias Sim.World

  @doc """
  Starts the robot. `about` holds its `id`, its `start` (a pose), whether it has the real drivers
  (`hardware?`), the options of its `mesh`, the missions of this build, and the `folder` of the run.
  """
  @spec main(map()) :: :ok
  def main(%{id: id, folder: folder} = about) do
    # Together, so that the missions are there when the mesh begins: it must know their atoms.
    config = [logger: [level: :none], swarm: [missions: about.missions, mesh: about.mesh]]
    Application.put_all_env(config)
    {:ok, _apps} = Application.ensure_all_started(:lab, :permanent)

    children =
      [World.Directory, {WorldHost.Link, {world(id), WorldHost.path(folder, id), id}}] ++
        Hardware.parts([robot(about)], world(id), folder) ++ [{Recorder, {folder, id}}]

    {:ok, parts} = Supervisor.start_link(children, strategy: :one_for_one, max_restarts: 1_000)
    Process.unlink(parts)
    config = config(about)
    # Whoever starts the node says where the robot stands.
    if config.departure_file, do: Robot.Departure.Note.delete(config.departure_file)
    {:ok, _robot} = Robot.Fleet.start_robot(Robot.Fleet, config, :permanent)
    :ok
  end

  # By a name of its own: connected nodes share their directories.
  defp world(id), do: {:soak, id}

  defp robot(%{id: id, hardware?: hardware?}),
    do: %{id: id, profile: Setup.profile(id), hardware?: hardware?}

  defp config(%{id: id, start: start, missions: [{_name, mission} | _]} = about) do
    device = [world: world(id), robot: id]

    drivers =
      if about.hardware?,
        do: Hardware.drivers(robot(about), about.folder),
        else: [drive: {Sim.Device.Drive, device}, ptz: {Sim.Device.Ptz, device}]

    Robot.Config.new!(
      [
        id: id,
        profile: Setup.profile(id),
        start: start,
        camera: {Sim.Device.Camera, device ++ [blobs: :direct]},
        colours: World.colours(),
        mission: {mission, []}
      ] ++ drivers
    )
    |> Swarm.Comms.join()
  end
end
