defmodule Robot.Localiser.Sightings do
  @moduledoc false
  # Corrects a robot's belief with one picture, by the visible objects whose places it was given.
  # Pure.
  #
  # Each object gives a direction and, if nothing seems to hide a part of it, a distance: the
  # landmark by its size, a robot by its width. The landmark comes first, because a corrected
  # heading helps to decide which robot is which (`Robot.Localiser.Matching`). Finally the whole
  # picture is compared with the result (`Robot.Localiser.Consistency`).
  alias Hal.Pose
  alias Robot.Localiser.{Anchors, Belief, Consistency, InSight, Matching, Silhouettes}
  alias Robot.Localiser.Belief.Marks
  alias Robot.Percept
  alias Robot.Percept.Sighting

  # Standard deviations of a single sighting: of the bearing in radians, of the range as a share
  # and in metres.
  @bearing_sd 0.015
  @range_share 0.05
  @range_sd 0.05
  # The error that all sightings of an object share, as a standard deviation of its place: of the
  # landmark per metre of distance, of a robot in metres plus the same per metre of distance.
  @landmark_bias 0.003
  @robot_bias 0.006
  # Consecutive pictures share the errors of slack and size, so this many of them count as one.
  @repeated 6
  # An object nearer than this (metres) is not used, because the camera may look over it.
  @near 0.3
  # Of the square of a distance: a variance of the position beside which a bearing is no line.
  @vague 0.25

  @doc """
  The belief corrected by the percept's picture; `back` is the pose at exposure, relative to the
  robot's present pose; `named` are the marks on robots that were read in it, by the names of these.
  """
  @spec correct(
          Belief.t(),
          [Anchors.mark()],
          Percept.t(),
          back :: Pose.t(),
          named :: %{atom() => Vision.Mark.t()}
        ) :: Belief.t()
  def correct(belief, marks, %Percept{} = percept, %Pose{} = back, named \\ %{}) do
    {landmarks, robots} = Enum.split_with(marks, &(&1.kind == :landmark))
    picture = {percept, back}

    belief
    |> see_landmarks(landmarks, picture)
    |> Silhouettes.align(robots, percept, back)
    |> see_robots(robots, picture, named)
    |> weigh(robots, picture)
  end

  defp weigh(belief, robots, {percept, back}),
    do: Belief.weigh(belief, Consistency.judge(belief, robots, percept, back))

  # There is only one landmark: the largest unclipped blob of its colour is taken for it. Its distance is by its area
  # alone, whose error the filter knows as that of a scale; one by its width would have another.
  # Where a wall hides a part of it, it is nearer than its area says, and its middle elsewhere.
  defp see_landmarks(belief, landmarks, {percept, back} = picture) do
    view = Sighting.field_of_view(percept)

    Enum.reduce(landmarks, belief, fn mark, belief ->
      case whole(percept, mark.colour) do
        nil ->
          belief

        %{blob: blob, bearing: bearing} ->
          if Sighting.narrow?(blob, mark.radius, view) do
            far = Pose.distance(exposed(belief, back), mark.at)
            see(belief, picture, mark, bearing, missing(blob, mark.radius, far, view), nil)
          else
            distance = Sighting.distance(blob, percept.detections.blobs)
            see(belief, picture, mark, bearing, 0.0, distance)
          end
      end
    end)
  end

  # Half of the width that a blob lacks, in radians.
  defp missing(blob, radius, far, view) do
    half = (blob.right - blob.left + 1) / blob.width * :math.tan(view / 2)
    max(:math.asin(min(radius / max(far, @near), 1.0)) - :math.atan(half), 0.0)
  end

  defp whole(%{detections: %{blobs: blobs} = picture} = percept, colour) do
    case Sighting.largest(percept, colour) do
      %{blob: %{clipped?: true}} ->
        whole = Enum.reject(blobs, & &1.clipped?)

        %{percept | detections: %{picture | blobs: whole}}
        |> Sighting.note()
        |> Sighting.largest(colour)

      object ->
        object
    end
  end

  defp see_robots(belief, [], _picture, _named), do: belief

  defp see_robots(belief, robots, {percept, back} = picture, named) do
    view = Sighting.field_of_view(percept)
    exposed = exposed(belief, back)
    pan = percept.detections.pan
    in_sight = InSight.new(percept.grid, belief, exposed)

    robots
    |> Matching.pairs(percept.detections.blobs, belief, exposed, pan, view, in_sight, named)
    |> Enum.reduce(belief, fn %{mark: mark, slack: slack} = pair, belief ->
      distance = if pair.whole?, do: Sighting.distance_by_width(pair.blob, mark.radius, view)
      see(belief, picture, mark, pair.bearing, slack, distance)
    end)
  end

  defp see(belief, {_percept, back} = picture, mark, bearing, slack, distance) do
    far = Pose.distance(exposed(belief, back), mark.at)

    cond do
      far < @near ->
        belief

      distance == nil ->
        turn(belief, picture, mark, far, bearing, slack)

      vague?(belief, picture, mark, far, {bearing, distance}) ->
        place(belief, picture, mark, far, {bearing, slack, distance})

      true ->
        belief
        |> turn(picture, mark, far, bearing, slack)
        |> stretch(picture, mark, far, distance)
    end
  end

  # Whether the position is known so badly, beside the distance that was seen, that the noise of a bent measurement would leave
  # nothing of it. What is unknown of a position only because the heading is does not count: it was found so before.
  defp vague?(belief, picture, mark, far, {bearing, seen}) do
    {belief, exposed, _way} = meet(belief, picture, mark, far)
    {ux, uy} = {:math.cos(exposed.heading + bearing), :math.sin(exposed.heading + bearing)}
    along = Belief.variance(belief, {ux, uy, 0.0}, mark)
    across = Belief.variance(belief, {-uy, ux, seen}, mark)
    max(along, across) > @vague * seen * seen
  end

  # A robot stands at this distance from the object, in a direction that it knows as well as its heading. So the place of the
  # object is a linear function of the position; of the heading it is an arc, whose deviation from a line counts as noise.
  defp place(belief, picture, mark, far, {bearing, slack, seen}) do
    {belief, exposed, {dx, dy, _distance}} = meet(belief, picture, mark, far)
    {ux, uy} = {:math.cos(exposed.heading + bearing), :math.sin(exposed.heading + bearing)}
    {scale, scales} = scale(belief, mark, -seen)
    seen = seen / (1 + scale)
    {along, across} = arc(Belief.variance(belief, {0.0, 0.0, 1.0}), seen)
    noise = @repeated * :math.pow(@range_share * seen + @range_sd, 2) + along
    error = ux * dx + uy * dy - seen
    belief = Belief.correct(belief, mark.key, error, {{ux, uy, 0.0}, scales}, noise)

    {belief, now, {dx, dy, _distance}} = meet(belief, picture, mark, far)
    noise = seen * seen * (@bearing_sd * @bearing_sd + @repeated * slack * slack) + across
    error = ux * dy - uy * dx - seen * Pose.wrap(now.heading - exposed.heading)
    Belief.correct(belief, mark.key, error, {{-uy, ux, seen}, {0.0, 0.0}}, noise)
  end

  @doc """
  The mean squares, along and across, by which a vector of this length (metres) that is turned by a normal angle of this variance
  (rad2) is off the tangent: E (1 - cos a)^2 and E (sin a - a)^2, with E cos a = exp(-v / 2) and E a sin a = v exp(-v / 2).
  """
  @spec arc(variance :: float(), length :: float()) :: {along :: float(), across :: float()}
  def arc(variance, length) do
    square = length * length
    mean = :math.exp(-variance / 2)
    fourth = :math.pow(mean, 4)

    {square * max(1 - 2 * mean + (1 + fourth) / 2, 0.0),
     square * max((1 - fourth) / 2 - 2 * variance * mean + variance, 0.0)}
  end

  defp turn(belief, picture, mark, far, seen, slack) do
    {belief, exposed, {dx, dy, distance}} = meet(belief, picture, mark, far)
    expected = Pose.wrap(:math.atan2(dy, dx) - exposed.heading)
    square = distance * distance
    slope = {{dy / square, -dx / square, -1.0}, {0.0, 0.0}}
    {along, across} = spread(belief, mark, {dx, dy, distance})
    bend = 2 * along * across / (square * square)
    noise = @bearing_sd * @bearing_sd + @repeated * slack * slack + bend
    Belief.correct(belief, mark.key, Pose.wrap(seen - expected), slope, noise)
  end

  defp stretch(belief, picture, mark, far, seen) do
    {belief, _exposed, {dx, dy, distance}} = meet(belief, picture, mark, far)

    {scale, scales} = scale(belief, mark, distance)
    slope = {{-dx / distance, -dy / distance, 0.0}, scales}
    {_along, across} = spread(belief, mark, {dx, dy, distance})
    range = @repeated * :math.pow(@range_share * distance + @range_sd, 2)
    noise = range + bend(across, distance)
    Belief.correct(belief, mark.key, seen - distance * (1 + scale), slope, noise)
  end

  defp bend(across, distance), do: 0.75 * across * across / (distance * distance)

  defp scale(belief, %{kind: :landmark}, slope), do: {elem(belief.scales, 0), {slope, 0.0}}
  defp scale(belief, %{kind: :robot}, slope), do: {elem(belief.scales, 1), {0.0, slope}}

  # The variances of the position relative to the object, along the line to it and across. A
  # measurement is not a linear function of the position; its second-order term counts as noise
  # (second-order filter, Bar-Shalom, Li and Kirubarajan 2001).
  defp spread(belief, mark, {dx, dy, distance}) do
    {x, y} = {dx / distance, dy / distance}
    {Belief.variance(belief, {x, y, 0.0}, mark), Belief.variance(belief, {-y, x, 0.0}, mark)}
  end

  # The vector from the place at which the picture was taken to the estimated place of the object.
  defp meet(belief, {_percept, back}, mark, far) do
    exposed = exposed(belief, back)
    {belief, {x, y}} = Marks.meet(belief, mark.key, mark.at, place_sd(mark, far), mark.common)
    {dx, dy} = {x - exposed.x, y - exposed.y}
    {belief, exposed, {dx, dy, max(:math.sqrt(dx * dx + dy * dy), 0.1)}}
  end

  defp exposed(belief, back), do: Pose.compose(belief.pose, back)

  defp place_sd(%{kind: :landmark, sd: sd}, far), do: wider(sd, @landmark_bias * far)
  defp place_sd(%{kind: :robot, sd: sd}, far), do: wider(sd, @robot_bias * (1 + far))

  defp wider({worst, least, direction}, bias),
    do: {root(worst * worst + bias * bias), root(least * least + bias * bias), direction}

  defp root(square), do: :math.sqrt(square)
end
