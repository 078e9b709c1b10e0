defmodule Robot.Calibration.Model do
  @moduledoc """
  A model of a base whose odometry has errors in its wheels. Pure.

  Three numbers, each 1.0 for wheels that are what the robot takes them for:

  | number | meaning |
  |---|---|
  | `distance` | metres truly driven for each metre of odometry |
  | `base` | the true wheel base for each metre of the one that odometry reckons with, all else right |
  | `ratio` | way of the right wheel for each metre of the left one |

  A **run** is what a square gave: the way round, and by how much its true end was off the end that
  odometry told, in the frame of its start (x forward, y left, metres).
  """
  alias Hal.Pose
  alias Hal.Drive.Wheels

  @type direction :: :cw | :ccw
  @type run :: {direction(), {x :: float(), y :: float()}}
  @type t :: %__MODULE__{distance: float(), base: float(), ratio: float()}

  defstruct distance: 1.0, base: 1.0, ratio: 1.0

  # Pieces of a leg: the way of unequal wheels is an arc.
  @steps 12

  @doc "The way round in words."
  @spec words(direction()) :: String.t()
  def words(:cw), do: "clockwise"
  def words(:ccw), do: "counter-clockwise"

  @doc """
  By how much the true end of a square would be off the one that odometry tells, with these wheels.

      iex> Robot.Calibration.Model.predict(%Robot.Calibration.Model{}, :cw, 4.0, 0.4)
      {0.0, 0.0}
  """
  @spec predict(t(), direction(), float(), float()) :: {float(), float()}
  def predict(%__MODULE__{} = wheels, direction, side, b) do
    quarter = if direction == :cw, do: -:math.pi() / 2, else: :math.pi() / 2
    legs = List.duplicate([{:go, side}, {:turn, quarter}], 4) |> List.flatten()
    {tx, ty} = legs |> follow(wheels, b) |> Pose.point()
    {ox, oy} = legs |> follow(%__MODULE__{}, b) |> Pose.point()
    {tx - ox, ty - oy}
  end

  defp follow(legs, wheels, b) do
    for leg <- legs, _piece <- 1..@steps, reduce: Pose.new(0, 0) do
      pose -> drive(pose, true_step(piece(leg), wheels, b))
    end
  end

  defp piece({:go, way}), do: {way / @steps, 0.0}
  defp piece({:turn, turn}), do: {0.0, turn / @steps}

  @doc "What a base with these wheels truly did that says it did `step`."
  @spec true_step(Wheels.step(), t(), float()) :: Wheels.step()
  def true_step(step, %__MODULE__{} = wheels, b) do
    {way, turn} = Wheels.correct(step, b, wheels.ratio)
    {way * wheels.distance, turn * wheels.distance / wheels.base}
  end

  defp drive(pose, {way, turn}) do
    middle = pose.heading + turn / 2

    Pose.new(
      pose.x + way * :math.cos(middle),
      pose.y + way * :math.sin(middle),
      pose.heading + turn
    )
  end
end
