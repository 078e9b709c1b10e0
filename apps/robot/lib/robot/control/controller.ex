defmodule Robot.Control.Controller do
  @moduledoc """
  One tick of a robot's decisions as a function: the present goal, wrapped in
  `Robot.Behaviour.Avoid`, the escape from a touched bumper, and rest make wishes; the arbiter
  chooses one. Pure.

  A goal has a tag. Setting a goal with the same tag and module changes the options of the running
  behaviour (for example a target that moves); another tag or module starts afresh. A goal that
  has ended stays ended until another one comes.

  The camera looks where the chosen behaviour wants it, else where the goal's behaviour wants it,
  else where the mission last ordered it.

  In addition to its behaviour's own options a goal takes `discs: [{x, y, radius}]`: standing
  obstacles to avoid, in the map frame, metres.
  """
  alias Hal.Profile
  alias Robot.{Behaviour, Localiser, Mission, Percept, Wish}
  alias Robot.Control.Arbiter
  alias Robot.Behaviour.{Avoid, Escape, Rest}

  @enforce_keys [:profile, :escape, :rest]
  defstruct @enforce_keys ++
              [
                tag: nil,
                module: nil,
                goal: nil,
                last_by: nil,
                localiser: nil,
                percept: nil,
                look: nil,
                behaviour_looks?: false
              ]

  @type t :: %__MODULE__{
          profile: Profile.t(),
          escape: Behaviour.t(),
          rest: Behaviour.t(),
          tag: term(),
          module: module() | nil,
          goal: Behaviour.t() | nil,
          last_by: atom(),
          localiser: Localiser.t() | nil,
          percept: Percept.t() | nil,
          look: float() | nil,
          behaviour_looks?: boolean()
        }

  @doc """
  A controller without a goal. Options: `profile` (required), `start`, the pose in the map
  frame at which the odometry reads zero, with which the controller estimates the percept's pose by
  `Robot.Localiser`, and `departed`, see there.
  """
  @spec new(keyword()) :: t()
  def new(options) do
    options = Keyword.validate!(options, [:profile, start: nil, departed: nil])

    case options[:profile] do
      %Profile{} = profile ->
        %__MODULE__{
          profile: profile,
          escape: Escape.new([]),
          rest: Rest.new([]),
          localiser: options[:start] && Localiser.new(options[:start], options[:departed])
        }

      other ->
        raise ArgumentError,
              "option profile cannot be #{inspect(other)}: a %Hal.Profile{} is allowed"
    end
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
    do: %{controller | goal: Behaviour.update(controller.goal, options)}

  def goal(%__MODULE__{} = controller, tag, {module, options}) do
    {discs, options} = Keyword.pop(options, :discs, [])
    goal = Avoid.new(inner: module.new(options), discs: discs)
    %{controller | tag: tag, module: module, goal: goal}
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

  @doc "The fault for which the robot stands, in one line for people; `nil` without one."
  @spec fault(t()) :: String.t() | nil
  def fault(%__MODULE__{escape: {Escape, state}}), do: Escape.fault(state)

  @doc """
  Runs one tick. Returns the chosen wish (`by` names its behaviour, `look` is where the camera
  should look now), and the goal's outcome at the tick at which it ends.
  """
  @spec tick(t(), Percept.t()) :: {Wish.t(), {tag :: term(), integer()} | nil, t()}
  def tick(%__MODULE__{} = controller, %Percept{} = percept) do
    {percept, controller} = locate(controller, percept)
    {escaping, escape, nil} = run(controller.escape, percept)
    {resting, rest, nil} = run(controller.rest, percept)
    {wanted, goal, outcome} = run(controller.goal, percept)

    wish = Arbiter.choose([escaping, wanted, resting], controller.last_by)
    wish = if wish.look == nil and wanted != nil, do: %{wish | look: wanted.look}, else: wish
    looks? = wish.look != nil
    wish = %{wish | look: wish.look || controller.look}

    controller = %{
      controller
      | escape: escape,
        rest: rest,
        goal: goal,
        last_by: wish.by,
        behaviour_looks?: looks?
    }

    {wish, outcome && {controller.tag, outcome}, controller}
  end

  defp locate(%{localiser: nil} = controller, percept),
    do: {percept, %{controller | percept: percept}}

  defp locate(controller, percept) do
    {percept, localiser} = Localiser.update(controller.localiser, percept)
    {percept, %{controller | localiser: localiser, percept: percept}}
  end

  defp run(nil, _percept), do: {nil, nil, nil}

  defp run(behaviour, percept) do
    case Behaviour.tick(behaviour, percept) do
      {:running, wish, behaviour} -> {wish, behaviour, nil}
      {:done, outcome, wish} -> {wish, nil, outcome}
    end
  end
end
