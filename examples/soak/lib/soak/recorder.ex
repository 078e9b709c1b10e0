defmodule Soak.Recorder do
  @moduledoc """
  Writes a node's log: a file of lines `{microseconds, robot, kind, value}` by the machine's time (CLOCK_MONOTONIC),
  whole up to the moment in which somebody kills the node. It is no part of the robot, whose processes are killed beside
  it.

  | kind | value |
  |---|---|
  | `:boot` | the number of the process of the operating system |
  | `:claim` | when it changes: phase, leader and epoch, as the robot's heartbeats claim them |
  | `:held` | when it changes: whether the emergency stop is latched; `nil` without a robot |
  | `:where` | twice a second: where it believes to be (x, y, heading), how surely (m), its goal; `nil` without a robot |
  | `:probe` | each second: `t:probe/0` |
  """
  use GenServer
  alias Soak.Fleet.Tree
  alias Hal.Ticker
  alias Robot.Board
  alias Swarm.Host.HealthCheck

  @look_ms 100
  @where_every 5
  @probe_every 10

  @typedoc """
  `well` is the judgement for systemd, `offline` the devices that are not online, `processes` what runs,
  `peers` the robots that are heard, `listed` those of the directory; `bytes` is memory without what waits to
  be collected in the process that asks.
  """
  @type probe :: %{
          well: {boolean(), String.t()},
          offline: [atom()],
          processes: [String.t()],
          peers: [atom()],
          listed: [atom()],
          bytes: pos_integer(),
          atoms: pos_integer(),
          count: pos_integer(),
          ports: non_neg_integer()
        }

  @doc "Starts the log of a robot's node in a folder."
  @spec start_link({Path.t(), atom()}) :: GenServer.on_start()
  def start_link({folder, robot}),
    do: GenServer.start_link(__MODULE__, {Path.join(folder, "#{robot}.log"), robot})

  @doc "The machine's time, in microseconds."
  @spec now() :: integer()
  def now, do: :os.perf_counter(:microsecond)

  @impl GenServer
  def init({path, robot}) do
    Process.flag(:priority, :high)
    {:ok, file} = :file.open(path, [:append, :raw])
    s = %{file: file, robot: robot, last: %{}, ticks: 0, ticker: Ticker.start(:look, @look_ms, 0)}
    {:ok, write(s, :boot, System.pid())}
  end

  @impl GenServer
  def handle_info(:look, s) do
    s = s |> change(:claim, claim(s.robot)) |> change(:held, held(s.robot))
    s = if rem(s.ticks, @where_every) == 0, do: write(s, :where, where(s.robot)), else: s
    s = if rem(s.ticks, @probe_every) == 0, do: write(s, :probe, probe(s.robot)), else: s
    {:noreply, %{s | ticks: s.ticks + 1, ticker: Ticker.next(s.ticker)}}
  end

  defp claim(robot), do: robot |> Lab.Fleet.Robot.claim() |> Map.take([:phase, :leader, :epoch])

  defp held(robot),
    do: with({:ok, board} <- Board.find(robot), do: Board.latched?(board), else: (:error -> nil))

  # For people who look for the cause of a violation; the judge does not read it.
  defp where(robot) do
    with {:ok, board} <- Board.find(robot),
         {:ok, pose, _at_ms} <- Board.fetch(board, :pose, :infinity),
         {:ok, %{radius: radius}, _at_ms} <- Board.fetch(board, :uncertainty, :infinity),
         {:ok, goal, _at_ms} <- Board.fetch(board, :goal, :infinity) do
      {{pose.x, pose.y, pose.heading}, radius, goal}
    else
      _not_yet -> nil
    end
  end

  defp probe(robot) do
    processes = Tree.processes()
    node_wide = if processes == [], do: [], else: Swarm.Directory.robots()

    %{
      well: HealthCheck.of(robot),
      offline: offline(robot),
      processes: for({words, _pid} <- processes, do: words),
      peers: if(processes == [], do: [], else: Enum.sort(Map.keys(Mesh.robots()))),
      listed: node_wide,
      bytes: :erlang.memory(:total),
      atoms: :erlang.system_info(:atom_count),
      count: :erlang.system_info(:process_count),
      ports: length(Port.list())
    }
  end

  defp offline(robot) do
    with {:ok, board} <- Board.find(robot) do
      for device <- [:drive, :ptz, :camera],
          not match?({:ok, :online, _at_ms}, Board.fetch(board, {:health, device}, :infinity)),
          do: device
    else
      :error -> [:drive, :ptz, :camera]
    end
  end

  defp change(s, kind, value) do
    case s.last do
      %{^kind => ^value} -> s
      last -> write(%{s | last: Map.put(last, kind, value)}, kind, value)
    end
  end

  defp write(s, kind, value) do
    line = :io_lib.format("~0tp.~n", [{now(), s.robot, kind, value}])
    :ok = :file.write(s.file, :unicode.characters_to_binary(line))
    s
  end
end
