defmodule Lab.Node.Robot do
  @moduledoc """
  Runs one robot as the part of a node: the same tree as on a node with others.

      supervisor (one_for_all, no restarts: a robot that ends for good takes its node along)
      |-- Sim.World.Directory     where the world is
      |-- Lab.Fleet.RadioServer  a radio that loses, duplicates and delays messages, if any is to
      |-- Lab.Fleet.Hardware  emulated devices, if it has the real drivers
      `-- Robot.Fleet    the robot

  Options: `robot` as in `Lab.Trial.Setup`, `world`, `blobs`, `mission`, `plan`, `folder` as in
  `Lab.Fleet.Robot`, `radio` as `Lab.Fleet.RadioServer.parts/2` takes it.
  """
  @behaviour Lab.Node
  alias Lab.Fleet.{Hardware, RadioServer, Robot}
  alias Sim.World

  @impl Lab.Node
  def start(options) do
    children =
      [World.Directory] ++
        RadioServer.parts(options.radio) ++
        Hardware.parts([options.robot], options.world, options.folder) ++ [Elixir.Robot.Fleet]

    {:ok, supervisor} = Supervisor.start_link(children, strategy: :one_for_all, max_restarts: 0)
    part = fn id -> for {^id, pid, _, _} <- Supervisor.which_children(supervisor), do: pid end
    {transport, air} = RadioServer.radio(List.first(part.(RadioServer)))

    common = %{
      world: options.world,
      clock: Robot.clock(),
      transport: transport,
      blobs: options.blobs,
      mission: options.mission,
      plan: options.plan,
      trace: nil,
      replace: true,
      folder: options.folder
    }

    {:ok, pid} = Robot.start(hd(part.(Elixir.Robot.Fleet)), options.robot, common)
    Process.link(pid)
    {:ok, pid, %{}, {__MODULE__, :report, [options.robot.id, air]}}
  end

  @impl Lab.Node
  def begin(options) do
    # One that cannot arm says why in its status.
    _started = Robot.begin(options.robot.id)
    :ok
  end

  @doc "What the robot claims about itself, and how many messages it sent."
  @spec report(atom(), pid() | RadioServer.counter()) :: {map(), map()}
  def report(id, air), do: {Robot.claim(id), RadioServer.counts(air)}
end
