defmodule Sim.Scenario.View do
  @moduledoc false
  # A run at one moment as expectations look at it: the true state of the world, and what robots claim. The same of a run in
  # lockstep and of a fleet of processes (`Sim.Fleet.moment/1`). Pure.
  alias Hal.Pose
  alias Robot.Mission.Runner
  alias Sim.{Radio, Scene, Trial, World}
  alias Sim.Trial.{Evaluation, RunLog}
  alias Swarm.Member

  @enforce_keys [:at_ms, :options, :world, :run_log, :claims, :phases, :parts]
  defstruct @enforce_keys

  @typedoc """
  `claims` and `phases` are those of the living robots, `parts` the robots that can reach each other by radio.
  """
  @type t :: %__MODULE__{
          at_ms: non_neg_integer(),
          options: map(),
          world: World.t(),
          run_log: RunLog.t(),
          claims: [{atom(), map()}],
          phases: %{atom() => atom()},
          parts: [[atom()]]
        }

  @doc "A run in lockstep after a step, or a moment of a fleet."
  @spec of(Trial.t() | Sim.Fleet.moment()) :: t()
  def of(%Trial{} = trial) do
    living = Trial.living(trial)

    %__MODULE__{
      at_ms: trial.at_ms,
      options: trial.options,
      world: trial.world,
      run_log: trial.run_log,
      claims: Trial.claims(trial),
      phases: for(id <- living, into: %{}, do: {id, phase_of(trial.members[id])}),
      parts: Radio.parts(trial.radio, living)
    }
  end

  def of(moment), do: struct!(__MODULE__, moment)

  defp phase_of(member),
    do: with({_module, phase} <- Runner.state(Member.runner(member)), do: phase)

  @doc "Simulated seconds since the start."
  @spec at_s(t()) :: float()
  def at_s(view), do: view.at_ms / 1000

  @doc "The leader now, or `nil`."
  @spec leader(t()) :: atom() | nil
  def leader(view), do: RunLog.leader(view.run_log)

  @doc "The robots that live, in the order of the fleet."
  @spec living(t()) :: [atom()]
  def living(view), do: for({id, _claim} <- view.claims, do: id)

  @doc "The robots named by `who`: one, or of `:all` those that live."
  @spec who(t(), atom()) :: [atom()]
  def who(view, :all), do: living(view)
  def who(_view, robot), do: [robot]

  @doc """
  The phase of a robot's mission; `:idle` without one, `:dead` if it was killed.
  """
  @spec phase(t(), atom()) :: atom()
  def phase(view, robot), do: Map.get(view.phases, robot, :dead)

  @doc "What the robot does for its group in the phase it is in (`Robot.Mission.roles/1`); `nil` for nothing."
  @spec role(t(), atom()) :: Robot.Mission.role() | nil
  def role(view, robot), do: view.run_log.roles[phase(view, robot)]

  @doc "Each part of the radio's network, with those who lead in it (`Sim.Trial.RunLog.leaders/2`)."
  @spec leaders(t()) :: [{part :: [atom()], leaders :: [atom()]}]
  def leaders(view),
    do: RunLog.leaders(for(id <- living(view), do: {id, %{role: role(view, id)}}), view.parts)

  @doc "The true pose of a robot."
  @spec pose(t(), atom()) :: Pose.t()
  def pose(view, robot), do: World.truth(view.world, robot)

  @doc "The true speed of a robot's body: m/s and rad/s."
  @spec speed(t(), atom()) :: {float(), float()}
  def speed(view, robot), do: Map.fetch!(view.world.robots, robot).speed

  @doc "How far living robots are from their slots, in metres; `nil` for one without a slot."
  @spec slot_errors(t(), [atom()]) :: [{atom(), float() | nil}]
  def slot_errors(view, robots) do
    run = %{view | claims: Map.new(view.claims)} |> Map.from_struct()
    scene = Evaluation.scene(Map.put(run, :messages, %{sent: 0, lost: 0}))

    for %{id: id, leader?: false} = robot <- scene.robots,
        id in robots,
        do: {id, if(robot.alive, do: Scene.slot_error(robot))}
  end

  @doc "The distance to the landmark that a robot measures, and the true one, in metres; or `nil`."
  @spec distance(t(), atom()) :: {measured :: float(), true_m :: float()} | nil
  def distance(%{world: %{landmark: landmark}} = view, robot) do
    with {_id, claim} <- List.keyfind(view.claims, robot, 0),
         %{sight: %{distance: millimetres}} when millimetres != nil and landmark != nil <-
           RunLog.account(view.run_log, claim),
         do: {millimetres / 1000, Pose.distance(pose(view, robot), landmark)},
         else: (_does_not_see -> nil)
  end
end
