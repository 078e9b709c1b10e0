defmodule Robot.Localiser.Sightings do
  @moduledoc """
  Derives corrections of a robot's belief from one picture, by the visible objects whose places it
  was told. Pure.

  Things are seen in a direction and, where nothing hides a part of them, at a distance: the landmark by its size, a
  robot by its width. The landmark comes first: turned right by it, a robot knows better which robot is which
  (`Robot.Localiser.Matching`). At last the whole picture is held against what came of that (`Robot.Localiser.Consistency`).
  """
  alias Hal.Pose
  alias Robot.Localiser.{Anchors, Belief, Consistency, Matching, Silhouettes}
  alias Robot.Percept
  alias Robot.Percept.Sighting

  # A single sighting: bearing in radians, range as a share and in metres.
  @bearing_sd 0.015
  @range_share 0.05
  @range_sd 0.05
  # What is wrong with every sighting of a thing alike: so much of its place, in metres, and per metre of distance.
  @landmark_bias 0.003
  @robot_bias 0.006
  # Pictures of a second or two show the same slack, and the same size; so many count as one.
  @repeated 6
  # Too near for a camera that looks over it, in metres.
  @near 0.3

  @doc "The belief after a percept's picture, which was taken `back` of where the robot is now, in its own frame."
  @spec correct(Belief.t(), [Anchors.mark()], Percept.t(), back :: Pose.t()) :: Belief.t()
  def correct(belief, marks, %Percept{} = percept, %Pose{} = back) do
    {landmarks, robots} = Enum.split_with(marks, &(&1.kind == :landmark))
    picture = {percept, back}

    belief
    |> see_landmarks(landmarks, picture)
    |> Silhouettes.align(robots, percept, back)
    |> see_robots(robots, picture)
    |> weigh(robots, picture)
  end

  defp weigh(belief, robots, {percept, back}),
    do: Belief.weigh(belief, Consistency.judge(belief, robots, percept, back))

  # There is one landmark: whatever has its colour is it.
  defp see_landmarks(belief, landmarks, {percept, _back} = picture) do
    Enum.reduce(landmarks, belief, fn mark, belief ->
      whole =
        Enum.filter(percept.detections.blobs, &(&1.colour == mark.colour and not &1.clipped?))

      case Enum.max_by(whole, & &1.area, fn -> nil end) do
        nil ->
          belief

        blob ->
          see(belief, picture, mark, blob, 0.0, Sighting.distance(blob, percept.detections.blobs))
      end
    end)
  end

  defp see_robots(belief, robots, {percept, back} = picture) do
    view = Sighting.field_of_view(percept)

    robots
    |> Matching.pairs(
      percept.detections.blobs,
      belief,
      exposed(belief, back),
      percept.detections.pan,
      view
    )
    |> Enum.reduce(belief, fn %{mark: mark, blob: blob, slack: slack} = pair, belief ->
      distance = if pair.whole?, do: Sighting.distance_by_width(blob, mark.radius, view)
      see(belief, picture, mark, blob, slack, distance)
    end)
  end

  defp see(belief, {percept, back} = picture, mark, blob, slack, distance) do
    far = Pose.distance(exposed(belief, back), mark.at)
    bearing = Sighting.bearing(blob, percept.detections.pan, Sighting.field_of_view(percept))

    cond do
      far < @near ->
        belief

      distance == nil ->
        turn(belief, picture, mark, far, bearing, slack)

      true ->
        belief
        |> turn(picture, mark, far, bearing, slack)
        |> stretch(picture, mark, far, distance)
    end
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

    {scale, scales} =
      case mark.kind do
        :landmark -> {elem(belief.scales, 0), {distance, 0.0}}
        :robot -> {elem(belief.scales, 1), {0.0, distance}}
      end

    slope = {{-dx / distance, -dy / distance, 0.0}, scales}
    {_along, across} = spread(belief, mark, {dx, dy, distance})
    bend = 0.75 * across * across / (distance * distance)
    noise = @repeated * :math.pow(@range_share * distance + @range_sd, 2) + bend
    Belief.correct(belief, mark.key, seen - distance * (1 + scale), slope, noise)
  end

  # The variances of where it is, towards the thing and across. What is measured of a thing is not a straight line over
  # where the robot may be: what it bends by there counts as noise (second-order filter, Bar-Shalom, Li and Kirubarajan 2001).
  defp spread(belief, mark, {dx, dy, distance}) do
    {x, y} = {dx / distance, dy / distance}
    {Belief.variance(belief, {x, y, 0.0}, mark), Belief.variance(belief, {-y, x, 0.0}, mark)}
  end

  # The way from where the picture was taken to where the thing is by now believed to be.
  defp meet(belief, {_percept, back}, mark, far) do
    exposed = exposed(belief, back)
    {belief, {x, y}} = Belief.meet(belief, mark.key, mark.at, place_sd(mark, far), mark.common)
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
