defmodule Robot.Control.Controller do
  @moduledoc """
  Computes one tick of a robot's decisions: the present goal, wrapped in `Robot.Behaviour.Avoid`, the escape from a
  touched bumper, and rest make wishes; the arbiter chooses one. Pure.

  A goal has a tag. Setting a goal with the same tag and module changes the options of the running
  behaviour (for example a target that moves); another tag or module starts afresh. A goal that
  has ended stays ended until another one comes.

  The camera looks where the chosen behaviour wants it, else where the goal's behaviour wants it,
  else where the mission last ordered it.

  In addition to its behaviour's own options a goal takes `discs: [{x, y, radius}]`: standing
  obstacles to avoid, in the map frame, metres; and `unmapped: true`: treat a stationary echo as an unmapped wall
  (`Robot.Behaviour.Avoid`).
  """
  alias Hal.Profile
  alias Robot.{Localiser, Mission, Percept, Wish}
  alias Robot.Behaviour.Arbiter
  alias Robot.Percept.Sighting
  alias Nav.{Grid, KnownWalls}
  alias Robot.Behaviour.{Avoid, Escape, Rest}

  @most_corners 50

  @enforce_keys [:profile, :escape, :rest]
  defstruct @enforce_keys ++
              [
                tag: nil,
                module: nil,
                goal: nil,
                last_by: nil,
                weights: [],
                localiser: nil,
                percept: nil,
                look: nil,
                behaviour_looks?: false,
                walls: %KnownWalls{},
                discs: []
              ]

  @type t :: %__MODULE__{
          profile: Profile.t(),
          escape: Robot.Behaviour.t(),
          rest: Robot.Behaviour.t(),
          tag: term(),
          module: module() | nil,
          goal: Robot.Behaviour.t() | nil,
          last_by: atom(),
          weights: [{by :: atom(), weight :: float()}],
          localiser: Localiser.t() | nil,
          percept: Percept.t() | nil,
          look: float() | nil,
          behaviour_looks?: boolean(),
          walls: KnownWalls.t(),
          discs: [{x :: float(), y :: float(), radius :: float()}]
        }

  @doc """
  A controller without a goal. Options: `profile` (required), `start`, the pose in the map
  frame at which the odometry reads zero, with which the controller estimates the percept's pose by
  `Robot.Localiser`, and `departed`, see there; `plan`, the walls of a floor plan
  (`Nav.Grid`) in the map frame, or an empty `Nav.OccupancyGrid` for those that its sonars will
  have seen; without either it knows none; `marks`, what it knows of printed marks (`Robot.Config`); `seed`, that of the random numbers with which it looks for its place on the plan.
  """
  @spec new(keyword()) :: t()
  def new(options) do
    options =
      Keyword.validate!(
        options,
        [:profile, start: nil, departed: nil, plan: nil, marks: [], seed: 0]
      )

    case options[:profile] do
      %Profile{} = profile ->
        %__MODULE__{
          profile: profile,
          escape: Escape.new([]),
          rest: Rest.new([]),
          localiser: options[:start] && localiser(options),
          walls: KnownWalls.new(options[:plan])
        }

      other ->
        raise ArgumentError,
              "option profile: expected a %Hal.Profile{}, got #{inspect(other)}"
    end
  end

  defp localiser(options) do
    known = Localiser.PrintedMarks.new(options[:marks])
    localiser = Localiser.new(options[:start], options[:departed], options[:seed])
    %{localiser | printed: known}
  end

  @doc "Sets, changes or (with `nil`) drops the goal."
  @spec goal(t(), tag :: term(), {module(), keyword()} | nil) :: t()
  def goal(%__MODULE__{} = controller, _tag, nil),
    do: %{controller | tag: nil, module: nil, goal: nil}

  def goal(
        %__MODULE__{tag: tag, module: module, goal: nil} = controller,
        tag,
        {module, _options}
      ),
      do: controller

  def goal(%__MODULE__{tag: tag, module: module} = controller, tag, {module, options}),
    do: %{
      controller
      | goal: Robot.Behaviour.update(controller.goal, options),
        discs: Keyword.get(options, :discs, controller.discs)
    }

  def goal(%__MODULE__{} = controller, tag, {module, options}) do
    {own, options} = Keyword.split(options, [:discs, :unmapped])
    goal = Avoid.new([inner: module.new(options)] ++ own)
    %{controller | tag: tag, module: module, goal: goal, discs: own[:discs] || []}
  end

  @doc "Sets the references for the estimate of the pose."
  @spec anchors(t(), Localiser.Anchors.t()) :: t()
  def anchors(%__MODULE__{localiser: nil} = controller, _anchors), do: controller

  def anchors(%__MODULE__{} = controller, anchors),
    do: %{controller | localiser: Localiser.anchors(controller.localiser, anchors)}

  @doc """
  Carries out an order of the mission. Also returns the pan to which the camera should turn now,
  if any: the mission computed it from the percept of this tick, so it should not wait for the
  next one.
  """
  @spec obey(t(), Mission.order()) :: {t(), pan :: float() | nil}
  def obey(%__MODULE__{} = controller, {:goal, tag, goal}),
    do: {goal(controller, tag, goal), nil}

  def obey(%__MODULE__{} = controller, {:anchors, anchors}),
    do: {anchors(controller, anchors), nil}

  def obey(%__MODULE__{look: pan} = controller, {:look, pan}), do: {controller, nil}

  def obey(%__MODULE__{} = controller, {:look, pan}) do
    now = if controller.behaviour_looks?, do: nil, else: pan
    {%{controller | look: pan}, now}
  end

  @doc "Drops the goal and all other orders of the mission."
  @spec stand(t()) :: t()
  def stand(%__MODULE__{} = controller),
    do: %{(controller |> goal(:idle, nil) |> anchors(%Localiser.Anchors{})) | look: nil}

  @doc "The percept of the last tick, with the pose that the controller estimated."
  @spec percept(t()) :: Percept.t() | nil
  def percept(%__MODULE__{percept: percept}), do: percept

  @doc """
  What a tick tells the mission: the walls that the robot knows, if they are others than `before`, packed
  (`Nav.Grid.Packed`); then the percept without them, because they are large and seldom change: the
  mission's runner keeps them (`Robot.Mission.Runner`).
  """
  @spec report(before :: t(), now :: t()) :: [
          {:walls, Grid.Packed.t() | nil} | {:tick, Percept.t()}
        ]
  def report(%__MODULE__{} = before, %__MODULE__{percept: %Percept{} = percept} = now) do
    walls = walls(now)
    tick = {:tick, %{percept | grid: nil, ways: nil}}
    if walls == walls(before), do: [tick], else: [{:walls, Grid.Packed.pack(walls)}, tick]
  end

  @doc "What the robot knows of walls, as the percept of the last tick has it; `nil` for nothing."
  @spec walls(t()) :: Grid.t() | nil
  def walls(%__MODULE__{walls: walls}), do: KnownWalls.known(walls)

  @doc "The fault for which the robot stands, in one line for people; `nil` without one."
  @spec fault(t()) :: String.t() | nil
  def fault(%__MODULE__{escape: {Escape, state}}), do: Escape.fault(state)

  @doc """
  Runs one tick. Returns the chosen wish (`by` names its behaviour, `look` is where the camera
  should look now), and the goal's outcome at the tick at which it ends.
  """
  @spec tick(t(), Percept.t()) :: {Wish.t(), {tag :: term(), integer()} | nil, t()}
  def tick(%__MODULE__{} = controller, %Percept{} = percept) do
    {percept, controller} = locate(controller, Sighting.note(percept))
    {escaping, escape, nil} = run(controller.escape, percept)
    {resting, rest, nil} = run(controller.rest, percept)
    {wanted, goal, outcome} = run(controller.goal, percept)

    wishes = [escaping, wanted, resting]
    wish = Arbiter.choose(wishes, controller.last_by)
    weights = Arbiter.weights(wishes, controller.last_by)
    wish = if wish.look == nil and wanted != nil, do: %{wish | look: wanted.look}, else: wish
    looks? = wish.look != nil
    wish = %{wish | look: wish.look || controller.look}

    controller = %{
      controller
      | escape: escape,
        rest: rest,
        goal: goal,
        last_by: wish.by,
        weights: weights,
        behaviour_looks?: looks?
    }

    {wish, outcome && {controller.tag, outcome}, controller}
  end

  @doc """
  The behaviours that wished for something at the last tick, with the weights by which the arbiter compared them; the
  chosen one first.
  """
  @spec weights(t()) :: [{by :: atom(), weight :: float()}]
  def weights(%__MODULE__{weights: weights}), do: weights

  @doc "What made the goal's wish slower at the last tick, before the gate: `:caution` (`Robot.Behaviour.Avoid.Caution`)."
  @spec limits(t()) :: [:caution]
  def limits(%__MODULE__{goal: {Avoid, %{slow?: true}}}), do: [:caution]
  def limits(%__MODULE__{}), do: []

  @doc """
  The corners of the way that its goal takes round what stands about (map frame, metres), the goal last and #{@most_corners}
  at most; none where it takes no such way.
  """
  @spec way(t()) :: [Hal.Pose.point()]
  def way(%__MODULE__{goal: {Avoid, %{way: %Avoid.Route{corners: corners}}}}),
    do: Enum.take(corners, @most_corners)

  def way(%__MODULE__{}), do: []

  @doc """
  What `tick/2` chooses from on this percept: all wishes, by the weight with which the arbiter
  compares them, the chosen one first.
  """
  @spec wishes(t(), Percept.t()) :: [{Wish.t(), weight :: float()}]
  def wishes(%__MODULE__{} = controller, %Percept{} = percept) do
    {percept, controller} = locate(controller, Sighting.note(percept))

    for(
      behaviour <- [controller.escape, controller.goal, controller.rest],
      {%Wish{} = wish, _next, _outcome} <- [run(behaviour, percept)],
      do: {wish, Arbiter.weight(wish, controller.last_by)}
    )
    |> Enum.sort_by(&elem(&1, 1), :desc)
  end

  defp locate(%{localiser: nil} = controller, percept),
    do: {percept, %{controller | percept: percept}}

  defp locate(controller, percept) do
    # What its sonars have seen follows from its pose, and cannot correct it, but it tells which robots walls hide.
    given = %{percept | grid: walls(controller)}
    {percept, localiser} = Localiser.update(controller.localiser, given)
    plan? = Localiser.by_walls?(localiser)
    walls = KnownWalls.update(controller.walls, percept, controller.discs, plan?)
    percept = %{percept | grid: KnownWalls.known(walls), ways: KnownWalls.ways(walls)}
    {percept, %{controller | localiser: localiser, walls: walls, percept: percept}}
  end

  defp run(nil, _percept), do: {nil, nil, nil}

  defp run(behaviour, percept) do
    case Robot.Behaviour.tick(behaviour, percept) do
      {:running, wish, behaviour} -> {wish, behaviour, nil}
      {:done, outcome, wish} -> {wish, nil, outcome}
    end
  end
end
