defmodule Robot.Behaviour.Avoid.Ahead do
  @moduledoc "Finds robots on the path that do not travel along it. Pure; metres, map frame."
  alias Hal.Pose
  alias Robot.Behaviour.Avoid.Neighbours
  alias Robot.Percept

  # Bodies so near to a way (metres) are on it.
  @beside 0.1
  # A robot that travels along the path has at least this share of its speed in the path's direction, or against it.
  @along 0.3

  @doc """
  Whether another robot is on the first `ahead` metres of the way of this one, a line of points, and stands there or drives
  against its direction.

      iex> percept = %Robot.Percept{robot: :mag1, at_ms: 0, profile: Hal.Profile.magellan()}
      iex> other = %{at: {3.0, 0.3}, velocity: {-0.4, 0.1}, radius: 0.2, standing?: false}
      iex> line = [{0.0, 0.0}, {2.0, 0.0}, {6.0, 0.0}]
      iex> oncoming? = &Robot.Behaviour.Avoid.Ahead.oncoming?(&1, line, &2, percept)
      iex> {oncoming?.(other, 5.0), oncoming?.(other, 2.0), oncoming?.(%{other | velocity: {0.4, 0.0}}, 5.0)}
      {true, false, false}
      iex> {oncoming?.(%{other | at: {3.0, 0.6}}, 5.0), oncoming?.(%{other | standing?: true, velocity: {0.0, 0.0}}, 5.0)}
      {false, true}
  """
  @spec oncoming?(Neighbours.t(), [Pose.point(), ...], ahead :: float(), Percept.t()) :: boolean()
  def oncoming?(%{velocity: {vx, vy}} = other, line, ahead, percept) do
    {distance, {ux, uy}} = nearest(line, other.at, ahead)
    speed = :math.sqrt(vx * vx + vy * vy)

    distance < percept.profile.radius + other.radius + @beside and
      (other.standing? or vx * ux + vy * uy < -1 * @along * speed)
  end

  # How near the first metres of a line come to a point, and the line's direction there.
  defp nearest(line, at, ahead) do
    {nearest, _left} =
      Enum.zip_reduce(line, tl(line), {{1.0e9, {0.0, 0.0}}, ahead}, fn a, b, {nearest, left} ->
        length = Pose.distance(a, b)

        if left <= 0.0 or length < 1.0e-6,
          do: {nearest, left},
          else: {min(nearest, near(a, b, length, min(left, length), at)), left - length}
      end)

    nearest
  end

  defp near({ax, ay}, {bx, by}, length, end_m, {x, y}) do
    {ux, uy} = {(bx - ax) / length, (by - ay) / length}
    along = ((x - ax) * ux + (y - ay) * uy) |> max(0.0) |> min(end_m)
    {Pose.distance({ax + along * ux, ay + along * uy}, {x, y}), {ux, uy}}
  end
end
