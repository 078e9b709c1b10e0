defmodule Swarm.Missions.Manual do
  @moduledoc """
  One robot does what a person tells it, one command at a time. Pure.

  Its commands are of `Robot.Command`:

  | command | does |
  |---|---|
  | `{:goto, x, y, heading or nil}` | goes there (metres, radians) |
  | `{:move, linear, turn}` | drives at this speed (m/s, rad/s) until told otherwise |
  | `{:follow, pose}` | takes that place and keeps it |
  | `{:follow_the_leader, robot}` | keeps 1 m behind that robot; stands while it is not heard |
  | `{:find_blob, colour}` | turns until the camera shows the colour (`nil`: any) |
  | `:lead` | keeps the blob that it sees ahead and near, wherever it is carried |
  | `:stop` | stands |
  """
  alias Hal.Pose
  alias Robot.Behaviour.{FindBlob, Follow, Goto, Move, TrackBlob}

  @behaviour Robot.Mission

  @behind 1.0
  @silent_ms 1_000

  @enforce_keys [:robot]
  defstruct @enforce_keys ++ [phase: :ready, number: 0, leader: nil]

  @type t :: %__MODULE__{robot: atom(), phase: atom(), number: non_neg_integer()}
  @doc """
  Whether a command is one for this mission, with numbers that make sense.

      iex> Swarm.Missions.Manual.command?({:goto, 2.0, 1.0, nil})
      true
      iex> Swarm.Missions.Manual.command?({:goto, 2.0, "far", nil})
      false
      iex> Swarm.Missions.Manual.command?({:formation, :wedge, 1.0})
      false
  """
  @spec command?(term()) :: boolean()
  def command?({:goto, x, y, nil}), do: number?(x) and number?(y)
  def command?({:goto, x, y, heading}), do: number?(x) and number?(y) and number?(heading)

  def command?({:follow, %Pose{x: x, y: y, heading: heading}}),
    do: command?({:goto, x, y, heading})

  def command?({:move, linear, turn}), do: number?(linear) and number?(turn)
  def command?({:follow_the_leader, robot}), do: is_atom(robot) and robot != nil
  def command?({:find_blob, colour}), do: colour == nil or is_binary(colour)
  def command?(command), do: command == :lead

  # As in `Robot.Command`. How fast is fast enough is the gate's to say.
  defp number?(value), do: is_float(value) and abs(value) <= 1.0e6

  @impl Robot.Mission
  def init(robot, _options), do: ready(%__MODULE__{robot: robot})

  @impl Robot.Mission
  def handle({:command, :stop}, mission), do: ready(mission)

  def handle({:command, {:follow_the_leader, robot}}, mission),
    do: begin(%{mission | leader: robot}, :follow_the_leader, nil)

  def handle({:command, command}, mission) do
    if command?(command),
      do: begin(mission, name(command), goal(command)),
      else: {mission.phase, mission, []}
  end

  # How a command ended, as a number (R12), is known to whoever asks for the robot's status.
  def handle({:outcome, {phase, number}, _outcome}, %{phase: phase, number: number} = mission),
    do: ready(mission)

  def handle({:tick, percept}, %{phase: :follow_the_leader = phase} = mission),
    do: {phase, mission, [{:goal, {phase, mission.number}, behind(mission, percept)}]}

  def handle(_event, mission), do: {mission.phase, mission, []}

  defp ready(mission),
    do: {:ready, %{mission | phase: :ready}, [{:goal, :ready, nil}, claim(:ready, true)]}

  defp begin(mission, phase, goal) do
    mission = %{mission | phase: phase, number: mission.number + 1}
    {phase, mission, [{:goal, {phase, mission.number}, goal}, claim(phase, false)]}
  end

  defp claim(phase, standing), do: {:claim, %{phase: phase, standing: standing}}

  defp name(:lead), do: :lead
  defp name(command), do: elem(command, 0)

  defp goal(:lead), do: {TrackBlob, []}
  defp goal({:follow, pose}), do: {Follow, target: pose}
  defp goal({:goto, x, y, nil}), do: {Goto, x: x, y: y}
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
