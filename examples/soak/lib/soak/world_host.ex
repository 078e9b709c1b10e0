defmodule Soak.WorldHost do
  @moduledoc """
  Runs the world in a process of the operating system of its own: `Sim.World.Server`, and for each robot a line over a
  socket of the file system (`Soak.WorldHost.Line`).

  Five times a second it writes what has changed since the start of the run (`Sim.World.Snapshot`) to a file,
  whole or not at all; from that the world is started again after a `kill -9`.
  """
  use GenServer
  alias Soak.WorldHost.Line
  alias Hal.{Pose, Ticker}
  alias Sim.World
  alias Sim.World.Snapshot

  @period_ms 200

  @doc "Starts the world of this node; `robots` are whose lines `folder` gets as `NAME.world`."
  @spec main(World.t(), Path.t()) :: :ok
  def main(world, folder) do
    {:ok, _apps} = Application.ensure_all_started(:sim)

    world =
      with {:ok, _at_us, last} <- read(folder), do: Snapshot.onto(world, last), else: (_ -> world)

    lines =
      for robot <- world.order,
          do: %{id: {:line, robot}, start: {Line, :start_link, [path(folder, robot), robot]}}

    children =
      [World.Directory, {World.Server, name: :soak, world: world}] ++
        lines ++ [{__MODULE__, folder}]

    {:ok, parts} = Supervisor.start_link(children, strategy: :one_for_all, max_restarts: 0)
    Process.unlink(parts)
    :ok
  end

  @doc "The socket of a robot's line."
  @spec path(Path.t(), atom()) :: Path.t()
  def path(folder, robot), do: Path.join(folder, "#{robot}.world")

  @doc "The last snapshot that was written, and when, in microseconds of the machine's time."
  @spec read(Path.t()) :: {:ok, at_us :: integer(), Snapshot.t()} | {:error, File.posix()}
  def read(folder) do
    with {:ok, bytes} <- File.read(file(folder)) do
      {at_us, snapshot} = :erlang.binary_to_term(bytes)
      {:ok, at_us, snapshot}
    end
  end

  @doc "How many collisions there had been by then, and the newest of them in words, newest first."
  @spec collisions(Snapshot.t(), World.t()) :: {non_neg_integer(), [String.t()]}
  def collisions(snapshot, begun) do
    world = Snapshot.onto(begun, snapshot)
    {world.collisions, Enum.map(world.contacts, &contact/1)}
  end

  defp contact({at_ms, parties, with_what}) do
    wall = if with_what == :wall, do: " and a wall", else: ""
    "at #{at_ms} ms of the world " <> Enum.map_join(parties, " and ", &party/1) <> wall
  end

  defp party({id, {x, y}, linear}) do
    [x, y, linear] = for metres <- [x, y, linear], do: Float.round(metres, 2)
    "#{id} at (#{x}, #{y}), told #{linear} m/s"
  end

  @doc """
  Where the wheels of a robot would have begun to count, by where its body was then: what a person tells a robot
  that is switched on again. With `:zero` its wheels count from nothing.
  """
  @spec start(Snapshot.t(), World.t(), atom(), :zero | :on) :: Pose.t()
  def start(snapshot, begun, robot, wheels) do
    %{pose: pose, odometry: odometry} = Snapshot.onto(begun, snapshot).robots[robot]
    zero = Pose.new(0.0, 0.0)
    if wheels == :zero, do: pose, else: Pose.compose(pose, Pose.relative(odometry, zero))
  end

  @doc "Moves the landmark of this node's world."
  @spec move({float(), float()}) :: :ok
  def move(place) do
    with server when is_pid(server) <- World.Directory.find(:soak),
         do: World.Server.change(server, {:move, place}),
         else: (nil -> :ok)
  end

  defp file(folder), do: Path.join(folder, "world.snapshot")

  @doc "Starts the writer of snapshots."
  @spec start_link(Path.t()) :: GenServer.on_start()
  def start_link(folder), do: GenServer.start_link(__MODULE__, folder)

  @impl GenServer
  def init(folder),
    do: {:ok, %{folder: folder, ticker: Ticker.start(:write, @period_ms, @period_ms)}}

  @impl GenServer
  def handle_info(:write, s) do
    world = World.Server.world(World.Directory.find(:soak))
    term = {:os.perf_counter(:microsecond), Snapshot.of(world)}
    aside = file(s.folder) <> ".new"
    File.write!(aside, :erlang.term_to_binary(term))
    File.rename!(aside, file(s.folder))
    {:noreply, %{s | ticker: Ticker.next(s.ticker)}}
  end
end
