defmodule Robot.Mission.Runner do
  @moduledoc """
  The life of a robot's mission as a function: started, in command, halted by a stop, resumed. Pure, as far as
  the mission is; `Robot.Control.Pilot` runs it in a process, `Swarm.Member` in lockstep.

  An idle robot's mission hears nothing. The caller carries out the effects, in their order, except
  `{:claim, map}`: what the mission claims is kept here, until it is halted.
  """
  alias Robot.{Behaviour, Mission}

  @enforce_keys [:robot]
  defstruct @enforce_keys ++
              [module: nil, mission: nil, phase: :idle, claim: %{}, halted: nil]

  @typedoc "`module` is `nil` while the robot is idle; `halted` is what the last stop left for `resume/1`."
  @type t :: %__MODULE__{
          robot: atom(),
          module: module() | nil,
          mission: term(),
          phase: atom(),
          claim: map(),
          halted: {module(), mission :: term()} | nil
        }

  @type state :: :idle | {module(), phase :: atom()}

  @doc "An idle robot's."
  @spec new(robot :: atom()) :: t()
  def new(robot), do: %__MODULE__{robot: robot}

  @doc "Starts a mission, in place of any other, and of what a stop has left of one."
  @spec start(t(), module(), keyword()) :: {t(), [Mission.effect()]}
  def start(%__MODULE__{} = runner, module, options) do
    runner = %{runner | module: module, claim: %{}, halted: nil}
    follow(runner, module.init(runner.robot, options))
  end

  @doc """
  Puts what the last stop has left of a mission in command again; the command that it waits for comes next.
  `{:error, :idle}` where there is nothing to take up.
  """
  @spec resume(t()) :: {:ok, t()} | {:error, :idle}
  def resume(%__MODULE__{module: nil, halted: {module, mission}} = runner),
    do: {:ok, %{runner | module: module, mission: mission, halted: nil}}

  def resume(%__MODULE__{}), do: {:error, :idle}

  @doc "Hands an event to the mission; an idle robot's is lost. A goal that is not one raises `ArgumentError`."
  @spec handle(t(), Mission.event()) :: {t(), [Mission.effect()]}
  def handle(%__MODULE__{module: nil} = runner, _event), do: {runner, []}

  def handle(%__MODULE__{module: module, mission: mission} = runner, event),
    do: follow(runner, module.handle(event, mission))

  @doc "Takes the mission out of command; it only says what it leaves (`c:Robot.Mission.halted/1`)."
  @spec halt(t()) :: t()
  def halt(%__MODULE__{module: nil} = runner), do: runner

  def halt(%__MODULE__{module: module, mission: mission} = runner) do
    left = if function_exported?(module, :halted, 1), do: module.halted(mission)
    %{new(runner.robot) | halted: left && {module, left}}
  end

  @doc "What the robot is up to."
  @spec state(t()) :: state()
  def state(%__MODULE__{module: nil}), do: :idle
  def state(%__MODULE__{module: module, phase: phase}), do: {module, phase}

  defp follow(runner, {phase, mission, effects}) when is_atom(phase) and is_list(effects) do
    runner = %{runner | phase: phase, mission: mission}
    {Enum.reduce(effects, runner, &note/2), effects}
  end

  defp note({:claim, claim}, runner) when is_map(claim), do: %{runner | claim: claim}

  # A wrong one is the mission's fault, which crashes with it, and not the controller.
  defp note({:goal, _tag, goal}, runner) do
    with {:error, line} <- Behaviour.check(goal), do: raise(ArgumentError, line)
    runner
  end

  defp note(_effect, runner), do: runner
end
