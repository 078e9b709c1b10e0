defmodule Sim.Scenario.View do
  @moduledoc false
  # Describes what expectations look at in a run: the true state of the world, and what robots claim. Pure.
  alias Hal.Pose
  alias Robot.Mission.Runner
  alias Sim.{Radio, Scene, Trial, World}
  alias Sim.Trial.RunLog
  alias Swarm.Member

  @doc "Simulated seconds since the start."
  @spec at_s(Trial.t()) :: float()
  def at_s(trial), do: trial.at_ms / 1000

  @doc "The leader now, or `nil`."
  @spec leader(Trial.t()) :: atom() | nil
  def leader(trial), do: RunLog.leader(trial.run_log)

  @doc "The robots named by `who`: one, or of `:all` those that live."
  @spec who(Trial.t(), atom()) :: [atom()]
  def who(trial, :all), do: Trial.living(trial)
  def who(_trial, robot), do: [robot]

  @doc """
  The phase of a robot's mission; `:idle` without one, `:dead` if it was killed.
  """
  @spec phase(Trial.t(), atom()) :: atom()
  def phase(trial, robot) do
    case trial.members do
      %{^robot => member} ->
        with {_module, phase} <- Runner.state(Member.runner(member)), do: phase

      _dead ->
        :dead
    end
  end

  @doc "What the robot does for its group in the phase it is in (`Robot.Mission.roles/1`); `nil` for nothing."
  @spec role(Trial.t(), atom()) :: Robot.Mission.role() | nil
  def role(trial, robot), do: trial.run_log.roles[phase(trial, robot)]

  @doc "Each part of the radio's network, with those who lead in it."
  @spec leaders(Trial.t()) :: [{part :: [atom()], leaders :: [atom()]}]
  def leaders(trial) do
    for part <- Radio.parts(trial.radio, Trial.living(trial)),
        do: {part, Enum.filter(part, &(role(trial, &1) == :leads))}
  end

  @doc "The true pose of a robot."
  @spec pose(Trial.t(), atom()) :: Pose.t()
  def pose(trial, robot), do: World.truth(trial.world, robot)

  @doc "The true speed of a robot's body: m/s and rad/s."
  @spec speed(Trial.t(), atom()) :: {float(), float()}
  def speed(trial, robot), do: Map.fetch!(trial.world.robots, robot).speed

  @doc "How far living robots are from their slots, in metres; `nil` for one without a slot."
  @spec slot_errors(Trial.t(), [atom()]) :: [{atom(), float() | nil}]
  def slot_errors(trial, robots) do
    scene = Trial.scene(trial)

    for %{id: id, leader?: false} = robot <- scene.robots,
        id in robots,
        do: {id, if(robot.alive, do: Scene.slot_error(robot))}
  end

  @doc "The distance to the landmark that a robot measures, and the true one, in metres; or `nil`."
  @spec distance(Trial.t(), atom()) :: {measured :: float(), true_m :: float()} | nil
  def distance(%{world: %{landmark: landmark}} = trial, robot) do
    with %{^robot => member} <- trial.members,
         %{sight: %{distance: millimetres}} when millimetres != nil and landmark != nil <-
           RunLog.account(trial.run_log, Member.claim(member)),
         do: {millimetres / 1000, Pose.distance(pose(trial, robot), landmark)},
         else: (_does_not_see -> nil)
  end
end
