defmodule Sim.Trial do
  @moduledoc """
  A whole mission as a function: members, radio and world folded in lockstep, as fast as it goes,
  the same to the byte for one seed. No process, no clock.

  Every 50 ms, in this order: radio, sense, mind (every 100 ms, with a new picture), reflex, act.
  `step/1` is 100 ms. What happens on purpose (landmark moved, robots killed) is `Sim.Trial.Script`;
  what is written down of a run is `Sim.Trial.Ledger`.
  """
  alias Hal.{Pose, Profile}
  alias Sim.{Radio, Scene, World}
  alias Sim.Trial.{Ledger, Score, Script}
  alias Swarm.Member

  @half_ms 50
  @calm_ms 5_000

  @enforce_keys [:options, :map, :world, :radio, :members, :script, :ledger, :colours]
  defstruct @enforce_keys ++ [at_ms: 0]

  @type t :: %__MODULE__{at_ms: non_neg_integer()}

  @defaults %{
    robots: [:mag1, :mag2, :mag3, :min1, :min2, :min3],
    seed: 1,
    map: "hall",
    start: :spread,
    landmark: :default,
    moves: [],
    kills: [],
    loss: 0.0,
    noise: :default,
    formation: {:column, 1.0},
    assign: :cost,
    leader_change: true,
    duration_s: 120,
    blobs: :painted
  }

  @doc """
  A trial. Options (a map; all have defaults): `robots` (ids that begin with `mag` or `min`), `seed`,
  `map`, `start` (`:spread` or `:same`), `landmark` (`{x, y}`, `:none` or `:default`), `moves`
  (`[{{x, y}, at_s}]`), `kills` (`[{:leader | id, at_s}]`), `loss` (0 to 1), `noise` (`:off`,
  `:default`, `:slip`), `formation` (`{kind, spacing}`), `assign` (`:chain` or `:cost`),
  `leader_change`, `duration_s`, `blobs` (`:painted` or `:direct`). Errors are one line.
  """
  @spec new(map()) :: {:ok, t()} | {:error, String.t()}
  def new(options) do
    options = Map.merge(@defaults, options)
    profiles = Map.new(options.robots, &{&1, profile(&1)})
    bodies = for id <- options.robots, do: {id, profiles[id].radius}
    landmark = landmark(options.landmark)
    places = [landmark | Enum.map(options.moves, &elem(&1, 0))]

    with {:ok, map} <- Sim.Map.open(options.map, length(options.robots)),
         :ok <- check_landmarks(map, places),
         {:ok, starts} <- Sim.Map.starts(map, bodies, options.seed, landmark) do
      robots = Enum.zip(options.robots, starts)
      {:ok, build(options, map, robots, profiles, landmark)}
    end
  end

  @doc "100 ms further."
  @spec step(t()) :: t()
  def step(%__MODULE__{} = trial) do
    trial
    |> play()
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
  Whether the run is over: its time is up, or nothing is to come and the fleet has been in
  formation, or at rest without a landmark, for 5 s.
  """
  @spec done?(t()) :: boolean()
  def done?(%__MODULE__{} = trial) do
    calm_ms = Ledger.calm_since_ms(trial.ledger)

    trial.at_ms >= trial.options.duration_s * 1000 or
      (Script.over?(trial.script, trial.world) and calm_ms != nil and
         trial.at_ms - max(calm_ms, Script.last_ms(trial.script)) >= @calm_ms)
  end

  @doc "Whether the fleet is in formation now, by its own judgement."
  @spec formed?(t()) :: boolean()
  def formed?(trial), do: Enum.any?(claims(trial), fn {_id, claim} -> claim[:formed] == true end)

  @doc "What a viewer sees now."
  @spec scene(t()) :: Scene.t()
  def scene(trial), do: Score.scene(trial)

  @doc "All that the report says of the run, but for its wall time."
  @spec result(t()) :: map()
  def result(trial), do: Score.result(trial)

  @doc "Moves the landmark there, as a person would push it, from now on."
  @spec move(t(), Pose.point()) :: {:ok, t()} | {:error, String.t()}
  def move(trial, place) do
    with :ok <- check_landmarks(trial.map, [place]),
         do: {:ok, %{trial | script: Script.add_move(trial.script, place, trial.at_ms)}}
  end

  @doc "Kills a robot, or whoever leads, now."
  @spec kill(t(), :leader | atom()) :: t()
  def kill(trial, who), do: %{trial | script: Script.add_kill(trial.script, who, trial.at_ms)}

  @doc "Gives a command to one living robot or to all."
  @spec command(t(), atom() | :all, term()) :: t()
  def command(trial, to, command) do
    Enum.reduce(living(trial), trial, fn id, trial ->
      if to in [:all, id], do: input(trial, id, {:command, command, trial.at_ms}), else: trial
    end)
  end

  @doc "The robots that have not been killed, in the order of the fleet."
  @spec living(t()) :: [atom()]
  def living(trial), do: Enum.filter(trial.options.robots, &is_map_key(trial.members, &1))

  @doc "What each living robot claims of itself."
  @spec claims(t()) :: [{atom(), map()}]
  def claims(trial), do: for(id <- living(trial), do: {id, Member.claim(trial.members[id])})

  defp build(options, map, robots, profiles, landmark) do
    common = common_start(options, robots)

    world =
      World.new!(
        map: map,
        seed: options.seed,
        noise: options.noise,
        landmark: landmark,
        robots:
          for {id, pose} <- robots do
            odometry = if common, do: displaced(options, id, common, pose), else: Pose.new(0, 0)
            %{id: id, profile: profiles[id], pose: pose, odometry: odometry}
          end
      )

    mission =
      {Swarm.Missions.Landmark,
       formation: options.formation, assign: options.assign, leader_change: options.leader_change}

    members =
      Map.new(robots, fn {id, pose} ->
        {id, Member.new(id: id, profile: profiles[id], start: common || pose, mission: mission)}
      end)

    trial = %__MODULE__{
      options: options,
      map: map,
      world: world,
      radio: Radio.new(seed: options.seed, loss: options.loss),
      members: members,
      script: Script.new(options.moves, options.kills),
      ledger: Ledger.new(),
      colours: World.colours()
    }

    command(trial, :all, :start)
  end

  # R66: all are switched on at the first one's place, and then driven to theirs by hand; their
  # wheels count that way too, with their errors.
  defp common_start(%{start: :same}, [{_id, pose} | _rest]), do: pose
  defp common_start(_options, _robots), do: nil

  defp displaced(options, id, common, pose) do
    %Pose{x: x, y: y, heading: heading} = Pose.relative(common, pose)
    share = if options.noise == :off, do: 0.0, else: 0.003
    sign = fn key -> 1 - 2 * rem(:erlang.phash2({options.seed, id, key}), 2) end
    scale = 1 + share * sign.(:scale)
    Pose.new(x * scale, y * scale, heading * (1 + share * sign.(:turn)))
  end

  defp play(trial) do
    {events, script} = Script.due(trial.script, trial.at_ms, Ledger.leader(trial.ledger))
    Enum.reduce(events, %{trial | script: script}, &play_one/2)
  end

  defp play_one({:kill, id}, trial) do
    if is_map_key(trial.members, id) do
      %{
        trial
        | world: World.kill(trial.world, id),
          members: Map.delete(trial.members, id),
          ledger: Ledger.stage(trial.ledger, trial.at_ms, :killed, id, %{})
      }
    else
      trial
    end
  end

  defp play_one({:move, place}, trial) do
    %{
      trial
      | world: World.move_landmark(trial.world, place),
        ledger: Ledger.stage(trial.ledger, trial.at_ms, :landmark_moved, nil, %{})
    }
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
      blobs(trial, id, World.blobs(trial.world, id), pan(trial.world, id))
    end)
  end

  defp look(trial) do
    each(trial, fn id, trial ->
      frame = World.frame(trial.world, id)
      {:ok, blobs} = Vision.blobs(frame, trial.colours)
      blobs(trial, id, blobs, frame.pan)
    end)
  end

  defp blobs(trial, id, blobs, pan),
    do: input(trial, id, {:blobs, blobs, %{at_ms: trial.at_ms, pan: pan}})

  defp pan(world, id) do
    {:ptz, %{pan: pan}} = world |> World.readings(id) |> List.keyfind(:ptz, 0)
    pan
  end

  defp inputs(trial, make),
    do: each(trial, fn id, trial -> input(trial, id, make.(trial.at_ms)) end)

  defp write(trial) do
    claims = claims(trial)
    %{trial | ledger: Ledger.note(trial.ledger, trial.at_ms, claims)}
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
    do: %{trial | ledger: Ledger.stage(trial.ledger, trial.at_ms, name, id, facts)}

  defp landmark(:default), do: {0.0, 0.0}
  defp landmark(:none), do: nil
  defp landmark({x, y}), do: {x * 1.0, y * 1.0}

  defp check_landmarks(map, places) do
    Enum.find_value(places, :ok, fn place ->
      case place && Sim.Map.check_landmark(map, place) do
        {:error, line} -> {:error, line}
        _fine -> nil
      end
    end)
  end

  @doc "The profile of a robot by its name, as in the thesis: `mag1` is a Magellan Pro, `min1` an ATRV mini."
  @spec profile(atom()) :: Profile.t()
  def profile(id) do
    case Atom.to_string(id) do
      "min" <> _number -> Profile.atrv_mini()
      _mag -> Profile.magellan()
    end
  end
end
