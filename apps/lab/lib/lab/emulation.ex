defmodule Lab.Emulation do
  @moduledoc """
  Runs the devices of one robot on serial lines, with its body in a world behind them: for programs that drive a real robot, and
  for people that have none. What drives it is another program.

      supervisor (one_for_all, no restarts)
      |-- Sim.World.Directory     unless another fleet of this node has it already
      |-- Sim.World.Server        the world
      `-- Lab.VirtualRobot.Hardware  its base, the head of its camera, its lidar
  """
  alias Hal.{Pose, Twist}
  alias Lab.Fleet.Folder
  alias Lab.Trial.Setup
  alias Lab.VirtualRobot.Hardware
  alias Sim.{Emulator, World}

  @enforce_keys [:supervisor, :world, :base, :robot, :links]
  defstruct @enforce_keys

  @typedoc "`links` are the symbolic links to the lines: `base`, and `camera` and `scan` where the body has them."
  @type t :: %__MODULE__{
          supervisor: pid(),
          world: pid(),
          base: pid(),
          robot: Setup.robot(),
          links: [{what :: String.t(), Path.t()}]
        }

  @doc """
  Starts it, linked to the caller. Options are those of `Lab.Trial.Setup.new/1`, with one robot that has its real devices
  (`hardware`). The error is one line.
  """
  @spec start_link(map()) :: {:ok, t()} | {:error, line :: String.t()}
  def start_link(options) do
    with {:ok, %{robots: [%{hardware?: true} = robot]} = setup} <- Setup.new(options),
         {:ok, folder} <- Folder.make() do
      name = make_ref()
      directory = if World.Directory.running?(), do: [], else: [World.Directory]

      world = %{
        id: World.Server,
        start: {World.Server, :start_link, [[name: name, world: setup.world]]}
      }

      parts = directory ++ [world] ++ Hardware.parts([robot], name, folder)
      {:ok, supervisor} = Supervisor.start_link(parts, strategy: :one_for_all, max_restarts: 0)

      {:ok,
       %__MODULE__{
         supervisor: supervisor,
         world: child(supervisor, World.Server),
         base: supervisor |> child(Hardware) |> child({robot.id, :base}),
         robot: robot,
         links: Hardware.links(robot, folder)
       }}
    else
      {:ok, _without} -> {:error, "this body has no controller that could be emulated"}
      {:error, line} -> {:error, line}
    end
  end

  defp child(supervisor, id) do
    {^id, pid, _type, _modules} = supervisor |> Supervisor.which_children() |> List.keyfind(id, 0)

    pid
  end

  @doc "Where its body is, and the speed that its motors give its wheels."
  @spec look(t()) :: {Pose.t(), Twist.t()}
  def look(%__MODULE__{} = emulation) do
    pose = emulation.world |> World.Server.world() |> World.truth(emulation.robot.id)
    {pose, Emulator.wheels(emulation.base)}
  end
end
