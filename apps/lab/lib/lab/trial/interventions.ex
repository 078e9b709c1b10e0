defmodule Lab.Trial.Interventions do
  @moduledoc """
  Carries out the events of a script (`Lab.Trial.Event`) on a run in lockstep. Pure. What is a
  person's command to robots is returned, for the trial to give it.
  """
  alias Hal.Pose
  alias Sim.{Radio, World}
  alias Lab.Trial.{Event, Faults, RunLog}
  alias Sim.World.{Bodies, Pushing}

  @type trial :: %{
          :at_ms => integer(),
          :options => map(),
          :world => World.t(),
          :radio => Radio.t(),
          :members => map(),
          :run_log => RunLog.t(),
          :faults => Faults.t(),
          :severed => [Lab.Trial.Cuts.cut()] | nil,
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

  defp act({:displace, id, {x, y, degrees}} = event, trial) do
    pose = Pose.new(x, y, degrees * :math.pi() / 180)

    if Bodies.occupied?(trial.world, id, {x, y}),
      do: {stage(trial, {:not_displaced, id, %{}}), []},
      else:
        {stage(%{trial | world: World.displace(trial.world, id, pose)}, Event.stage(event)), []}
  end

  defp act({:place, id, {x, y, degrees}} = event, trial) do
    case Pushing.place(trial.world, id, Pose.new(x, y, degrees * :math.pi() / 180)) do
      {:ok, world} -> {stage(%{trial | world: world}, Event.stage(event)), []}
      {:error, _line} -> {stage(trial, {:not_placed, nil, %{object: id}}), []}
    end
  end

  defp act(event, trial) do
    {trial, commands} = change(event, trial)
    {stage(trial, Event.stage(event)), commands}
  end

  defp change({:kill, id}, trial) do
    {%{trial | world: World.kill(trial.world, id), members: Map.delete(trial.members, id)}, []}
  end

  defp change({:move, place}, trial),
    do: {%{trial | world: World.move_landmark(trial.world, place)}, []}

  defp change({:remove_landmark}, trial),
    do: {%{trial | world: World.place_landmark(trial.world, nil)}, []}

  # Checked when the options were, but for names of robots, which may have been killed since.
  defp change({:tell, to, command}, trial),
    do: {trial, [{to, Event.request(command, trial.options.robots)}]}

  defp change({:order_refused, _id, _command, _why}, trial), do: {trial, []}
  defp change({:estop, id}, trial), do: {trial, [{id, :estop}]}
  defp change({:reset}, trial), do: {trial, [{:all, :reset}]}

  defp change({:cut, what}, trial),
    do: {%{trial | severed: List.wrap(trial.severed) ++ [{0, :end, what}]}, []}

  defp change({:join}, trial), do: {%{trial | severed: []}, []}
  defp change({:loss, share}, trial), do: {%{trial | radio: Radio.lose(trial.radio, share)}, []}
  defp change({:crash, id, role}, trial), do: {trial, [{id, {:crash, role}}]}

  defp change({:hang, id, role, for_s}, trial),
    do: {trial, [{id, {:hang, role, trial.at_ms + round(for_s * 1000)}}]}

  defp change({kind, id, for_s}, %{at_ms: at_ms} = trial) do
    to_ms = at_ms + round(for_s * 1000)
    {%{trial | faults: Faults.add(trial.faults, Faults.kind(kind), id, at_ms, to_ms)}, []}
  end

  defp stage(trial, {name, robot, facts}),
    do: %{trial | run_log: RunLog.stage(trial.run_log, trial.at_ms, name, robot, facts)}
end
