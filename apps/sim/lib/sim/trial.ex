defmodule Sim.Trial do
  @moduledoc """
  A whole mission as a function: members, radio and world folded in lockstep, as fast as possible,
  identical to the byte for the same seed. No process, no clock.

  Every 50 ms, in this order: radio, sense, think (every 100 ms, with a new picture), reflex, act.
  `step/1` is 100 ms. `Sim.Trial.Scenario` schedules interventions (landmark moved, robots
  killed); `Sim.Trial.RunLog` records a run.
  """
  alias Hal.Pose
  alias Sim.{Radio, Scene, World}
  alias Sim.Trial.{Cuts, Evaluation, RunLog, Scenario, Setup, Termination}
  alias Swarm.Member
  alias Vision.Detections

  @half_ms 50

  @enforce_keys [:options, :map, :world, :radio, :members, :script, :run_log, :colours]
  defstruct @enforce_keys ++ [at_ms: 0]

  @type t :: %__MODULE__{at_ms: non_neg_integer()}

  @doc """
  A trial with the options of `Sim.Trial.Setup`. Errors are one line.
  """
  @spec new(map()) :: {:ok, t()} | {:error, String.t()}
  def new(options) do
    with {:ok, setup} <- Setup.new(options), :ok <- timeless(setup), do: {:ok, build(setup)}
  end

  defp timeless(%Setup{options: %{hardware: []}}), do: :ok

  defp timeless(%Setup{options: %{hardware: ids}}) do
    {:error,
     "no run in lockstep can have #{Enum.join(ids, ", ")} as hardware: serial lines have a time of their own"}
  end

  @doc "Advances the trial by 100 ms."
  @spec step(t()) :: t()
  def step(%__MODULE__{} = trial) do
    trial
    |> play()
    |> cut()
    |> hear()
    |> sense()
    |> look()
    |> inputs(&{:tick, &1})
    |> inputs(&{:reflex, &1})
    |> write()
    |> act()
    |> hear()
    |> sense()
    |> inputs(&{:reflex, &1})
    |> act()
  end

  @doc """
  Whether the run is over: its time is up, or no interventions are left and the fleet has been in
  formation, or at rest without a landmark, for 5 s.
  """
  @spec done?(t()) :: boolean()
  def done?(%__MODULE__{} = trial), do: Termination.reached?(trial)

  @doc "Whether the fleet is in formation now, by its own judgement."
  @spec formed?(t()) :: boolean()
  def formed?(trial), do: Enum.any?(claims(trial), fn {_id, claim} -> claim[:formed] == true end)

  @doc "The current scene for viewers."
  @spec scene(t()) :: Scene.t()
  def scene(trial), do: trial |> run() |> Evaluation.scene()

  @doc "The report of the run, without its wall time."
  @spec result(t()) :: map()
  def result(trial), do: trial |> run() |> Evaluation.result()

  @doc "Moves the landmark there from now on, as if a person pushed it."
  @spec move(t(), Pose.point()) :: {:ok, t()} | {:error, String.t()}
  def move(trial, place) do
    with :ok <- Setup.check_landmarks(trial.map, [place]),
         do: {:ok, %{trial | script: Scenario.add_move(trial.script, place, trial.at_ms)}}
  end

  @doc "Kills a robot, or the leader, now."
  @spec kill(t(), :leader | atom()) :: t()
  def kill(trial, who), do: %{trial | script: Scenario.add_kill(trial.script, who, trial.at_ms)}

  @doc "Sends a command to one living robot or to all."
  @spec command(t(), atom() | :all, term()) :: t()
  def command(trial, to, command) do
    Enum.reduce(living(trial), trial, fn id, trial ->
      if to in [:all, id], do: input(trial, id, {:command, command, trial.at_ms}), else: trial
    end)
  end

  @doc "The robots that have not been killed, in the order of the fleet."
  @spec living(t()) :: [atom()]
  def living(trial), do: Enum.filter(trial.options.robots, &is_map_key(trial.members, &1))

  @doc """
  What each living robot claims about itself, and, whatever its mission is, how certain its pose
  is.
  """
  @spec claims(t()) :: [{atom(), map()}]
  def claims(trial), do: for(id <- living(trial), do: {id, claim(trial.members[id])})

  defp claim(member),
    do: Map.put_new(Member.claim(member), :uncertainty, Member.uncertainty(member))

  defp run(trial) do
    %{
      at_ms: trial.at_ms,
      options: trial.options,
      world: trial.world,
      run_log: trial.run_log,
      claims: Map.new(claims(trial)),
      messages: %{sent: trial.radio.sent, lost: trial.radio.lost}
    }
  end

  defp build(%Setup{options: options} = setup) do
    members =
      Map.new(setup.robots, fn robot ->
        member = [{:mission, setup.mission} | robot |> Map.delete(:hardware?) |> Map.to_list()]
        {robot.id, Member.new(member)}
      end)

    trial = %__MODULE__{
      options: options,
      map: setup.map,
      world: setup.world,
      radio:
        Radio.new(
          seed: options.seed,
          loss: options.loss,
          duplicates: options.duplicates,
          delay_ms: options.delay_ms
        ),
      members: members,
      script: Scenario.new(options.moves, options.kills),
      run_log: RunLog.new(),
      colours: World.colours()
    }

    command(trial, :all, :start)
  end

  defp play(trial) do
    {events, script} = Scenario.due(trial.script, trial.at_ms, RunLog.leader(trial.run_log))
    Enum.reduce(events, %{trial | script: script}, &play_one/2)
  end

  defp play_one({:kill, id}, trial) do
    if is_map_key(trial.members, id) do
      %{
        trial
        | world: World.kill(trial.world, id),
          members: Map.delete(trial.members, id),
          run_log: RunLog.stage(trial.run_log, trial.at_ms, :killed, id, %{})
      }
    else
      trial
    end
  end

  defp play_one({:move, place}, trial) do
    %{
      trial
      | world: World.move_landmark(trial.world, place),
        run_log: RunLog.stage(trial.run_log, trial.at_ms, :landmark_moved, nil, %{})
    }
  end

  defp cut(%{options: %{cuts: []}} = trial), do: trial

  defp cut(%{options: options, at_ms: at_ms} = trial) do
    ways = Cuts.ways(options.cuts, options.robots, at_ms)
    %{trial | radio: Radio.cut_ways(trial.radio, ways)}
  end

  defp hear(trial) do
    {letters, radio} = Radio.receive(trial.radio, trial.at_ms)

    Enum.reduce(letters, %{trial | radio: radio}, fn {to, _from, message}, trial ->
      input(trial, to, {:message, message, trial.at_ms})
    end)
  end

  defp sense(trial) do
    each(trial, fn id, trial ->
      trial.world
      |> World.readings(id)
      |> Enum.reduce(trial, &input(&2, id, {:reading, &1, trial.at_ms}))
    end)
  end

  defp look(%{options: %{blobs: :direct}} = trial) do
    each(trial, fn id, trial ->
      input(trial, id, {:detections, World.detections(trial.world, id)})
    end)
  end

  defp look(trial) do
    each(trial, fn id, trial ->
      frame = World.frame(trial.world, id)
      {:ok, blobs} = Vision.blobs(frame, trial.colours)
      input(trial, id, {:detections, Detections.new(frame, blobs)})
    end)
  end

  defp inputs(trial, make),
    do: each(trial, fn id, trial -> input(trial, id, make.(trial.at_ms)) end)

  defp write(trial) do
    claims = claims(trial)
    parts = Radio.parts(trial.radio, Enum.map(claims, &elem(&1, 0)))
    standing = for {id, member} <- trial.members, Member.stands?(member), do: id

    run_log = RunLog.note(trial.run_log, trial.at_ms, claims, parts, standing)
    worst = fn leader -> trial |> run() |> Evaluation.worst(leader) end
    run_log = RunLog.judge(run_log, trial.at_ms, claims, worst)
    followers = fn -> Evaluation.followers(%{run(trial) | run_log: run_log}) end
    %{trial | run_log: RunLog.watch(run_log, trial.at_ms, followers)}
  end

  defp act(trial) do
    world = World.step(trial.world, @half_ms)
    %{trial | world: world, at_ms: trial.at_ms + @half_ms}
  end

  defp each(trial, function), do: Enum.reduce(living(trial), trial, function)

  defp input(trial, id, input) do
    case trial.members do
      %{^id => member} ->
        {member, effects} = Member.step(member, input)
        trial = %{trial | members: %{trial.members | id => member}}
        Enum.reduce(effects, trial, &effect(&1, id, &2))

      _dead ->
        trial
    end
  end

  defp effect({:drive, twist}, id, trial),
    do: %{trial | world: World.drive(trial.world, id, twist)}

  defp effect({:look, pan, tilt}, id, trial),
    do: %{trial | world: World.look(trial.world, id, pan, tilt)}

  defp effect({:send, to, message}, id, trial) do
    to = if to == :all, do: List.delete(trial.options.robots, id), else: List.wrap(to)
    %{trial | radio: Radio.send(trial.radio, trial.at_ms, id, to, message)}
  end

  defp effect({:stage, name, facts}, id, trial),
    do: %{trial | run_log: RunLog.stage(trial.run_log, trial.at_ms, name, id, facts)}
end
