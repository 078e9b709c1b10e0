defmodule Robot.Localiser.Consistency do
  @moduledoc """
  Tests whether a whole picture is consistent with the estimated pose. Pure.

  A filter that has mistaken one robot for another is wrong and overconfident: from then on it
  uses the blobs that happen to match and ignores the others. But the picture shows the
  contradiction: robots where there can be none, or no robot where there must be one. The possible
  places of this robot and of the others follow from their standard deviations; a picture
  contradicts the estimate if enough columns do not fit within 2.5 of them.
  `Robot.Localiser.Belief.weigh/2` counts such pictures.
  """
  alias Hal.Pose
  alias Robot.Localiser.{Anchors, Belief, Columns}
  alias Robot.Percept

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
    camera = Columns.camera(percept)
    spans = Enum.map(robots, &spans(&1, belief, exposed, camera))

    cond do
      stranger?(seen, spans) or missing?(covered, spans) -> :contradicted
      Columns.empty?(seen) -> :unknown
      true -> :consistent
    end
  end

  defp stranger?(seen, spans) do
    possible = Enum.reduce(spans, 0, fn {may, _must}, set -> Columns.union(set, may) end)
    Columns.count(Columns.without(seen, possible)) >= @columns
  end

  defp missing?(covered, spans) do
    Enum.any?(spans, fn {_may, must} ->
      Columns.count(must) >= @columns and Columns.disjoint?(must, covered)
    end)
  end

  # The columns that a robot may fill, and those that it must fill.
  defp spans(mark, belief, exposed, camera) do
    distance = max(Pose.distance(exposed, mark.at), mark.radius)
    half = :math.asin(mark.radius / distance)
    bearing = Pose.bearing(exposed, mark.at)
    doubt = @sds * bearing_sd(belief, exposed, mark) + @border_sd
    core = half - doubt

    must =
      if core > 0.0 and distance < @in_sight, do: Columns.span(bearing, core, camera), else: 0

    {Columns.span(bearing, half + doubt, camera), must}
  end

  # The uncertainty of a direction is that of both places across the line between them.
  defp bearing_sd(belief, exposed, %{at: {x, y}} = mark) do
    {dx, dy} = {x - exposed.x, y - exposed.y}
    square = max(dx * dx + dy * dy, 0.09)
    variance = Belief.variance(belief, {dy / square, -dx / square, -1.0}, mark)
    :math.atan(:math.sqrt(variance))
  end
end
