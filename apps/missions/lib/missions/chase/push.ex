defmodule Missions.Chase.Push do
  @moduledoc """
  Computes how the driver gets behind the ball, and pushes it towards the goal. Pure; metres in the map frame, radians.

  It drives to a place behind the ball, seen from the goal, round the ball. From there it drives at the ball. A round body pushes a ball along the line
  between the two, so it steers to where that line points at the goal: with the direction `b` to the ball and `g` from the ball to the goal, it drives in the
  direction `b + 1.5 (b - g)`. Beside a wall the place behind may have no room; then it takes the nearest one round the ball that has.
  """
  alias Hal.Pose
  alias Nav.Reach

  # Between the bodies at the place behind the ball, and there.
  @behind 0.35
  @gain 1.5
  @most 1.0
  # It pushes from within this angle of where it should be behind the ball, until it is beyond the other one.
  @begins 0.3
  @ends 0.9
  @far 0.3
  # Others must be so far from the ball before it is pushed.
  @alone 0.5
  # A way has so much more room, if there is one; a corner is passed within this distance (metres).
  @wide 0.2
  @corner 0.4
  # Sides round the ball, the best first.
  @sides [0, 1, -1, 2, -2, 3, -3, 4, -4] |> Enum.map(&(&1 * :math.pi() / 6))

  @typedoc "Of the ball: its place and radius; of the robot its radius; places of others that stand about; all others."
  @type scene :: %{
          required(:ball) => Pose.point(),
          required(:ball_radius) => float(),
          required(:goal) => Pose.point(),
          required(:radius) => float(),
          required(:grid) => Nav.Grid.t() | nil,
          required(:taken) => [Pose.point()],
          optional(:others) => [{atom(), Pose.point(), :moving | :holding | :dead}],
          optional(atom()) => term()
        }

  @doc """
  Where the ball is to be pushed next, on its way to the goal past walls: the first corner of a way with room for the robot that pushes, that is not
  there yet; the goal itself without walls, or where they leave no way.

      iex> Missions.Chase.Push.aim({0.0, 0.0}, {3.0, 0.0}, nil, 0.2)
      {3.0, 0.0}
  """
  @spec aim(Pose.point(), Pose.point(), Nav.Grid.t() | nil, float()) :: Pose.point()
  def aim(_ball, goal, nil, _radius), do: goal

  def aim(ball, goal, grid, radius) do
    way =
      Enum.find_value([@wide, 0.0], fn more ->
        Nav.Grid.Way.find(grid, ball, goal, Reach.room(radius) + more)
      end)

    Enum.find(way || [], goal, &(Pose.distance(&1, ball) > @corner))
  end

  @doc "Where to stand behind the ball, and by which angle this is beside the line to the goal; `nil` where nowhere is room."
  @spec behind(scene()) :: {Pose.point(), side :: float()} | nil
  def behind(%{ball: {x, y} = ball, goal: goal} = scene) do
    direction = direction(ball, goal)
    far = scene.radius + scene.ball_radius + @behind

    Enum.find_value(@sides, fn side ->
      place = {x - far * :math.cos(direction + side), y - far * :math.sin(direction + side)}
      free? = Enum.all?(scene.taken, &(Pose.distance(&1, place) > 2 * scene.radius + 0.2))
      if free? and Reach.place(scene.grid, place, scene.radius) == :ok, do: {place, side}
    end)
  end

  @doc """
  Whether a robot at a pose that pushes goes on, or one that does not begins, to push with the goal this angle beside.

      iex> scene = %{ball: {0.0, 0.0}, goal: {3.0, 0.0}, ball_radius: 0.1, radius: 0.2, grid: nil, taken: []}
      iex> for {x, y} <- [{-0.6, 0.0}, {-0.5, 0.3}, {0.5, 0.0}],
      ...>   do: {Missions.Chase.Push.pushes?(scene, Hal.Pose.new(x, y), 0.0, false), Missions.Chase.Push.pushes?(scene, Hal.Pose.new(x, y), 0.0, true)}
      [{true, true}, {false, true}, {false, false}]
  """
  @spec pushes?(scene(), Pose.t(), float(), boolean()) :: boolean()
  def pushes?(%{ball: ball} = scene, pose, side, pushes?) do
    far = Pose.distance(pose, ball)
    most = scene.radius + scene.ball_radius + @behind + @far
    beside = abs(beside(scene, pose, side))
    if pushes?, do: beside < @ends and far < most + 0.3, else: beside < @begins and far < most
  end

  @doc "Whether no other living robot is near the ball."
  @spec alone?(scene()) :: boolean()
  def alone?(scene) do
    Enum.all?(scene.others, fn {_id, at, mode} ->
      mode == :dead or Pose.distance(at, scene.ball) > @alone + scene.radius
    end)
  end

  @doc "The velocity with which to push, of this speed."
  @spec velocity(scene(), Pose.t(), float(), float()) :: {float(), float()}
  def velocity(%{ball: ball} = scene, pose, side, speed) do
    turn = (@gain * beside(scene, pose, side)) |> max(-@most) |> min(@most)
    direction = direction(Pose.point(pose), ball) + turn
    {speed * :math.cos(direction), speed * :math.sin(direction)}
  end

  defp beside(%{ball: ball, goal: goal}, pose, side),
    do: Pose.wrap(direction(Pose.point(pose), ball) - direction(ball, goal) - side)

  @doc "The direction from a place to another one."
  @spec direction(Pose.point(), Pose.point()) :: float()
  def direction({ax, ay}, {bx, by}), do: :math.atan2(by - ay, bx - ax)
end
