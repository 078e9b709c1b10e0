defmodule Robot.Mission.Runner do
  @moduledoc """
  Runs the life cycle of a robot's mission as a function: start, events, halt by a stop, resume. Pure if the mission is;
  a part of `Robot.Control.Pilot`.

  Events for an idle robot are dropped. The caller carries out the effects, in their order, except
  `{:claim, map}`: the mission's claim is kept here until the mission is halted.
  """
  alias Robot.{Mission, Percept}
  alias Robot.Localiser.Anchors
  alias Robot.Mission.{Claim, Letter}
  alias Nav.Grid
  import Robot.Mission, only: [is_order: 1]

  # Radians: one that is far beyond any head.
  @most_pan 1.0e6

  @enforce_keys [:robot]
  defstruct @enforce_keys ++
              [
                module: nil,
                mission: nil,
                phase: :idle,
                claim: %{},
                ticked_ms: nil,
                astray: nil,
                halted: nil,
                grid: nil,
                refused: 0
              ]

  @typedoc """
  `module` is `nil` while the robot is idle; `halted` is the mission that the last stop left for
  `resume/1`. `ticked_ms` is the time of the last percept that the mission handled: its claim is
  as old as that, whatever else it has heard since. `refused` counts the messages that were not for it
  (`Robot.Mission.Letter`). `grid` is what the robot knows of walls: each percept gets it on its
  way to the mission. `astray` is why the robot did not know its place at that tick (`Robot.Percept.astray/1`).
  """
  @type t :: %__MODULE__{
          robot: atom(),
          module: module() | nil,
          mission: term(),
          phase: atom(),
          claim: map(),
          ticked_ms: integer() | nil,
          astray: String.t() | nil,
          halted: {module(), mission :: term()} | nil,
          grid: Grid.t() | nil,
          refused: non_neg_integer()
        }

  @type state :: :idle | {module(), phase :: atom()}

  @doc "The runner of an idle robot that knows these walls (`walls/2` changes them)."
  @spec new(robot :: atom(), Grid.t() | nil) :: t()
  def new(robot, grid \\ nil), do: %__MODULE__{robot: robot, grid: grid}

  @doc "Sets what the robot knows of walls from now on."
  @spec walls(t(), Grid.t() | nil) :: t()
  def walls(%__MODULE__{} = runner, grid), do: %{runner | grid: grid}

  @doc "Starts a mission; it replaces any other, and the mission that a stop has left."
  @spec start(t(), module(), keyword()) :: {t(), [Mission.effect()]}
  def start(%__MODULE__{} = runner, module, options) do
    runner = %{runner | module: module, claim: %{}, ticked_ms: nil, halted: nil}
    follow(runner, module.init(runner.robot, options))
  end

  @doc """
  Resumes the mission that the last stop has left; the caller then hands it the command that it
  waits for. `{:error, :idle}` if a mission runs or none was left.
  """
  @spec resume(t()) :: {:ok, t()} | {:error, :idle}
  def resume(%__MODULE__{module: nil, halted: {module, mission}} = runner),
    do: {:ok, %{runner | module: module, mission: mission, halted: nil}}

  def resume(%__MODULE__{}), do: {:error, :idle}

  @doc """
  Hands an event to the mission; an idle robot drops it. An invalid order among the effects raises
  `ArgumentError`.
  """
  @spec handle(t(), Mission.event()) :: {t(), [Mission.effect()]}
  def handle(%__MODULE__{module: nil} = runner, _event), do: {runner, []}

  def handle(%__MODULE__{module: module} = runner, {:message, message}) do
    case Letter.open(module, message) do
      {:ok, message} -> follow(runner, module.handle({:message, message}, runner.mission))
      :refused -> {%{runner | refused: runner.refused + 1}, []}
    end
  end

  def handle(%__MODULE__{module: module, mission: mission} = runner, event),
    do: runner |> note_tick(event) |> follow(module.handle(walled(event, runner), mission))

  defp walled({:tick, %Percept{} = percept}, %{grid: grid}) when grid != nil,
    do: {:tick, %{percept | grid: grid}}

  defp walled(event, _runner), do: event

  defp note_tick(runner, {:tick, %Percept{at_ms: at_ms} = percept}),
    do: %{runner | ticked_ms: at_ms, astray: Percept.astray(percept)}

  defp note_tick(runner, _event), do: runner

  @doc """
  What the mission claims now. A robot that does not know where it is claims neither that it is in its place nor that all have
  what the mission wants, and says why.

      iex> runner = %{Robot.Mission.Runner.new(:mag1) | claim: %{phase: :follow, in_place: true, unsure: false}}
      iex> Robot.Mission.Runner.claim(%{runner | astray: "two places fit: here, or 6.2,3.1"})
      %{phase: :follow, in_place: false, unsure: true, says: "two places fit: here, or 6.2,3.1"}
      iex> Robot.Mission.Runner.claim(runner) == runner.claim
      true
  """
  @spec claim(t()) :: map()
  def claim(%__MODULE__{claim: claim, astray: why}), do: withheld(claim, why)

  defp withheld(claim, nil), do: claim

  defp withheld(claim, why) do
    claim =
      if claim[:in_place], do: Map.merge(claim, %{in_place: false, unsure: true}), else: claim

    claim = if claim[:formed], do: %{claim | formed: false}, else: claim
    Map.put(claim, :says, why)
  end

  @doc "What the mission says of itself (`c:Robot.Mission.explain/1`); `[]` for one that says nothing."
  @spec explain(t()) :: [{label :: String.t(), text :: String.t()}]
  def explain(%__MODULE__{module: nil}), do: []

  def explain(%__MODULE__{module: module, mission: mission}),
    do: if(function_exported?(module, :explain, 1), do: module.explain(mission), else: [])

  @doc "What the mission draws over the map (`c:Robot.Mission.layer/1`); `[]` for one that draws nothing."
  @spec layer(t()) :: Mission.layer()
  def layer(%__MODULE__{module: nil}), do: []

  def layer(%__MODULE__{module: module, mission: mission}),
    do: if(function_exported?(module, :layer, 1), do: module.layer(mission), else: [])

  @doc "The map that the mission has made, also one that a stop has left; `nil` of one that makes none."
  @spec map(t()) :: Nav.MapFile.Writer.raster() | nil
  def map(%__MODULE__{module: nil, halted: nil}), do: nil
  def map(%__MODULE__{module: nil, halted: {module, mission}}), do: map(module, mission)
  def map(%__MODULE__{module: module, mission: mission}), do: map(module, mission)

  defp map(module, mission),
    do: if(function_exported?(module, :map, 1), do: module.map(mission))

  @doc "Ends the mission and keeps what it leaves for `resume/1` (`c:Robot.Mission.halted/1`)."
  @spec halt(t()) :: t()
  def halt(%__MODULE__{module: nil} = runner), do: runner

  def halt(%__MODULE__{module: module, mission: mission} = runner) do
    left = if function_exported?(module, :halted, 1), do: module.halted(mission)
    %{new(runner.robot, runner.grid) | halted: left && {module, left}}
  end

  @doc "The mission and its phase, or `:idle`."
  @spec state(t()) :: state()
  def state(%__MODULE__{module: nil}), do: :idle
  def state(%__MODULE__{module: module, phase: phase}), do: {module, phase}

  defp follow(runner, {phase, mission, effects}) when is_atom(phase) and is_list(effects) do
    runner = %{runner | phase: phase, mission: mission}
    effects = Enum.map(effects, &said(&1, runner.module))
    {Enum.reduce(effects, runner, &note/2), Enum.map(effects, &told(&1, runner.astray))}
  end

  defp told({:claim, claim}, why), do: {:claim, withheld(claim, why)}
  defp told(effect, _why), do: effect

  defp said({:tell, to, kind, fields}, module),
    do: {:send, to, Letter.new!(module, to, kind, fields)}

  defp said({:claim, to, claim}, module) do
    %Claim{} = claim = Claim.new(module, claim)
    {:send, to, claim}
  end

  defp said(effect, _module), do: effect

  defp note({:claim, claim}, runner) when is_map(claim), do: %{runner | claim: claim}

  # An invalid order is an error of the mission, so the mission crashes, not the controller.
  defp note(order, runner) when is_order(order) do
    with {:error, line} <- check(order), do: raise(ArgumentError, line)
    runner
  end

  defp note(_effect, runner), do: runner

  defp check({:goal, _tag, goal}), do: Robot.Behaviour.check(goal)
  defp check({:anchors, %Anchors{}}), do: :ok
  defp check({:look, nil}), do: :ok
  defp check({:look, pan}) when is_number(pan) and abs(pan) < @most_pan, do: :ok

  defp check(other),
    do: {:error, "expected an order of a mission, got #{inspect(other, limit: 5)}"}
end
