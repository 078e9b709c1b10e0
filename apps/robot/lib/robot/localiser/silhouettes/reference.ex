defmodule Robot.Localiser.Silhouettes.Reference do
  @moduledoc """
  Computes how well a picture fits the silhouettes of robots, from places along a line: what `Robot.Localiser.Silhouettes` asks of its
  kernel, in Elixir. The kernel in C gives the same, because both call the C library's functions in the same order. Pure.
  """
  alias Hal.Pose
  alias Robot.Localiser.Columns

  # The place of a robot with a greater standard deviation (metres) counts as unknown: the robot
  # may fill any column within `@wide` standard deviations.
  @strange 0.5
  @wide 2.0
  # Half of the apparent width of a robot at this robot's own place (radians).
  @quarter :math.asin(1.0)

  @doc """
  For each way along the line (metres): how many columns are wrong, and how many of those that are seen may be judged, because no
  robot at an unknown place may fill them.

  `search` is eleven floats: the pose believed, the pose at exposure relative to it, the line's direction (x, y), how far the heading
  turns on a metre of it, the camera's direction (radians), and its focal length in columns. `seen` are the columns of the
  picture that show robots (`Robot.Localiser.Columns`). `bodies` has four floats for each robot, x, y, radius and the standard
  deviation of its place; `ways` one for each way. All floats have 64 bits and this machine's order of bytes.
  """
  @spec fits(binary(), Columns.t(), bodies :: binary(), ways :: binary()) ::
          [{wrong :: non_neg_integer(), clear :: non_neg_integer()}]
  def fits(search, seen, bodies, ways) do
    <<x::float-native, y::float-native, heading::float-native, bx::float-native, by::float-native,
      bh::float-native, rest::binary>> = search

    <<ax::float-native, ay::float-native, turn::float-native, pan::float-native,
      focal::float-native>> = rest

    back = %Pose{x: bx, y: by, heading: bh}

    bodies =
      for <<x::float-native, y::float-native, radius::float-native, sd::float-native <- bodies>>,
        do: {x, y, radius, sd}

    for <<way::float-native <- ways>> do
      moved = Pose.new(x + way * ax, y + way * ay, heading + way * turn)
      {known, unknown} = filled(bodies, Pose.compose(moved, back), {pan, focal})
      wrong = known |> Columns.difference(seen) |> Columns.without(unknown) |> Columns.count()
      {wrong, seen |> Columns.without(unknown) |> Columns.count()}
    end
  end

  # The columns that robots would fill, and those that a robot at an unknown place may fill.
  defp filled(bodies, %Pose{heading: heading} = from, {pan, _focal} = camera) do
    axis = {:math.cos(heading + pan), :math.sin(heading + pan)}

    Enum.reduce(bodies, {0, 0}, fn body, {known, unknown} ->
      case silhouette(body, from, axis) do
        nil -> {known, unknown}
        {:known, b, half} -> {Columns.union(known, Columns.span(b, half, camera)), unknown}
        {:unknown, b, half} -> {known, Columns.union(unknown, Columns.span(b, half, camera))}
      end
    end)
  end

  # A known robot that is not very near and behind the camera fills no column.
  defp silhouette({bx, by, radius, sd}, from, {ax, ay}) do
    {dx, dy} = {bx - from.x, by - from.y}
    square = dx * dx + dy * dy

    unless sd <= @strange and dx * ax + dy * ay < 0.0 and square > 16 * radius * radius do
      distance = :math.sqrt(square)
      half = if distance > radius, do: :math.asin(radius / distance), else: @quarter
      bearing = Pose.wrap(:math.atan2(dy, dx) - from.heading)

      if sd > @strange,
        do: {:unknown, bearing, half + @wide * sd / max(distance, 0.1)},
        else: {:known, bearing, half}
    end
  end
end
