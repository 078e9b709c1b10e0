defmodule Lab.Trial.Mechanics do
  @moduledoc false
  # Describes what moves the world of a run, senses it, and judges the fleet in it; the same for a run
  # (`Lab.Trial`) and for its replay (`Lab.Replay`). Pure.
  alias Hal.Twist
  alias Robot.Mission.{Manual, Runner}
  alias Sim.{Radio, World}
  alias Lab.Trial.{Cuts, Evaluation, Faults, Memory, RunLog}
  alias Swarm.Member
  alias Swarm.Message.Checked
  alias Vision.{Detections, Marks}

  @half_ms 50

  @typedoc "A `Lab.Trial`."
  @type trial :: %{
          :at_ms => non_neg_integer(),
          :options => map(),
          :world => World.t(),
          :radio => Radio.t(),
          :members => %{atom() => Member.t()},
          :run_log => RunLog.t(),
          :colours => Vision.Colours.t(),
          :marks => Marks.t() | nil,
          :schedules => %{atom() => Marks.Schedule.t()},
          :faults => Faults.t(),
          optional(atom()) => term()
        }

  @doc "The robots that have not been killed, in the order of the fleet."
  @spec living(trial()) :: [atom()]
  def living(trial), do: Enum.filter(trial.options.robots, &is_map_key(trial.members, &1))

  @doc """
  What each living robot claims about itself, and, whatever its mission is, where it believes to be, and how certain it is of
  that.
  """
  @spec claims(trial()) :: [{atom(), map()}]
  def claims(trial), do: for(id <- living(trial), do: {id, claim(trial.members[id])})

  defp claim(member) do
    runner = Member.runner(member)
    claim = Manual.shown(Runner.state(runner), Member.claim(member))
    claim = Map.put(claim, :layer, Runner.layer(runner))
    claim = Map.put_new(claim, :uncertainty, Member.uncertainty(member))
    claim = Map.put(claim, :believed, Member.believed(member))
    if callers = Member.held(member), do: Map.put(claim, :estop, callers), else: claim
  end

  @doc "The run at this moment, as `Lab.Trial.Evaluation` judges it."
  @spec run(trial()) :: Evaluation.run()
  def run(trial) do
    %{
      at_ms: trial.at_ms,
      options: trial.options,
      world: trial.world,
      run_log: trial.run_log,
      claims: Map.new(claims(trial)),
      messages: %{sent: trial.radio.sent, lost: trial.radio.lost}
    }
  end

  @doc "Puts into effect which robots are cut off, and whose wheels stand, from now on."
  @spec settle(trial()) :: trial()
  def settle(trial), do: trial |> impair() |> cut()

  # Wheels of a frozen robot get no more orders.
  defp impair(trial) do
    trial.faults
    |> Faults.halted(trial.at_ms)
    |> Enum.reduce(trial, &%{&2 | world: World.drive(&2.world, &1, Twist.zero())})
  end

  defp cut(%{options: %{cuts: []}, severed: nil, faults: faults} = trial)
       when faults == %Faults{},
       do: trial

  defp cut(%{options: options, at_ms: at_ms} = trial) do
    ways =
      Cuts.ways(options.cuts ++ List.wrap(trial.severed), options.robots, at_ms) ++
        Faults.ways(trial.faults, options.robots, at_ms)

    %{trial | radio: Radio.cut_ways(trial.radio, ways)}
  end

  @doc "What a robot's devices report now."
  @spec readings(trial(), atom()) :: [
          Hal.Drive.reading() | Hal.Ptz.reading() | Hal.Lidar.reading()
        ]
  def readings(trial, id), do: World.readings(trial.world, id)

  @doc """
  What a robot's camera shows now, and the trial after it has looked: in a painted picture, or by geometry, as the options say; with what all cameras can see
  (`Sim.World.scenery/1`), or without, for one robot alone.
  """
  @spec look(trial(), atom(), World.scenery() | nil) :: {Detections.t(), trial()}
  def look(trial, id, scenery \\ nil)

  def look(%{options: %{blobs: :direct}} = trial, id, scenery),
    do: {World.detections(trial.world, id, scenery), trial}

  def look(trial, id, scenery) do
    frame = World.frame(trial.world, id, scenery)
    {:ok, blobs} = Vision.blobs(frame, trial.colours, nil, Memory.scratch())
    {marks, trial} = marks(trial, id, frame)
    {Detections.new(frame, blobs, marks), trial}
  end

  defp marks(%{marks: nil} = trial, _id, _frame), do: {nil, trial}

  defp marks(%{marks: marks, schedules: schedules} = trial, id, frame) do
    schedule = Map.get(schedules, id, %Marks.Schedule{})
    {:ok, seen, schedule} = Marks.look(marks, Memory.detector(marks), schedule, frame)
    {seen, %{trial | schedules: Map.put(schedules, id, schedule)}}
  end

  @doc "The picture that a robot's camera takes now."
  @spec frame(trial(), atom()) :: Hal.Frame.t()
  def frame(trial, id), do: World.frame(trial.world, id)

  @doc "Looks at the fleet, once a tick: what it claims goes into the log of the run."
  @spec observe(trial()) :: trial()
  def observe(trial) do
    claims = claims(trial)
    parts = Radio.parts(trial.radio, Enum.map(claims, &elem(&1, 0)))
    standing = for {id, member} <- trial.members, Member.stands?(member), do: id

    said = Faults.awake(trial.faults, claims, trial.at_ms)

    run_log = RunLog.held(trial.run_log, trial.at_ms, claims)
    run_log = RunLog.note(run_log, trial.at_ms, said, parts, standing)
    worst = fn leader -> trial |> run() |> Evaluation.worst(leader) end
    run_log = RunLog.judge(run_log, trial.at_ms, said, worst)
    followers = fn -> Evaluation.followers(%{run(trial) | run_log: run_log}) end
    %{trial | run_log: RunLog.watch(run_log, trial.at_ms, followers)}
  end

  @doc "The world goes on for 50 ms."
  @spec act(trial()) :: trial()
  def act(trial) do
    world = World.step(trial.world, @half_ms)
    %{trial | world: world, at_ms: trial.at_ms + @half_ms}
  end

  @doc "Carries out what a robot does."
  @spec effect(Member.effect(), atom(), trial()) :: trial()
  def effect({:drive, twist}, id, trial),
    do: %{trial | world: World.drive(trial.world, id, twist)}

  def effect({:look, pan, tilt}, id, trial),
    do: %{trial | world: World.look(trial.world, id, pan, tilt)}

  def effect({:send, to, message}, id, trial) do
    to = if to == :all, do: List.delete(trial.options.robots, id), else: List.wrap(to)
    # Checked once, and not by each that hears it.
    letter = {message, Checked.mark(message)}
    %{trial | radio: Radio.send(trial.radio, trial.at_ms, id, to, letter)}
  end

  def effect({:stage, name, facts}, id, trial),
    do: %{trial | run_log: RunLog.stage(trial.run_log, trial.at_ms, name, id, facts)}
end
