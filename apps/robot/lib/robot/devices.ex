defmodule Robot.Devices do
  @moduledoc """
  Supervises a robot's sensors and actuators, each of which is restarted alone:

      Robot.Devices (one_for_one)
      |-- Vision.BlobDetector  the newest frame to blobs and marks (only with a camera)
      |-- Vision.View          frames to pictures while there is a viewer (only with a camera)
      |-- Vision.Saver         keeps such pictures in a folder (only if told to)
      |-- Robot.Devices.Speech says aloud what becomes of the robot (only if told to)
      |-- Hal.Device :drive    wheels, ranges, bumpers, battery --> board, and what reflexes need
      |                        --> gate; whether the wheels may turn --> executive and pilot
      |-- Hal.Device :ptz      --> board, and where the camera looked --> blob detector
      |-- Hal.Device :scan     --> board, and what reflexes need --> gate (a lidar)
      `-- Hal.Device :camera   --> blob detector --> board, and --> view

  The blob detector is here, and not a direct child of the robot's supervisor, because a picture
  that crashes it must not restart the executive: the blobs on the board become stale, and the
  robot drives on.

  The restart budget, 200 restarts in 5 s, is above what bad input should cause: a camera gives at
  most 30 pictures a second that could crash the blob detector, and a device waits half a second
  before it exits. A child that crashes more often is taken to have a fault that restarts do not
  cure, and the robot's supervisor handles the failure.
  """
  use Supervisor
  alias Robot.{Board, Names}
  alias Robot.Control.Pilot
  alias Robot.Safety.Gate

  @roles [:blob_detector, :view, :saver, :speech, :drive, :ptz, :scan, :camera]
  @patience_ms 5_000

  @doc "Starts the devices of a robot whose board is running."
  @spec start_link(Robot.Config.t()) :: Supervisor.on_start()
  def start_link(%Robot.Config{} = config), do: Supervisor.start_link(__MODULE__, config)

  @impl Supervisor
  def init(%Robot.Config{id: id} = config) do
    for role <- @roles, pid = Names.whereis(id, role), do: :ok = await_end(pid)
    board = Board.find!(id)
    write = fn writer -> {Board, :sense, [board, writer]} end
    to_detector = {Vision.BlobDetector, :frame, [Names.via(id, :blob_detector)]}
    to_aim = {Vision.BlobDetector, :aim, [Names.via(id, :blob_detector)]}
    demand = Vision.View.demand()
    to_view = {Vision.View, :frame, [Names.via(id, :view), demand]}

    children =
      blob_detector(config, write.(:blob_detector)) ++
        view(config, demand) ++
        saver(config) ++
        speech(config) ++
        device(config, board, :drive, [
          write.(:drive),
          {Gate, :sense, [id]},
          {Pilot, :sense, [id]}
        ]) ++
        device(config, board, :ptz, [write.(:ptz) | if(config.camera, do: [to_aim], else: [])]) ++
        device(config, board, :scan, [write.(:scan), {Gate, :sense, [id]}]) ++
        device(config, board, :camera, [{__MODULE__, :health, [board]}, to_detector, to_view])

    Supervisor.init(children, strategy: :one_for_one, max_restarts: 200, max_seconds: 5)
  end

  # If a former supervisor was killed, its children end by themselves, a device after its last words, and have their
  # names till then. Without patience the few restarts of the robot's supervisor were used up meanwhile.
  defp await_end(pid) do
    ref = Process.monitor(pid)

    receive do
      {:DOWN, ^ref, :process, ^pid, _reason} -> :ok
    after
      @patience_ms ->
        Process.exit(pid, :kill)
        receive do: ({:DOWN, ^ref, :process, ^pid, _reason} -> :ok)
    end
  end

  @doc """
  A sink for the camera: puts its health on the board, and the detections of a camera that detects
  blobs itself. Frames are left to the blob detector.
  """
  @spec health(Board.t(), tuple()) :: :ok
  def health(board, {:health, device, _status} = reading), do: Board.sense(board, device, reading)

  def health(board, {:detections, _detections} = reading),
    do: Board.sense(board, :blob_detector, reading)

  def health(_board, _frame), do: :ok

  defp blob_detector(%Robot.Config{camera: nil}, _sink), do: []

  defp blob_detector(config, sink) do
    [
      {Vision.BlobDetector,
       colours: config.colours,
       marks: marks(config),
       sink: sink,
       ptz: config.ptz != nil,
       clock: config.clock,
       name: Names.via(config.id, :blob_detector)}
    ]
  end

  defp marks(%Robot.Config{marks: nil}), do: nil

  # The options have been checked.
  defp marks(%Robot.Config{marks: options}) do
    {:ok, marks} = Vision.Marks.new(Keyword.drop(options, [:known, :robots]))
    marks
  end

  defp view(%Robot.Config{camera: nil}, _demand), do: []

  defp view(config, demand),
    do: [{Vision.View, demand: demand, name: Names.via(config.id, :view)}]

  defp saver(%Robot.Config{save_pictures: nil}), do: []

  defp saver(%Robot.Config{id: id, save_pictures: options}) do
    ours = [prefix: Atom.to_string(id), view: Names.via(id, :view), name: Names.via(id, :saver)]
    [{Vision.Saver, options ++ ours}]
  end

  defp speech(%Robot.Config{say: nil}), do: []
  defp speech(%Robot.Config{id: id, say: options}), do: [{Robot.Devices.Speech, {id, options}}]

  @doc false
  def disarmed?(board), do: match?({:ok, true, _at_ms}, Board.fetch(board, :disarmed, :infinity))

  defp device(config, board, kind, sinks) do
    case Map.fetch!(config, kind) do
      nil ->
        []

      driver ->
        [
          {Hal.Device,
           kind: kind,
           driver: driver,
           arm: if(config.dry_run, do: :never, else: config.arm),
           sonar: kind == :drive and config.profile.sonars != [],
           was: {Board, :health, [board, kind]},
           disarmed: {__MODULE__, :disarmed?, [board]},
           about: %{robot: config.id},
           sinks: sinks,
           clock: config.clock,
           name: Names.via(config.id, kind)}
        ]
    end
  end
end
