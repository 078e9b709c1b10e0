defmodule Lab.Trial.Setup do
  @moduledoc """
  Prepares the start of a fleet: checked options, the world with every robot at its start pose, and each robot's
  configuration. Pure; the trial and the live fleet both use it.
  """
  alias Hal.{Pose, Profile}
  alias Lab.Trial.{Options, Places}
  alias Sim.World
  alias Vision.Marks

  @enforce_keys [:options, :map, :world, :robots, :mission]
  defstruct @enforce_keys ++ [plan: nil]

  @typedoc """
  `start` is the pose where a robot's wheels begin to count; `hardware?` says whether it uses the
  real drivers.
  """
  @type robot :: %{id: atom(), profile: Profile.t(), start: Pose.t(), hardware?: boolean()}
  @type t :: %__MODULE__{
          options: map(),
          map: Sim.Floorplan.t(),
          world: World.t(),
          robots: [robot()],
          mission: {module(), keyword()},
          plan: Nav.Grid.t() | Nav.OccupancyGrid.t() | nil
        }

  @doc """
  A setup. Options (a keyword list or a map; all have defaults): `robots` (ids), `bodies` (`Lab.Trial.Options.bodies/2`), `seed`,
  `map`, `grey` (`:wall` or `:floor`: what the grey of a bitmap is that seems to stand for what is unknown), `start` (`:spread`, `:same`, or a pose for each robot, `[{x, y, degrees}]`), `world` (a file of Stage's instead of `robots`, `bodies`, `map` and `start`: `Lab.Trial.WorldFile`), `landmark` (`{x, y}`, `:none` or `:default`), `moves`
  (`[{{x, y}, at_s}]`), `kills` (`[{:leader | id, at_s}]`), `script` (`[{at_s, event}]`, `Lab.Trial.Event`), `loss` and `duplicates` (0 to 1), `delay_ms` (`{5, 50}`), `cuts` (`Lab.Trial.Cuts`), `noise` (`:off`,
  `:default`, `:slip`), `formation` (`kind` or `{kind, spacing}`), `assign` (`:chain` or `:cost`),
  `leader_change`, `policy` (`:available` or `:majority`, with `of`, default the number of robots), `lost_link`
  (`:stop`, `:hold` or `:continue`), `mission` (another one than the landmark's, by `Swarm.MissionRegistry`: `:patrol`,
  `{:patrol, period: 90}`), `duration_s`, `blobs` (`:painted` or `:direct`), `marks` (printed marks that hang
  in the world, and that all robots look for: `[size: 0.3, at: [{7, {x, y, degrees}}], known: :all]`; `known` are those of
  which they are told where they hang, `[]` by default), `balls` (`[{x, y}]`, or with a radius) and `boxes`
  (`[{x, y, degrees}]`, or with length and width) that robots can push (`Sim.World.Object`), named `ball1`, `box1` and so on, `hardware` (robots with the real drivers, in real time only), `casts` (in lockstep only:
  `:sent` or `:drawn`, in which order the parts of a robot's program hear each other). Errors are one line.
  """
  @spec new(keyword() | map()) :: {:ok, t()} | {:error, String.t()}
  def new(options) do
    with {:ok, options} <- Options.check(options),
         {:error, {_path, line}} <- set_up(options),
         do: {:error, line}
  end

  @doc """
  What the map shows to be wrong with options: a map that cannot be read, and places where there is a wall. Each problem has
  the path to its option.

      iex> Lab.Trial.Setup.problems(robots: [:mag1], script: [{5, {:move, {99, 0}}}])
      [{["script", "1"], "the landmark cannot stand at 99.0,0.0: map hall is 14.0 x 14.0 m around its centre"}]
  """
  @spec problems(keyword() | map()) :: [Hal.Options.Type.problem()]
  def problems(options) do
    with {:ok, options} <- Options.check(options), {:error, {path, line}} <- set_up(options) do
      [{path, String.replace_prefix(line, "map: ", "")}]
    else
      {:error, line} -> [{[], line}]
      {:ok, _setup} -> []
    end
  end

  defp set_up(options) do
    bodies = for id <- options.robots, do: {id, options.bodies[id].radius}
    landmark = landmark(options.landmark)
    asked = for {_x, _y} = place <- [landmark], do: place
    moves = for {place, _at_s} <- options.moves, do: place

    with {:ok, map} <-
           at(["map"], Sim.Floorplan.open(options.map, length(options.robots), options.grey)),
         :ok <- at(["landmark"], Places.check_landmarks(map, asked)),
         :ok <- at(["moves"], Places.check_landmarks(map, moves)),
         :ok <- at(["marks"], check_marks(options)),
         :ok <- Places.check_objects(map, Places.objects(options)),
         :ok <- Places.check_script(map, options),
         {:ok, landmark, starts} <-
           at(["map"], Places.choose(map, bodies, options, landmark)) do
      {:ok, build(options, map, Enum.zip(options.robots, starts), landmark)}
    end
  end

  defp at(path, {:error, line}), do: {:error, {path, line}}
  defp at(_path, fine), do: fine

  @doc "The options of `Swarm.Member.new/1`, one list a robot, in the order of the fleet."
  @spec members(t()) :: [keyword()]
  def members(%__MODULE__{options: options} = setup) do
    for {robot, n} <- Enum.with_index(setup.robots, 1),
        do: [
          id: robot.id,
          profile: robot.profile,
          start: robot.start,
          mission: setup.mission,
          colours: World.colours(),
          plan: setup.plan,
          marks: robot.profile.camera && looked_for(options),
          seed: options.seed,
          order: if(options.casts == :drawn, do: {options.seed, n, 0})
        ]
  end

  @doc "What the cameras of such a run look for, as an option of `Robot.Config`; `nil` for no marks."
  @spec looked_for(map()) :: keyword() | nil
  def looked_for(%{marks: nil}), do: nil

  def looked_for(%{marks: marks}) do
    known = Keyword.get(marks, :known, [])
    known = if known == :all, do: hanging(marks), else: known
    known = for {id, {x, y, degrees}} <- known, do: {id, {x, y, degrees * :math.pi() / 180}}
    Keyword.take(marks, [:family, :size, :robots]) ++ [known: known]
  end

  defp hanging(marks), do: Keyword.get(marks, :at, [])

  defp check_marks(%{marks: nil}), do: :ok

  defp check_marks(%{marks: given, robots: robots}) do
    with {:ok, %{family: family}} <- Marks.new(Keyword.take(given, [:family, :size])),
         :ok <- Marks.available(family) do
      borne = Keyword.get(given, :robots, [])
      ids = Enum.map(hanging(given) ++ borne, &elem(&1, 0))
      unknown = Enum.find(ids, &(Marks.picture(family, &1) == nil))
      stranger = Enum.find(Enum.map(borne, &elem(&1, 1)), &(&1 not in robots))

      cond do
        unknown -> {:error, "#{family} has no mark #{unknown}"}
        stranger -> {:error, "marks.robots: #{inspect(stranger)} is no robot of this run"}
        true -> :ok
      end
    end
  end

  defp hung(nil), do: []

  defp hung(marks) do
    alike = Keyword.take(marks, [:family, :size, :height])

    hang =
      for {id, {x, y, degrees}} <- hanging(marks),
          do: [id: id, pose: Pose.new(x, y, degrees * :math.pi() / 180)] ++ alike

    hang ++
      for({id, robot} <- Keyword.get(marks, :robots, []), do: [id: id, robot: robot] ++ alike)
  end

  defp build(options, map, robots, landmark) do
    common = common_start(options, robots)

    world =
      World.new!(
        map: map,
        seed: options.seed,
        noise: options.noise,
        landmark: landmark,
        marks: hung(options.marks),
        objects: Places.objects(options),
        robots:
          for {id, pose} <- robots do
            odometry = if common, do: displaced(options, id, common, pose), else: Pose.new(0, 0)
            hardware? = id in options.hardware

            %{
              id: id,
              profile: options.bodies[id],
              pose: pose,
              odometry: odometry,
              infrared: hardware?
            }
          end
      )

    robots =
      for {id, pose} <- robots do
        hardware? = id in options.hardware
        %{id: id, profile: options.bodies[id], start: common || pose, hardware?: hardware?}
      end

    plan =
      case options.plan do
        :known -> Sim.Floorplan.grid(map)
        :sonar -> Nav.OccupancyGrid.new()
        :none -> nil
      end

    %__MODULE__{
      options: options,
      map: map,
      world: world,
      robots: robots,
      mission: mission(options),
      plan: plan
    }
  end

  defp mission(%{mission: {module, own}}) when module != Missions.Landmark, do: {module, own}

  defp mission(options) do
    {_module, own} = options.mission || {Missions.Landmark, []}

    shared =
      [
        formation: options.formation,
        assign: options.assign,
        leader_change: options.leader_change,
        policy: options.policy,
        of: options.of || length(options.robots)
      ] ++ if(options.lost_link, do: [lost_link: options.lost_link], else: [])

    {Missions.Landmark, Keyword.merge(own, shared)}
  end

  # All robots are switched on at the first one's place, and then driven by hand to their
  # own; their wheels count that distance too, with their errors.
  defp common_start(%{start: :same}, [{_id, pose} | _rest]), do: pose
  defp common_start(_options, _robots), do: nil

  defp displaced(options, id, common, pose) do
    %Pose{x: x, y: y, heading: heading} = Pose.relative(common, pose)
    share = if options.noise == :off, do: 0.0, else: 0.003
    sign = fn key -> 1 - 2 * rem(:erlang.phash2({options.seed, id, key}), 2) end
    scale = 1 + share * sign.(:scale)
    Pose.new(x * scale, y * scale, heading * (1 + share * sign.(:turn)))
  end

  defp landmark(:default), do: :default
  defp landmark(:none), do: nil
  defp landmark({x, y}), do: {x * 1.0, y * 1.0}
end
