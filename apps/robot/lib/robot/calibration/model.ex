defmodule Robot.Calibration.Model do
  @moduledoc """
  Models a base whose odometry has errors in its wheels. Pure.

  Three numbers, each 1.0 for wheels without error:

  | number | meaning |
  |---|---|
  | `distance` | metres truly driven for each metre of odometry |
  | `base` | the true wheel base divided by that of odometry, if all else is right |
  | `ratio` | the way of the right wheel for each metre of the left one |

  A **run** is the result of one square: its direction, and the offset of its true end from its
  end by odometry, in the frame of its start (x forward, y left, metres).
  """
  alias Hal.Pose
  alias Hal.Drive.Wheels

  @type direction :: :cw | :ccw
  @type run :: {direction(), {x :: float(), y :: float()}}
  @type t :: %__MODULE__{distance: float(), base: float(), ratio: float()}

  defstruct distance: 1.0, base: 1.0, ratio: 1.0

  # A leg is divided into this many pieces, because unequal wheels drive an arc.
  @steps 12

  @doc "The direction of a square in words."
  @spec words(direction()) :: String.t()
  def words(:cw), do: "clockwise"
  def words(:ccw), do: "counter-clockwise"

  @doc """
  The offset of the true end of a square from its end by odometry, for these wheels, sides of
  `side` metres, and a wheel base of `b` metres.

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

  @doc "The true step of a base with these wheels that reports `step`; `b` is its wheel base."
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
