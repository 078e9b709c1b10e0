defmodule Robot.Localiser.Silhouettes do
  @moduledoc """
  Searches along a robot's line of greatest uncertainty for the place where the silhouettes of all
  robots together fit its picture. Pure.

  Who comes into another's frame may be off by a metre across its line of sight, and turned with it. Seen from there,
  the robots ahead of it are one wide blob, perhaps cut by the picture's border, and none of them can be told
  (`Robot.Localiser.Matching`). So places along that line are tried one after another. From each, it is computed
  which columns of the picture robots would fill, and counted where that is not so. A place where little is wrong, and than which
  no other is nearly as good, is taken.
  """
  alias Hal.Pose
  alias Robot.Localiser.{Anchors, Belief, Columns}
  alias Robot.Percept

  # Surer than this there is nothing to try; metres.
  @sure 0.25
  # So many standard deviations to either side, in steps of metres, but no more than so many.
  @reach 2.5
  @step 0.05
  @steps 40
  # A wrong column counts so much, in squares of standard deviations; a place so much worse is none, one as near is
  # the same (metres); and so many columns may be wrong, and so many more of those that are seen.
  @wrong 0.8
  @worse 4.0
  @same 0.25
  @most 3
  @share 0.15
  # Beyond this nobody knows where a robot is, and it may fill any column within so many standard deviations; metres.
  @strange 0.5
  @wide 2.0
  # How well a place is known by that, in metres, but for what is known of the nearest robot.
  @found_sd 0.15

  @doc """
  The belief moved to where the percept's picture fits, which was taken `back` of where the robot is now; the same belief where
  it is sure enough, or where nothing fits, or several places do.
  """
  @spec align(Belief.t(), [Anchors.mark()], Percept.t(), back :: Pose.t()) :: Belief.t()
  def align(belief, robots, %Percept{} = percept, %Pose{} = back) do
    {worst, _least, direction} = Belief.spread(belief)
    seen = Columns.seen(percept.detections.blobs, Enum.map(robots, & &1.colour))

    if worst > @sure and not Columns.empty?(seen),
      do: fit(belief, robots, percept, back, seen, {worst, direction}),
      else: belief
  end

  defp fit(belief, robots, percept, back, seen, {worst, direction}) do
    axis = {:math.cos(direction), :math.sin(direction)}
    turn = Belief.turn_along(belief, axis)
    count = min(ceil(@reach * worst / @step), @steps)

    tried =
      for k <- -count..count do
        way = k * @reach * worst / count
        pose = belief.pose |> moved(axis, turn, way) |> Pose.compose(back)
        {filled, unknown} = filled(robots, pose, percept)
        wrong = filled |> Columns.difference(seen) |> Columns.without(unknown) |> Columns.count()
        clear = seen |> Columns.without(unknown) |> Columns.count()
        {way * way / (worst * worst) + @wrong * wrong, way, wrong, clear}
      end

    {least, at, wrong, clear} = Enum.min(tried)

    rival? =
      Enum.any?(tried, fn {cost, way, _, _} -> abs(way - at) > @same and cost < least + @worse end)

    if rival? or clear == 0 or wrong > @most + @share * clear do
      belief
    else
      pose = moved(belief.pose, axis, turn, at)
      Belief.shifted(belief, axis, at, found_sd(robots, pose))
    end
  end

  defp moved(%Pose{} = pose, {x, y}, turn, way),
    do: Pose.new(pose.x + way * x, pose.y + way * y, pose.heading + way * turn)

  defp found_sd(robots, pose) do
    %{sd: {sd, _least, _direction}} = Enum.min_by(robots, &Pose.distance(pose, &1.at))
    :math.sqrt(@found_sd * @found_sd + sd * sd)
  end

  # The columns that robots would fill, and those that one may fill of which nobody knows where it is.
  defp filled(robots, pose, percept) do
    Enum.reduce(robots, {0, 0}, fn %{sd: {sd, _, _}} = mark, {known, unknown} ->
      distance = Pose.distance(pose, mark.at)
      half = :math.asin(mark.radius / max(distance, mark.radius))
      bearing = Pose.bearing(pose, mark.at)

      if sd > @strange do
        wide = half + @wide * sd / max(distance, 0.1)
        {known, Columns.union(unknown, Columns.span(bearing, wide, percept))}
      else
        {Columns.union(known, Columns.span(bearing, half, percept)), unknown}
      end
    end)
  end
end
