defmodule Robot.Localiser.Consistency do
  @moduledoc """
  Tests whether a whole picture is consistent with the estimated pose. Pure.

  A filter that took one robot for another is wrong and sure of itself: from then on it matches what happens to fit and has no
  use for the rest. But the rest is in the picture: robots where none can be, or none where one must be.
  Where both the robot and the others may be is a matter of their standard deviations; beyond 2.5 of them a picture
  contradicts the estimate. `Robot.Localiser.Belief.weigh/2` counts such pictures.
  """
  alias Hal.Pose
  alias Robot.Localiser.{Anchors, Belief, Columns}
  alias Robot.Percept

  @sds 2.5
  # What blobs' borders are off by, in radians.
  @border_sd 0.01
  # So many columns (of `Robot.Localiser.Columns`) contradict.
  @columns 3
  # A robot that is farther away may stand behind a wall, in metres.
  @in_sight 3.0

  @type verdict :: :consistent | :contradicted | :unknown

  @doc """
  What a percept's picture, taken `back` of where the robot is now, says of the belief: `:unknown` where it shows no robot and
  none must be seen.
  """
  @spec judge(Belief.t(), [Anchors.mark()], Percept.t(), back :: Pose.t()) :: verdict()
  def judge(_belief, [], _percept, _back), do: :unknown

  def judge(belief, robots, %Percept{} = percept, %Pose{} = back) do
    exposed = Pose.compose(belief.pose, back)

    {hiding, showing} =
      Enum.split_with(percept.detections.blobs, &(&1.colour not in colours(robots)))

    seen = Columns.seen(showing, colours(robots))
    covered = Columns.union(seen, Columns.seen(hiding, Enum.map(hiding, & &1.colour)))
    spans = Enum.map(robots, &spans(&1, belief, exposed, percept))

    cond do
      stranger?(seen, spans) or missing?(covered, spans) -> :contradicted
      Columns.empty?(seen) -> :unknown
      true -> :consistent
    end
  end

  defp colours(robots), do: robots |> Enum.map(& &1.colour) |> Enum.uniq()

  defp stranger?(seen, spans) do
    possible = Enum.reduce(spans, 0, fn {may, _must}, set -> Columns.union(set, may) end)
    Columns.count(Columns.without(seen, possible)) >= @columns
  end

  defp missing?(covered, spans) do
    Enum.any?(spans, fn {_may, must} ->
      Columns.count(must) >= @columns and Columns.disjoint?(must, covered)
    end)
  end

  # The columns that a robot may fill, and those that it must.
  defp spans(mark, belief, exposed, percept) do
    distance = max(Pose.distance(exposed, mark.at), mark.radius)
    half = :math.asin(mark.radius / distance)
    bearing = Pose.bearing(exposed, mark.at)
    doubt = @sds * bearing_sd(belief, exposed, mark) + @border_sd
    core = half - doubt

    must =
      if core > 0.0 and distance < @in_sight, do: Columns.span(bearing, core, percept), else: 0

    {Columns.span(bearing, half + doubt, percept), must}
  end

  # The direction of a thing is as unsure as the places of both, across the line between them.
  defp bearing_sd(belief, exposed, %{at: {x, y}} = mark) do
    {dx, dy} = {x - exposed.x, y - exposed.y}
    square = max(dx * dx + dy * dy, 0.09)
    variance = Belief.variance(belief, {dy / square, -dx / square, -1.0}, mark)
    :math.atan(:math.sqrt(variance))
  end
end
