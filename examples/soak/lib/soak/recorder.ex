defmodule Soak.Recorder do
  @moduledoc """
  Says what a robot's node writes into its log (`Lab.Node.Log`), which is no part of the robot, whose processes are killed
  beside it.

  | kind | value |
  |---|---|
  | `:claim` | when it changes: phase, leader and epoch, as the robot's heartbeats claim them |
  | `:held` | when it changes: whether the emergency stop is latched; `nil` without a robot |
  | `:where` | twice a second: where it believes to be (x, y, heading), how surely (m), its goal; `nil` without a robot |
  | `:probe` | each second: `t:probe/0` |
  """
  alias Soak.Fleet.Tree
  alias Robot.Board
  alias Swarm.Host.HealthCheck

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

  @doc "The lines of a robot."
  @spec looks(atom()) :: [Lab.Node.Log.look()]
  def looks(robot) do
    for {kind, n, how} <- [
          {:claim, 1, :change},
          {:held, 1, :change},
          {:where, 5, :always},
          {:probe, 10, :always}
        ],
        do: {kind, n, how, {__MODULE__, kind, [robot]}}
  end

  @doc false
  @spec claim(atom()) :: term()
  def claim(robot), do: robot |> Lab.VirtualRobot.claim() |> Map.take([:phase, :leader, :epoch])

  @doc false
  @spec held(atom()) :: term()
  def held(robot),
    do: with({:ok, board} <- Board.find(robot), do: Board.latched?(board), else: (:error -> nil))

  # For people who look for the cause of a violation; the judge does not read it.
  @doc false
  @spec where(atom()) :: term()
  def where(robot) do
    with {:ok, board} <- Board.find(robot),
         {:ok, pose, _at_ms} <- Board.fetch(board, :pose, :infinity),
         {:ok, %{radius: radius}, _at_ms} <- Board.fetch(board, :uncertainty, :infinity),
         {:ok, goal, _at_ms} <- Board.fetch(board, :goal, :infinity) do
      {{pose.x, pose.y, pose.heading}, radius, goal}
    else
      _not_yet -> nil
    end
  end

  @doc false
  @spec probe(atom()) :: term()
  def probe(robot) do
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
end
