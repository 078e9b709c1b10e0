defmodule Sim.Trial.Interventions do
  @moduledoc """
  Carries out the events of a script (`Sim.Trial.Event`) on a run in lockstep. Pure. What is a
  person's command to robots is returned, for the trial to give it.
  """
  alias Hal.Pose
  alias Robot.Command
  alias Sim.{Radio, World}
  alias Sim.Trial.{Event, Faults, RunLog}
  alias Sim.World.Bodies
  alias Swarm.Missions.Text

  @type trial :: %{
          :at_ms => integer(),
          :options => map(),
          :world => World.t(),
          :radio => Radio.t(),
          :members => map(),
          :run_log => RunLog.t(),
          :faults => Faults.t(),
          :severed => [Sim.Trial.Cuts.cut()] | nil,
          optional(atom()) => term()
        }

  @doc """
  The run after an event, which names no `:leader` any more, and the commands `{robot, command}`
  or `{:all, command}` to give. Nothing more can happen to a robot that was killed.
  """
  @spec carry_out(Event.t(), trial()) :: {trial(), [{atom(), term()}]}
  def carry_out(event, trial) do
    case Event.robot(event) do
      who when who in [nil, :all] -> act(event, trial)
      id -> if is_map_key(trial.members, id), do: act(event, trial), else: {trial, []}
    end
  end

  defp act({:kill, id}, trial) do
    trial = %{
      trial
      | world: World.kill(trial.world, id),
        members: Map.delete(trial.members, id)
    }

    {stage(trial, :killed, id), []}
  end

  defp act({:move, place}, trial) do
    trial = %{trial | world: World.move_landmark(trial.world, place)}
    {stage(trial, :landmark_moved, nil), []}
  end

  defp act({:remove_landmark}, trial) do
    trial = %{trial | world: World.place_landmark(trial.world, nil)}
    {stage(trial, :landmark_removed, nil), []}
  end

  defp act({:tell, who, command}, trial) do
    robot = if who != :all, do: who
    {stage(trial, :told, robot, %{command: command}), [{who, parsed(command, trial)}]}
  end

  defp act({:estop, id}, trial), do: {stage(trial, :estop, id), [{id, :estop}]}
  defp act({:reset}, trial), do: {stage(trial, :reset, nil), [{:all, :reset}]}

  defp act({:cut, what}, trial) do
    trial = %{trial | severed: List.wrap(trial.severed) ++ [{0, :end, what}]}
    {stage(trial, :radio_cut, nil), []}
  end

  defp act({:join}, trial), do: {stage(%{trial | severed: []}, :radio_whole, nil), []}

  defp act({:loss, share}, trial) do
    trial = %{trial | radio: Radio.lose(trial.radio, share)}
    {stage(trial, :radio_loss, nil, %{share: share}), []}
  end

  defp act({:displace, id, {x, y, degrees}}, trial) do
    pose = Pose.new(x, y, degrees * :math.pi() / 180)

    if occupied?(trial.world, id, {x, y}) do
      {stage(trial, :not_displaced, id), []}
    else
      trial = %{trial | world: World.displace(trial.world, id, pose)}
      {stage(trial, :displaced, id), []}
    end
  end

  defp act({:crash, id, role}, trial),
    do:
      {stage(trial, :crashed, id, %{crash: "its #{role}, by the script"}), [{id, {:crash, role}}]}

  defp act({:hang, id, role, for_s}, trial) do
    until_ms = trial.at_ms + round(for_s * 1000)
    {stage(trial, :hangs, id, %{role: role, for_s: for_s}), [{id, {:hang, role, until_ms}}]}
  end

  defp act({:freeze, id, for_s}, trial), do: {fault(trial, :frozen, id, for_s), []}
  defp act({:blind, id, for_s}, trial), do: {fault(trial, :blind, id, for_s), []}
  defp act({:deaf, id, for_s}, trial), do: {fault(trial, :deaf, id, for_s), []}

  defp fault(%{at_ms: at_ms} = trial, kind, id, for_s) do
    faults = Faults.add(trial.faults, kind, id, at_ms, at_ms + round(for_s * 1000))
    stage(%{trial | faults: faults}, kind, id, %{for_s: for_s})
  end

  # Checked when the options were, but for names of robots, which may have been killed since.
  defp parsed("" <> text, trial) do
    {:ok, command} = Command.parse(text, trial.options.robots)
    {:ok, command} = Text.request(command, length(trial.options.robots))
    command
  end

  defp parsed(command, _trial), do: command

  # A wall is refused before the run; who stands where by then is not known before.
  defp occupied?(world, id, {x, y}) do
    radius = world.robots[id].profile.radius

    others =
      for(body <- Bodies.all(world), body.id != id, do: Bodies.disc(body)) ++ Bodies.pole(world)

    Enum.any?(others, fn {ox, oy, other} ->
      Pose.distance({x, y}, {ox, oy}) < radius + other
    end)
  end

  defp stage(trial, name, robot, facts \\ %{}),
    do: %{trial | run_log: RunLog.stage(trial.run_log, trial.at_ms, name, robot, facts)}
end
