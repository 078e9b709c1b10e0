defmodule Robot.Localiser.Silhouettes do
  @moduledoc """
  Where along the line on which it is least sure of itself a robot sees what it sees: all robots at once. Pure.

  Who comes into another's frame may be off by a metre across its line of sight, and turned with it. Seen from there,
  the robots ahead of it are one wide blob, perhaps cut by the picture's border, and none of them can be told
  (`Robot.Localiser.Matching`). So places along that line are tried one after another. From each, it is computed
  which columns of the picture robots would fill, and counted where that is not so. A place where little is wrong, and than which
  no other is nearly as good, is taken.
  """
  import Bitwise
  alias Hal.Pose
  alias Robot.Localiser.{Anchors, Belief}
  alias Robot.{Percept, Sighting}

  # Surer than this there is nothing to try; metres.
  @sure 0.25
  # So many standard deviations to either side, in steps of metres, but no more than so many.
  @reach 2.5
  @step 0.05
  @steps 40
  # The picture in so many columns: a set of them is a small integer.
  @columns 59
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
  # Farther aside of where the camera looks nothing is in a picture, in radians.
  @aside 1.3

  @doc """
  The belief moved to where the percept's picture fits, which was taken `back` of where the robot is now; the same belief where
  it is sure enough, or where nothing fits, or several places do.
  """
  @spec align(Belief.t(), [Anchors.mark()], Percept.t(), back :: Pose.t()) :: Belief.t()
  def align(belief, robots, %Percept{} = percept, %Pose{} = back) do
    {worst, _least, direction} = Belief.spread(belief)
    seen = seen(robots, percept)

    if worst > @sure and seen != 0,
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
        wrong = ones(bxor(filled, seen) &&& bnot(unknown), 0)

        {way * way / (worst * worst) + @wrong * wrong, way, wrong,
         ones(seen &&& bnot(unknown), 0)}
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

  # The columns that blobs of the robots' colours fill.
  defp seen(robots, percept) do
    colours = robots |> Enum.map(& &1.colour) |> Enum.uniq()

    for blob <- percept.blobs, blob.colour in colours, reduce: 0 do
      set -> set ||| columns(blob.left, blob.right, blob.width)
    end
  end

  # The columns that robots would fill, and those that one may fill of which nobody knows where it is.
  defp filled(robots, pose, percept) do
    view = Sighting.field_of_view(percept)

    Enum.reduce(robots, {0, 0}, fn %{sd: {sd, _, _}} = mark, {known, unknown} ->
      distance = Pose.distance(pose, mark.at)
      half = :math.asin(mark.radius / max(distance, mark.radius))
      bearing = Pose.wrap(Pose.bearing(pose, mark.at) - percept.blobs_pan)

      if sd > @strange,
        do: {known, unknown ||| span(bearing, half + @wide * sd / max(distance, 0.1), view)},
        else: {known ||| span(bearing, half, view), unknown}
    end)
  end

  # Left is where bearings are greater.
  defp span(bearing, half, _view) when abs(bearing) - half > @aside, do: 0

  defp span(bearing, half, view) do
    focal = @columns / 2 / :math.tan(view / 2)
    left = @columns / 2 - focal * :math.tan(min(bearing + half, @aside))
    right = @columns / 2 - focal * :math.tan(max(bearing - half, -@aside))
    between(round(left), round(right) - 1)
  end

  defp columns(left, right, width),
    do: between(round(left * @columns / width), round((right + 1) * @columns / width) - 1)

  defp between(left, right) do
    {left, right} = {max(left, 0), min(right, @columns - 1)}
    if right < left, do: 0, else: (1 <<< (right + 1)) - (1 <<< left)
  end

  defp ones(0, count), do: count
  defp ones(set, count), do: ones(set &&& set - 1, count + 1)
end
