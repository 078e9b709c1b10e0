defmodule Robot.Localiser.Silhouettes do
  @moduledoc """
  Searches along the direction of a robot's greatest uncertainty for the place from which the
  silhouettes of all robots together fit its picture. Pure.

  A robot that joins another robot's frame may be off by a metre across its line of sight, and its
  heading with it. It may see the robots ahead as one wide blob, perhaps clipped by the picture's
  border, in which none can be identified (`Robot.Localiser.Matching`). So places along the
  direction of greatest uncertainty are tried: for each, the columns of the picture that robots
  would fill are computed, and the wrong ones are counted. A place is accepted if few columns are
  wrong and no place elsewhere is nearly as good. A robot that is unsure of its heading by half a radian is left where
  it is: along a line so long, one blob fits somewhere. By a floor plan, a robot that walls hide fills no columns.
  """
  alias Hal.Pose
  alias Robot.Localiser.{Anchors, Belief, Columns, Glance, InSight}
  alias Robot.Localiser.Silhouettes.{Native, Reference}
  alias Robot.Percept
  alias Robot.Percept.Sighting

  # With a standard deviation below this (metres) no search is needed.
  @sure 0.2
  # With a greater one of the heading (radians) its error is no longer in proportion to that of the place.
  @turned 0.5
  # The search covers this many standard deviations to each side, in steps of about this many
  # metres, but at most this many steps.
  @reach 2.5
  @step 0.05
  @steps 40
  # So many parts of the search to each side see the same robots past the walls of a plan.
  @parts 4
  # A wrong column adds this much to the cost, in squares of standard deviations. A place is a
  # rival of the best one if its cost is not greater by `@worse` and it is farther away than
  # `@same` metres. `@most` columns may be wrong, plus this share of those that are seen.
  @wrong 0.8
  @worse 4.0
  @same 0.25
  @most 3
  @share 0.15
  # As in `Robot.Localiser.Silhouettes.Reference`.
  @strange 0.5
  @wide 2.0
  @most_bodies 1024
  # The standard deviation of a place that was found (metres), without that of the nearest robot.
  @found_sd 0.15

  @doc """
  The belief moved to where the percept's picture fits; `back` is the pose at exposure, relative
  to the robot's present pose. The belief is unchanged if it is certain enough, if no place fits,
  or if several do.
  """
  @spec align(Belief.t(), [Anchors.mark()], Percept.t(), back :: Pose.t()) :: Belief.t()
  def align(belief, robots, %Percept{} = percept, %Pose{} = back) do
    {worst, _least, direction} = Belief.spread(belief)
    {_worst, _least, heading} = Belief.sd(belief)
    seen = Columns.seen(percept.detections.blobs, Enum.map(robots, & &1.colour))

    if worst > @sure and heading <= @turned and not Columns.empty?(seen),
      do: fit(belief, robots, percept, back, seen, {worst, direction}),
      else: belief
  end

  defp fit(belief, robots, percept, back, seen, {worst, direction}) do
    axis = {:math.cos(direction), :math.sin(direction)}
    turn = Belief.turn_along(belief, axis)
    count = min(ceil(@reach * worst / @step), @steps)
    camera = Columns.camera(percept)
    exposed = Pose.compose(belief.pose, back)
    view = Sighting.field_of_view(percept)
    glance = Glance.new(belief, exposed, percept.detections.pan, view)
    swing = abs(turn) * @reach * worst
    shift = @reach * worst + swing * Pose.distance(back, {0.0, 0.0})

    near =
      Enum.filter(robots, fn %{at: {x, y}, radius: radius, sd: {sd, _, _}} ->
        in_sight?({x, y, radius, sd}, glance, shift, swing)
      end)

    search = search(belief.pose, back, axis, turn, camera)

    tried =
      for ways <- ways(@reach * worst, count, percept.grid),
          bodies = bodies(near, percept.grid, exposed, axis, ways),
          fits = kernel(bodies).fits(search, seen, bodies, floats(ways)),
          {way, {wrong, clear}} <- Enum.zip(ways, fits),
          do: {way * way / (worst * worst) + @wrong * wrong, way, wrong, clear}

    {least, at, wrong, clear} = Enum.min(tried)

    rival? =
      Enum.any?(tried, fn {cost, way, _, _} -> abs(way - at) > @same and cost < least + @worse end)

    if rival? or clear == 0 or wrong > @most + @share * clear do
      belief
    else
      pose = moved(belief.pose, axis, turn, at)
      near = for {cost, way, _, _} <- tried, cost < least + 1.0, do: abs(way - at)
      {sd, common} = found(robots, pose, axis, max(@found_sd, Enum.max(near)))
      Belief.shifted(belief, axis, at, sd, common)
    end
  end

  # The places to try; with a plan in parts, from each of which the same robots count as in sight.
  defp ways(reach, count, grid) do
    ways = for k <- -count..count, do: k * reach / count
    if grid, do: Enum.chunk_by(ways, &round(&1 / reach * @parts)), else: [ways]
  end

  defp bodies(robots, grid, exposed, {x, y}, ways) do
    way = Enum.at(ways, div(length(ways), 2))
    place = {exposed.x + way * x, exposed.y + way * y}

    for %{at: {x, y}, radius: radius, sd: {sd, _, _}} <- InSight.from(robots, grid, place),
        into: <<>>,
        do: floats([x, y, radius, sd])
  end

  # Whether a robot may fill a column from any of the places, which are `shift` metres and `swing` radians away at most.
  defp in_sight?({x, y, radius, sd}, glance, shift, swing) do
    nearest = Pose.distance(glance.pose, {x, y}) - shift

    nearest < 2 * radius or
      (
        half = :math.asin(radius / nearest)
        wide = if sd > @strange, do: half + @wide * sd / nearest, else: half
        parallax = :math.asin(shift / (nearest + shift))
        Glance.aside(glance, {x, y}) < wide + parallax + swing
      )
  end

  defp moved(%Pose{} = pose, {x, y}, turn, way),
    do: Pose.new(pose.x + way * x, pose.y + way * y, pose.heading + way * turn)

  # The place found is as wrong as that of the nearest robot. The part of that error which all
  # robots share does not become less by another picture.
  defp found(robots, pose, {x, y}, found_sd) do
    %{sd: {sd, _least, _direction}, common: {cx, cy}} =
      Enum.min_by(robots, &Pose.distance(pose, &1.at))

    common = x * cx + y * cy
    {:math.sqrt(found_sd * found_sd + max(sd * sd - common * common, 0.0)), common}
  end

  defp search(pose, back, {x, y}, turn, {pan, focal}),
    do:
      floats([pose.x, pose.y, pose.heading, back.x, back.y, back.heading, x, y, turn, pan, focal])

  defp floats(numbers), do: for(number <- numbers, into: <<>>, do: <<number::float-native>>)

  # The kernel in C takes no more; no fleet is as large.
  defp kernel(bodies) do
    if Native.loaded?() and byte_size(bodies) <= @most_bodies * 32, do: Native, else: Reference
  end
end
