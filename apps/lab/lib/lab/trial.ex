defmodule Lab.Trial do
  @moduledoc """
  Plays a whole mission as a function: members, radio and world folded in lockstep, as fast as possible, identical to
  the byte for the same seed. No process, no clock.

  Every 50 ms, in this order: radio, sense, think (every 100 ms, with a new picture), reflex, act.
  `step/1` is 100 ms. `Lab.Trial.Script` schedules interventions (`Lab.Trial.Event`), which
  `Lab.Trial.Interventions` carries out; `Lab.Trial.RunLog` records a run.
  """
  alias Hal.Pose
  alias Sim.{Radio, Scene, World}

  alias Lab.Trial.{
    Evaluation,
    Faults,
    Interventions,
    Mechanics,
    Places,
    RunLog,
    Script,
    Setup,
    Termination
  }

  alias Swarm.Commands.Client
  alias Swarm.Member

  @enforce_keys [:options, :map, :world, :radio, :members, :script, :run_log, :colours]
  defstruct @enforce_keys ++
              [at_ms: 0, faults: %Faults{}, severed: nil, entries: nil, answers: %{}] ++
              [marks: nil, schedules: %{}]

  @typedoc """
  `entries` holds what happened since it was last taken, newest first; `nil`: not recorded. `answers` are those of robots to
  the last order. `marks` are what their cameras look for, and `schedules` where each last did.
  """
  @type t :: %__MODULE__{
          at_ms: non_neg_integer(),
          entries: [entry()] | nil,
          answers: %{atom() => term()}
        }

  @typedoc """
  What a recording holds: each input of a robot (`t:Swarm.Member.input/0`) with the effects that
  it had, in the order in which they happened, and each intervention in the world.
  """
  @type entry ::
          {:step, atom(), Member.input(), [Member.effect()]}
          | {:world, at_ms :: non_neg_integer(), Lab.Trial.Event.t()}

  @doc """
  A trial with the options of `Lab.Trial.Setup`. Errors are one line.
  """
  @spec new(map()) :: {:ok, t()} | {:error, String.t()}
  def new(options), do: with({:ok, setup} <- setup(options), do: {:ok, begin(setup)})

  @doc "The checked start of a trial, for `begin/2`."
  @spec setup(map()) :: {:ok, Setup.t()} | {:error, String.t()}
  def setup(options),
    do: with({:ok, setup} <- Setup.new(options), :ok <- timeless(setup), do: {:ok, setup})

  @doc """
  The trial with that start. With `record: true` it keeps what happens, until `take_entries/1` takes it; with `keep`, of the stages
  and claims of a run without an end only the newest.
  """
  @spec begin(Setup.t(), record: boolean(), keep: pos_integer()) :: t()
  def begin(%Setup{} = setup, options \\ []) do
    trial = still(setup)
    trial = %{trial | run_log: RunLog.new(elem(setup.mission, 0), options[:keep])}
    trial = if options[:record], do: %{trial | entries: []}, else: trial
    command(trial, :all, :start)
  end

  defp timeless(%Setup{options: %{hardware: []}}), do: :ok

  defp timeless(%Setup{options: %{hardware: ids}}) do
    {:error,
     "no run in lockstep can have #{Enum.join(ids, ", ")} as hardware: serial lines have a time of their own"}
  end

  @doc "The trial before its robots are told to start."
  @spec still(Setup.t()) :: t()
  def still(%Setup{options: options} = setup) do
    members = for spec <- Setup.members(setup), into: %{}, do: {spec[:id], Member.new(spec)}

    %__MODULE__{
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
      script: Script.new(options.moves, options.kills, options.script),
      run_log: RunLog.new(elem(setup.mission, 0)),
      colours: World.colours(),
      marks: marks(options)
    }
  end

  defp marks(%{marks: nil}), do: nil

  defp marks(options) do
    {:ok, marks} = Vision.Marks.new(Keyword.take(options.marks, [:family, :size]))
    marks
  end

  @doc "What was recorded since the last call, oldest first."
  @spec take_entries(t()) :: {[entry()], t()}
  def take_entries(%__MODULE__{entries: nil} = trial), do: {[], trial}

  def take_entries(%__MODULE__{entries: entries} = trial),
    do: {Enum.reverse(entries), %{trial | entries: []}}

  @doc "Advances the trial by 100 ms."
  @spec step(t()) :: t()
  def step(%__MODULE__{} = trial) do
    trial
    |> play()
    |> Mechanics.settle()
    |> hear()
    |> sense()
    |> look()
    |> inputs(&{:tick, &1})
    |> inputs(&{:reflex, &1})
    |> Mechanics.observe()
    |> Mechanics.act()
    |> hear()
    |> sense()
    |> inputs(&{:reflex, &1})
    |> Mechanics.act()
  end

  @doc """
  Whether the run is over: its time is up, or no interventions are left and the fleet has been in
  formation, or at rest without a landmark, for 5 s.
  """
  @spec done?(t()) :: boolean()
  def done?(%__MODULE__{} = trial), do: Termination.reached?(trial)

  @doc "Whether the fleet has what its mission wants now, by its own judgement: a leader says so, or all robots do."
  @spec formed?(t()) :: boolean()
  def formed?(trial), do: RunLog.formed?(trial.run_log)

  @doc "The current scene for viewers."
  @spec scene(t()) :: Scene.t()
  def scene(trial), do: trial |> Mechanics.run() |> Evaluation.scene()

  @doc "What happened to the fleet so far, the newest last."
  @spec stages(t()) :: [Scene.stage()]
  def stages(trial), do: RunLog.stages(trial.run_log)

  @doc "A robot that has not been killed, or `nil`."
  @spec robot(t(), atom()) :: Member.t() | nil
  def robot(trial, id), do: trial.members[id]

  @doc "The report of the run, without its wall time."
  @spec result(t()) :: map()
  def result(trial), do: trial |> Mechanics.run() |> Evaluation.result()

  @doc "Moves the landmark there from now on, as if a person pushed it."
  @spec move(t(), Pose.point()) :: {:ok, t()} | {:error, String.t()}
  def move(trial, place) do
    with :ok <- Places.check_landmarks(trial.map, [place]),
         do: {:ok, %{trial | script: Script.add(trial.script, trial.at_ms, {:move, place})}}
  end

  @doc "Kills a robot, or the leader, now."
  @spec kill(t(), :leader | atom()) :: t()
  def kill(trial, who), do: %{trial | script: Script.add(trial.script, trial.at_ms, {:kill, who})}

  @doc "Lifts a robot to another pose now (metres, degrees), which its wheels do not count."
  @spec displace(t(), atom(), {x :: float(), y :: float(), degrees :: float()}) :: t()
  def displace(trial, id, pose),
    do: %{trial | script: Script.add(trial.script, trial.at_ms, {:displace, id, pose})}

  @doc """
  Puts a living robot, or an object by its name, such as `"ball1"`, elsewhere now, as a person who lifts it. The error says in
  one line why it cannot be there.
  """
  @spec place(t(), atom() | String.t(), Pose.point()) :: {:ok, t()} | {:error, String.t()}
  def place(trial, who, place) do
    if is_binary(who) or who in living(trial) do
      with {:ok, event} <- Places.put(trial.world, who, place),
           do: {:ok, %{trial | script: Script.add(trial.script, trial.at_ms, event)}}
    else
      {:error, "#{who} is dead, and stays where it is"}
    end
  end

  @doc "Sends a command to one living robot or to all; a frozen one does not get it."
  @spec command(t(), atom() | :all, term()) :: t()
  def command(trial, to, command), do: elem(ask(trial, to, command), 0)

  @doc "The same, with the answers of those that answer at once, as `Swarm.Commands.Client.ask/2` gathers them."
  @spec ask(t(), atom() | :all, term()) :: {t(), %{atom() => term()}}
  def ask(trial, to, command) do
    Enum.reduce(awake(trial), %{trial | answers: %{}}, fn id, trial ->
      if to in [:all, id], do: input(trial, id, told(command, trial.at_ms)), else: trial
    end)
    |> then(&{&1, &1.answers})
  end

  # A fault of its program is no command of a person.
  defp told({:crash, role}, at_ms), do: {:crash, role, at_ms}
  defp told({:hang, role, until_ms}, at_ms), do: {:hang, {role, until_ms}, at_ms}
  defp told(command, at_ms), do: {:command, command, at_ms}

  @doc "The robots that have not been killed, in the order of the fleet."
  @spec living(t()) :: [atom()]
  defdelegate living(trial), to: Mechanics

  @doc "What each living robot claims about itself, and how certain its pose is."
  @spec claims(t()) :: [{atom(), map()}]
  defdelegate claims(trial), to: Mechanics

  defp play(trial) do
    {events, script} = Script.due(trial.script, trial.at_ms, RunLog.leader(trial.run_log))
    Enum.reduce(events, %{trial | script: script}, &intervene(&2, &1))
  end

  defp intervene(trial, event) do
    {trial, commands} = trial |> note(fn -> {:world, trial.at_ms, event} end) |> happen(event)

    Enum.reduce(commands, trial, fn {to, command}, trial ->
      {trial, answers} = ask(trial, to, command)
      robots = if to == :all, do: living(trial), else: [to]
      event |> refused(robots, answers) |> Enum.reduce(trial, &intervene(&2, &1))
    end)
  end

  # What a person who has told robots something hears.
  defp refused({:tell, _to, command}, robots, answers) do
    for {id, why} <- Client.refusals(robots, answers),
        do: {:order_refused, id, command, why}
  end

  defp refused(_event, _robots, _answers), do: []

  @doc """
  An event of the script happens; also returns the commands to robots that are part of it,
  `{robot | :all, command}`.
  """
  @spec happen(t(), Lab.Trial.Event.t()) :: {t(), [{atom(), term()}]}
  def happen(trial, event), do: Interventions.carry_out(event, trial)

  defp note(%{entries: nil} = trial, _entry), do: trial
  defp note(%{entries: entries} = trial, entry), do: %{trial | entries: [entry.() | entries]}

  defp hear(trial) do
    {letters, radio} = Radio.receive(trial.radio, trial.at_ms)

    Enum.reduce(letters, %{trial | radio: radio}, fn {to, _from, {message, marked}}, trial ->
      if Faults.any?(trial.faults, [:frozen, :deaf], to, trial.at_ms),
        do: trial,
        else:
          input(
            trial,
            to,
            {:message, message, trial.at_ms},
            &Member.step(&1, {:message, marked, trial.at_ms})
          )
    end)
  end

  defp sense(trial) do
    each(trial, fn id, trial ->
      trial
      |> Mechanics.readings(id)
      |> Enum.reduce(trial, &input(&2, id, {:reading, &1, trial.at_ms}))
    end)
  end

  # Nothing moves while all look.
  defp look(trial) do
    scenery = World.scenery(trial.world)

    each(trial, fn id, trial ->
      if not World.camera?(trial.world, id) or
           Faults.any?(trial.faults, [:blind], id, trial.at_ms),
         do: trial,
         else: looked(Mechanics.look(trial, id, scenery), id)
    end)
  end

  defp looked({detections, trial}, id), do: input(trial, id, {:detections, detections})

  defp inputs(trial, make),
    do: each(trial, fn id, trial -> input(trial, id, make.(trial.at_ms)) end)

  defp each(trial, function), do: Enum.reduce(awake(trial), trial, function)

  defp awake(trial) do
    Enum.reject(living(trial), &Faults.any?(trial.faults, [:frozen], &1, trial.at_ms))
  end

  defp input(trial, id, input), do: input(trial, id, input, &Member.step(&1, input))

  # Answers are for those that ask, and no effects on the run.
  defp answered(trial, _id, []), do: {trial, []}

  defp answered(trial, id, effects) do
    case Enum.split_with(effects, &match?({:reply, _answer}, &1)) do
      {[], effects} -> {trial, effects}
      {[reply | _], effects} -> {put_in(trial.answers[id], elem(reply, 1)), effects}
    end
  end

  # `step` is what the input does.
  defp input(trial, id, input, step) do
    case trial.members do
      %{^id => member} ->
        {member, effects} = step.(member)
        {trial, effects} = answered(trial, id, effects)

        trial =
          note(%{trial | members: %{trial.members | id => member}}, fn ->
            {:step, id, input, effects}
          end)

        Enum.reduce(effects, trial, &Mechanics.effect(&1, id, &2))

      _dead ->
        trial
    end
  end
end
