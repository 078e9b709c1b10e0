defmodule Swarm.Missions.Manual do
  @moduledoc """
  One robot does what a person tells it, one command at a time. Pure.

  | command | does |
  |---|---|
  | `{:goto, x, y}`, `{:goto, x, y, heading}` | goes there (metres, radians) |
  | `{:move, linear, turn}` | drives at this speed (m/s, rad/s) until told otherwise |
  | `{:follow, robot}` | keeps 1 m behind that robot; stands while it is not heard |
  | `{:find_blob, colour}` | turns until the camera shows the colour (`nil`: any) |
  | `:stop` | stands |
  """
  alias Hal.Pose
  alias Robot.Behaviour.{FindBlob, Follow, Goto, Move}

  @behaviour Robot.Mission

  @behind 1.0
  @silent_ms 1_000

  @enforce_keys [:robot]
  defstruct @enforce_keys ++ [phase: :ready, number: 0, leader: nil]

  @type t :: %__MODULE__{robot: atom(), phase: atom(), number: non_neg_integer()}
  @type command ::
          {:goto, float(), float()}
          | {:goto, float(), float(), float()}
          | {:move, float(), float()}
          | {:follow, atom()}
          | {:find_blob, String.t() | nil}

  @doc """
  Whether a command is one for this mission, with numbers that make sense.

      iex> Swarm.Missions.Manual.command?({:goto, 2.0, 1.0})
      true
      iex> Swarm.Missions.Manual.command?({:goto, 2.0, "far"})
      false
      iex> Swarm.Missions.Manual.command?({:formation, :wedge, 1.0})
      false
  """
  @spec command?(term()) :: boolean()
  def command?({:goto, x, y}), do: place?(x) and place?(y)
  def command?({:goto, x, y, heading}), do: place?(x) and place?(y) and place?(heading)
  def command?({:move, linear, turn}), do: speed?(linear) and speed?(turn)
  def command?({:follow, robot}), do: is_atom(robot) and robot != nil
  def command?({:find_blob, colour}), do: colour == nil or is_binary(colour)
  def command?(_other), do: false

  defp place?(value), do: is_float(value) and abs(value) < 1.0e5
  defp speed?(value), do: is_float(value) and abs(value) < 10

  @impl Robot.Mission
  def init(robot, _options), do: ready(%__MODULE__{robot: robot})

  @impl Robot.Mission
  def handle({:command, :stop}, mission), do: ready(mission)

  def handle({:command, {:follow, robot}}, mission),
    do: begin(%{mission | leader: robot}, :follow, nil)

  def handle({:command, command}, mission) do
    if command?(command),
      do: begin(mission, elem(command, 0), goal(command)),
      else: {mission.phase, mission, []}
  end

  # How a command ended, as a number (R12), is known to whoever asks for the robot's status.
  def handle({:outcome, {phase, number}, _outcome}, %{phase: phase, number: number} = mission),
    do: ready(mission)

  def handle({:tick, percept}, %{phase: :follow} = mission),
    do: {:follow, mission, [{:goal, {:follow, mission.number}, behind(mission, percept)}]}

  def handle(_event, mission), do: {mission.phase, mission, []}

  defp ready(mission),
    do: {:ready, %{mission | phase: :ready}, [{:goal, :ready, nil}, claim(:ready, true)]}

  defp begin(mission, phase, goal) do
    mission = %{mission | phase: phase, number: mission.number + 1}
    {phase, mission, [{:goal, {phase, mission.number}, goal}, claim(phase, false)]}
  end

  defp claim(phase, standing), do: {:claim, %{phase: phase, standing: standing}}

  defp goal({:goto, x, y}), do: {Goto, x: x, y: y}
  defp goal({:goto, x, y, heading}), do: {Goto, x: x, y: y, heading: Pose.wrap(heading)}
  defp goal({:move, linear, turn}), do: {Move, linear: linear, turn: turn}
  defp goal({:find_blob, colour}), do: {FindBlob, colour: colour}

  defp behind(%{leader: leader}, percept) do
    case percept.peers do
      %{^leader => %{pose: pose, twist: twist, at_ms: at_ms}}
      when percept.at_ms - at_ms < @silent_ms ->
        {x, y} = Pose.place(pose, {-@behind, 0.0})
        {ahead, aside} = {:math.cos(pose.heading), :math.sin(pose.heading)}
        velocity = {twist.linear * ahead, twist.linear * aside}
        {Follow, target: Pose.new(x, y, pose.heading), velocity: velocity}

      _silent ->
        nil
    end
  end
end
