defmodule Lab.Node.Robot do
  @moduledoc """
  Runs one robot as the part of a node: the same tree as on a node with others.

      supervisor (one_for_all, no restarts: a robot that ends for good takes its node along)
      |-- Sim.World.Directory     where the world is
      |-- Sim.World.Line          the way to a world that is on no node of the same network
      |-- Lab.RadioServer  a radio that loses, duplicates and delays messages, if any is to
      |-- Lab.VirtualRobot.Hardware  emulated devices, if it has the real drivers
      `-- supervisor (one_for_one)  what else the fleet wants to run beside the robot

  Options: `robot` as in `Lab.Trial.Setup`, `world`, `blobs`, `marks`, `mission`, `plan`, `folder` as in
  `Lab.VirtualRobot`, `radio` as `Lab.RadioServer.parts/2` takes it; `line`, the path of `Sim.World.Line`;
  `beside`, more children; `restart: :permanent` for a robot that is started again for ever, as in a release.
  """
  @behaviour Lab.Node
  alias Robot.Departure.Note
  alias Lab.VirtualRobot
  alias Lab.VirtualRobot.Hardware
  alias Lab.RadioServer
  alias Sim.World

  @impl Lab.Node
  def start(options) do
    id = options.robot.id

    options =
      Map.merge(%{line: nil, beside: [], restart: :temporary, plan: nil, marks: nil}, options)

    options = Map.put_new(options, :radio, %{seed: 0})

    children =
      [World.Directory] ++
        if(options.line, do: [World.Line.robot(options.line, options.world)], else: []) ++
        RadioServer.parts(options.radio) ++
        Hardware.parts([options.robot], options.world, options.folder) ++ beside(options.beside)

    {:ok, supervisor} = Supervisor.start_link(children, strategy: :one_for_all, max_restarts: 0)
    airs = for {RadioServer, pid, _, _} <- Supervisor.which_children(supervisor), do: pid
    {transport, air} = RadioServer.radio(List.first(airs))

    common = %{
      world: options.world,
      clock: VirtualRobot.clock(),
      transport: transport,
      blobs: options.blobs,
      marks: options.marks,
      mission: options.mission,
      plan: options.plan,
      trace: nil,
      replace: true,
      folder: options.folder
    }

    # Whatever starts the node says where the robot stands.
    if options.robot.hardware?,
      do: Note.delete(Hardware.drivers(options.robot, options.folder)[:departure_file])

    {:ok, pid} = VirtualRobot.start(Robot.Fleet, options.robot, common, options.restart)
    if options.restart == :temporary, do: Process.link(pid)
    {:ok, nil, {__MODULE__, :report, [id, air]}}
  end

  # Some crash beside a robot whose processes are killed.
  defp beside([]), do: []

  defp beside(children) do
    start = {Supervisor, :start_link, [children, [strategy: :one_for_one, max_restarts: 1_000]]}
    [%{id: :beside, type: :supervisor, start: start}]
  end

  @doc "What the robot claims about itself, and how many messages it sent."
  @spec report(atom(), pid() | RadioServer.counter()) :: {map(), map()}
  def report(id, air), do: {VirtualRobot.claim(id), RadioServer.counts(air)}
end
