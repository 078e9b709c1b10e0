defmodule Robot.Localiser.Consistency do
  @moduledoc """
  Tests whether a whole picture is consistent with the estimated pose. Pure.

  A filter that has mistaken one robot for another is wrong and overconfident: from then on it
  uses the blobs that happen to match and ignores the others. But the picture shows the
  contradiction: robots where there can be none, or no robot where there must be one. The possible
  places of this robot and of the others follow from their standard deviations; a picture
  contradicts the estimate if enough columns do not fit within 2.5 of them. Walls of a plan may hide a robot, or a part of it: one
  must be seen only if they do not from any of these places, and may be if they do not from one.
  `Robot.Localiser.Belief.weigh/2` counts such pictures.
  """
  alias Hal.Pose
  alias Robot.Localiser.{Anchors, Belief, Columns, Glance, InSight}
  alias Robot.Percept
  alias Robot.Percept.Sighting

  @sds 2.5
  # The standard deviation of a blob's border, in radians.
  @border_sd 0.01
  # The least number of columns (`Robot.Localiser.Columns`) that is a contradiction.
  @columns 3
  # A robot that is farther away than this (metres) may be hidden by a wall.
  @in_sight 3.0

  @type verdict :: :consistent | :contradicted | :unknown

  @doc """
  Compares the percept's picture with the belief; `back` is the pose at exposure, relative to the
  robot's present pose. `:unknown` if the picture shows no robot and need not show one, or if no
  robots are given.
  """
  @spec judge(Belief.t(), [Anchors.mark()], Percept.t(), back :: Pose.t()) :: verdict()
  def judge(_belief, [], _percept, _back), do: :unknown

  def judge(belief, robots, %Percept{} = percept, %Pose{} = back) do
    exposed = Pose.compose(belief.pose, back)

    colours = robots |> Enum.map(& &1.colour) |> Enum.uniq()
    {hiding, showing} = Enum.split_with(percept.detections.blobs, &(&1.colour not in colours))
    seen = Columns.seen(showing, colours)
    covered = Columns.union(seen, Columns.seen(hiding, Enum.map(hiding, & &1.colour)))
    view = Sighting.field_of_view(percept)
    glance = Glance.new(belief, exposed, percept.detections.pan, view)
    in_sight = InSight.new(percept.grid, belief, exposed, [@sds / 2, @sds])
    look = {belief, exposed, Columns.camera(percept), glance, in_sight}

    cond do
      contradicted?(robots, look, covered, seen) -> :contradicted
      Columns.empty?(seen) -> :unknown
      true -> :consistent
    end
  end

  # Strangers are the columns that none of the robots so far may fill. One that is far need not be looked at when they
  # are too few already.
  defp contradicted?([], _look, _covered, strangers), do: Columns.count(strangers) >= @columns

  defp contradicted?([mark | robots], {_, exposed, _, _, _} = look, covered, strangers) do
    distance = Pose.distance(exposed, mark.at)

    if distance >= @in_sight and Columns.count(strangers) < @columns do
      contradicted?(robots, look, covered, strangers)
    else
      {may, must} = spans(mark, distance, look)

      (Columns.count(must) >= @columns and Columns.disjoint?(must, covered)) or
        contradicted?(robots, look, covered, Columns.without(strangers, may))
    end
  end

  # The columns that a robot may fill, and those that it must fill.
  defp spans(mark, distance, {belief, exposed, camera, glance, in_sight}) do
    near = if distance > mark.radius, do: distance, else: mark.radius
    half = :math.asin(mark.radius / near)
    most = half + @sds * Glance.most_sd(glance, mark, distance) + @border_sd

    if Glance.aside(glance, mark.at) > most or not InSight.seen?(in_sight, mark) do
      {0, 0}
    else
      bearing = Pose.bearing(exposed, mark.at)
      doubt = @sds * bearing_sd(belief, exposed, mark) + @border_sd
      core = half - doubt
      must? = core > 0.0 and near < @in_sight and InSight.whole?(in_sight, mark)
      must = if must?, do: Columns.span(bearing, core, camera), else: 0
      {Columns.span(bearing, half + doubt, camera), must}
    end
  end

  # The uncertainty of a direction is that of both places across the line between them.
  defp bearing_sd(belief, exposed, %{at: {x, y}} = mark) do
    {dx, dy} = {x - exposed.x, y - exposed.y}
    square = max(dx * dx + dy * dy, 0.09)
    variance = Belief.variance(belief, {dy / square, -dx / square, -1.0}, mark)
    :math.atan(:math.sqrt(variance))
  end
end
