defmodule Bridge.Rmf.Command do
  @moduledoc """
  Decides for one robot what a fleet adapter of Open-RMF is told of its commands. Pure.

  The adapter numbers its commands, each robot's from 1 in one life of it, and repeats one until it is accepted. It takes a
  command for done when its number is the one that was completed last. So a number that is the same twice is one command, and
  what was completed is forgotten when another one comes: an adapter that was started again begins with 1.

  The contract cannot say that a robot has given up. A command counts as completed only if the robot is there; a robot that
  ended elsewhere asks for another way (`replan`), once.
  """
  alias Hal.Pose

  # A `Goto` has arrived within 0.1 m by its own estimate, which may be corrected afterwards.
  @near_m 0.5
  # A robot that moves less between two looks stands.
  @still_m 0.005
  # The speed (m/s) that its wheels report at rest.
  @still_m_s 0.01
  # What is seen of a robot of a mesh may be so old.
  @old_ms 1_000

  defstruct id: nil, goal: nil, given_ms: nil, completed: nil, replan: :no

  @typedoc """
  The number and the goal of the command that the robot has, a pose or `:stop`; when the robot accepted it (`nil`: not yet), and the
  number that was completed last.
  """
  @type t :: %__MODULE__{
          id: integer() | nil,
          goal: Pose.t() | :stop | nil,
          given_ms: integer() | nil,
          completed: integer() | nil,
          replan: :no | :ask | :asked
        }

  @doc """
  A command is asked for: `:same` if the robot has it, else it is to be given.

      iex> alias Bridge.Rmf.Command
      iex> {:new, command} = Command.asked(%Command{completed: 7}, 1, :stop)
      iex> {command.completed, elem(Command.asked(Command.given(command, 1, 500), 1, :stop), 0)}
      {nil, :same}
  """
  @spec asked(t(), id :: integer(), Pose.t() | :stop) :: {:same | :new, t()}
  def asked(%__MODULE__{id: id, goal: goal, given_ms: given_ms} = command, id, goal)
      when given_ms != nil,
      do: {:same, command}

  def asked(_command, id, goal), do: {:new, %__MODULE__{id: id, goal: goal}}

  @doc "The robot has accepted the command with this number."
  @spec given(t(), id :: integer(), at_ms :: integer()) :: t()
  def given(%__MODULE__{id: id} = command, id, at_ms), do: %{command | given_ms: at_ms}
  def given(command, _earlier, _at_ms), do: command

  @doc """
  The robot was looked at, at this time and once before: is the command done?

      iex> alias Bridge.Rmf.Command
      iex> command = Command.given(%Command{id: 3, goal: Hal.Pose.new(1, 2)}, 3, 500)
      iex> robot = %{pose: Hal.Pose.new(1.02, 2), state: :done}
      iex> Command.seen(command, robot, robot, 1_400).completed
      nil
      iex> Command.seen(command, robot, robot, 1_600).completed
      3
      iex> Command.seen(command, %{robot | state: :given_up}, robot, 1_600).replan
      :ask
  """
  @spec seen(t(), robot :: map(), before :: map() | nil, at_ms :: integer()) :: t()
  def seen(%__MODULE__{given_ms: given_ms} = command, _robot, _before, at_ms)
      when given_ms == nil or at_ms - given_ms <= @old_ms,
      do: command

  def seen(%__MODULE__{completed: id, id: id} = command, _robot, _before, _at_ms), do: command
  def seen(command, %{pose: nil}, _before, _at_ms), do: command

  def seen(%__MODULE__{goal: :stop} = command, robot, before, _at_ms) do
    # What is seen of a mesh may be the same report twice, so its wheels must say so, too.
    stands? =
      match?(%{pose: %Pose{}}, before) and moved(robot, before) < @still_m and
        is_number(robot.speed) and abs(robot.speed) < @still_m_s

    if stands?, do: %{command | completed: command.id}, else: command
  end

  def seen(%__MODULE__{goal: goal} = command, robot, _before, _at_ms) do
    ended? = robot.state in [:done, :given_up, :idle]

    cond do
      robot.state == :done and Pose.distance(robot.pose, goal) <= @near_m ->
        %{command | completed: command.id}

      ended? and command.replan == :no ->
        %{command | replan: :ask}

      true ->
        command
    end
  end

  defp moved(robot, before), do: Pose.distance(robot.pose, before.pose)

  @doc "What the adapter is told, and the command after that: another way is asked for once."
  @spec told(t()) :: {%{last_completed_request: integer() | nil, replan: boolean()}, t()}
  def told(%__MODULE__{replan: :ask} = command),
    do: {%{last_completed_request: command.completed, replan: true}, %{command | replan: :asked}}

  def told(command), do: {%{last_completed_request: command.completed, replan: false}, command}
end
