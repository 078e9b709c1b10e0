defmodule Bench.Soak.WorldHost do
  @moduledoc """
  The world in a process of the operating system of its own: `Sim.World.Server`, and for each robot a line
  over a socket of the file system (`Bench.Soak.WorldLink`). A line stands in for the robot's devices: it
  attaches processes of its own, which end with it.

  Five times a second it writes what has changed since the start of the run (`Sim.World.Snapshot`) to a file,
  whole or not at all; from that the world is started again after a `kill -9`.
  """
  use GenServer
  alias Hal.Ticker
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
          do: %{id: {:line, robot}, start: {__MODULE__, :listen, [folder, robot]}}

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

  @doc "How many collisions there had been by then."
  @spec collisions(Snapshot.t(), World.t()) :: non_neg_integer()
  def collisions(snapshot, begun), do: Snapshot.onto(begun, snapshot).collisions

  @doc "Where a robot's body was then."
  @spec pose(Snapshot.t(), World.t(), atom()) :: Hal.Pose.t()
  def pose(snapshot, begun, robot), do: Snapshot.onto(begun, snapshot).robots[robot].pose

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

  @doc false
  @spec listen(Path.t(), atom()) :: {:ok, pid()}
  def listen(folder, robot),
    do: Task.start_link(__MODULE__, :accept, [path(folder, robot), robot])

  @doc false
  @spec accept(Path.t(), atom()) :: no_return()
  def accept(path, robot) do
    _ = File.rm(path)
    options = [:binary, packet: 4, active: false, ifaddr: {:local, path}]
    {:ok, listener} = :gen_tcp.listen(0, options)
    again(listener, robot)
  end

  defp again(listener, robot) do
    {:ok, socket} = :gen_tcp.accept(listener)
    line = spawn(__MODULE__, :line, [socket, robot])
    :ok = :gen_tcp.controlling_process(socket, line)
    send(line, :yours)
    again(listener, robot)
  end

  @doc false
  @spec line(:gen_tcp.socket(), atom()) :: :ok
  def line(socket, robot) do
    receive do: (:yours -> :ok)
    :ok = :inet.setopts(socket, active: true)
    relay(socket, World.Directory.find(:soak), robot, %{})
  end

  # A robot that is frozen reads nothing: then this process waits, and no other.
  defp relay(socket, server, robot, stands) do
    receive do
      {:tcp, ^socket, bytes} ->
        relay(
          socket,
          server,
          robot,
          carry_out(:erlang.binary_to_term(bytes), server, robot, stands)
        )

      {:say, kind, what} ->
        _ = :gen_tcp.send(socket, :erlang.term_to_binary({kind, what}))
        relay(socket, server, robot, stands)

      {:tcp_closed, ^socket} ->
        exit(:closed)

      {:tcp_error, ^socket, _reason} ->
        exit(:closed)
    end
  end

  defp carry_out({:attach, kind}, server, robot, stands) do
    stands = drop(stands, kind)
    line = self()
    stand = spawn_link(fn -> stand(line, kind) end)
    GenServer.cast(server, {:attach, robot, kind, stand})
    Map.put(stands, kind, stand)
  end

  defp carry_out({:detach, kind}, _server, _robot, stands), do: drop(stands, kind)

  defp carry_out({:request, request}, server, _robot, stands) do
    GenServer.cast(server, request)
    stands
  end

  # The server sees it end.
  defp drop(stands, kind) do
    {stand, stands} = Map.pop(stands, kind)
    if stand, do: send(stand, :end)
    stands
  end

  defp stand(line, kind) do
    receive do
      {:world, _server, what} ->
        send(line, {:say, kind, what})
        stand(line, kind)

      :end ->
        :ok
    end
  end
end
