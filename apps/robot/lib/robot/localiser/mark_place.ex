defmodule Robot.Localiser.MarkPlace do
  @moduledoc """
  Computes where a printed mark is, by the robot that reads it, and by several: one place with its uncertainty. Pure; metres in the
  `map` frame.

  A mission tells what `of/2` says of a mark to the others, and joins what it hears by `fuse/1`. The mark may be that of the
  landmark.
  """
  alias Hal.Pose
  alias Robot.Localiser.Anchors
  alias Robot.Percept
  alias Vision.Mark

  # Two sightings that are farther apart than so many standard deviations are not of one mark.
  @gate 3.5

  @typedoc "A place, and the variance of x, the covariance of x and y, and the variance of y (m2)."
  @type t :: {Pose.point(), {xx :: float(), xy :: float(), yy :: float()}}

  @doc """
  Where a mark is that was read in the percept's picture: `nil` if the robot does not know its pose, or the mark's range. The
  uncertainty is that of the range along the line of sight, that of bearing and heading across it, and that of the robot's place.

      iex> pose = Hal.Pose.new(1, 0)
      iex> picture = %Vision.Detections{at_ms: 0, blobs: [], pose: pose}
      iex> sure = %{spread: {0.0, 0.0, 0.0}, heading: 0.03}
      iex> percept = %Robot.Percept{robot: :mag1, at_ms: 0, profile: Hal.Profile.magellan(), pose: pose, detections: picture, uncertainty: sure}
      iex> mark = %Vision.Mark{family: :tag36h11, id: 1, at_ms: 0, x: 0.0, y: 0.0, corners: [], width: 2, height: 2, range: 2.0, bearing: 0.0, range_sd: 0.1, bearing_sd: 0.04}
      iex> {place, {xx, xy, yy}} = Robot.Localiser.MarkPlace.of(percept, mark)
      iex> {place, Float.round(xx, 4), xy, Float.round(yy, 4)}
      {{3.0, 0.0}, 0.01, 0.0, 0.01}
  """
  @spec of(Percept.t(), Mark.t()) :: t() | nil
  def of(%Percept{uncertainty: nil}, _mark), do: nil
  def of(_percept, %Mark{range: nil}), do: nil
  def of(%Percept{detections: %{pose: nil}}, _mark), do: nil

  def of(%Percept{detections: %{pose: pose}, uncertainty: uncertainty}, %Mark{} = mark) do
    direction = pose.heading + mark.bearing
    {c, s} = {:math.cos(direction), :math.sin(direction)}
    along = mark.range_sd * mark.range_sd
    turn = mark.bearing_sd * mark.bearing_sd + uncertainty.heading * uncertainty.heading
    across = mark.range * mark.range * turn
    {xx, xy, yy} = Anchors.covariance(uncertainty.spread)

    {{pose.x + mark.range * c, pose.y + mark.range * s},
     {xx + along * c * c + across * s * s, xy + (along - across) * c * s,
      yy + along * s * s + across * c * c}}
  end

  @doc """
  The one place of several sightings of a mark; `nil` for none, and if they contradict each other: one of the robots is wrong, or
  there are two marks.

  Robots that found their places by each other, or by one plan, have errors in common, of an unknown size. So the sightings are
  joined by covariance intersection (Julier and Uhlmann 1997), each weighed by the inverse of its trace (Niehsen 2002): whatever they
  have in common, the result is not too sure. Ten robots at one place know no more than one of them; two that look from different
  sides do.

      iex> Robot.Localiser.MarkPlace.fuse([{{1.0, 0.0}, {0.04, 0.0, 1.0}}, {{1.5, 0.25}, {1.0, 0.0, 0.04}}])
      ...> |> then(fn {{x, y}, {xx, _xy, yy}} -> for n <- [x, y, xx, yy], do: Float.round(n, 3) end)
      [1.019, 0.24, 0.077, 0.077]
      iex> Robot.Localiser.MarkPlace.fuse([{{1.0, 0.0}, {0.01, 0.0, 0.01}}, {{2.0, 0.0}, {0.01, 0.0, 0.01}}])
      nil
  """
  @spec fuse([t()]) :: t() | nil
  def fuse([]), do: nil

  def fuse(sightings) do
    if agree?(sightings), do: intersect(sightings)
  end

  defp agree?(sightings) do
    numbered = Enum.with_index(sightings)
    Enum.all?(for({a, i} <- numbered, {b, k} <- numbered, i < k, do: near?(a, b)))
  end

  # By the sum of both covariances.
  defp near?({{x1, y1}, {a1, b1, d1}}, {{x2, y2}, {a2, b2, d2}}) do
    {dx, dy} = {x2 - x1, y2 - y1}
    {xx, xy, yy} = inverse({a1 + a2, b1 + b2, d1 + d2})
    xx * dx * dx + 2 * xy * dx * dy + yy * dy * dy <= @gate * @gate
  end

  defp intersect(sightings) do
    weights = for {_at, {xx, _xy, yy}} <- sightings, do: 1 / (xx + yy)
    total = Enum.sum(weights)

    {information, {vx, vy}} =
      sightings
      |> Enum.zip(weights)
      |> Enum.reduce({{0.0, 0.0, 0.0}, {0.0, 0.0}}, fn {{{x, y}, covariance}, weight},
                                                       {{a, b, d}, {vx, vy}} ->
        {xx, xy, yy} = inverse(covariance)
        w = weight / total

        {{a + w * xx, b + w * xy, d + w * yy},
         {vx + w * (xx * x + xy * y), vy + w * (xy * x + yy * y)}}
      end)

    {xx, xy, yy} = covariance = inverse(information)
    {{xx * vx + xy * vy, xy * vx + yy * vy}, covariance}
  end

  defp inverse({xx, xy, yy}) do
    determinant = xx * yy - xy * xy
    {yy / determinant, -xy / determinant, xx / determinant}
  end
end
