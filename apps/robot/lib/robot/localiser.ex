defmodule Robot.Localiser do
  @moduledoc """
  Where a robot is, and how sure that is: odometry from its start pose, corrected by what it sees of things whose
  places it was told (`Robot.Localiser.Anchors`). Pure; the filter is `Robot.Localiser.Belief`, which
  blob is which thing decides `Robot.Localiser.Matching`.

  Corrections run one way, from the leader down, so that no robot ever corrects itself by its own echo. Things are
  seen in a direction and, where nothing hides a part of them, at a distance: the landmark by its size, a robot by its
  width.

  Odometry that begins again in another frame (`Hal.Odometry`) moves the robot nowhere: it goes on from
  where it was believed to be. The few decimetres of its stop that nobody counted are doubted.
  """
  alias Hal.{Odometry, Pose}
  alias Robot.Localiser.{Anchors, Belief, Matching}
  alias Robot.{Percept, Sighting}

  # A single sighting: bearing in radians, range as a share and in metres.
  @bearing_sd 0.015
  @range_share 0.05
  @range_sd 0.05
  # What is wrong with every sighting of a thing alike: so much of its place, in metres, and per metre of distance.
  @landmark_bias 0.005
  @robot_bias 0.01
  # Pictures of a second or two show the same slack, and the same size; so many count as one.
  @repeated 20
  # Too near for a camera that looks over it, in metres.
  @near 0.3
  @history 12

  @enforce_keys [:start]
  defstruct @enforce_keys ++
              [
                odometry: nil,
                odometry_frame: nil,
                belief: nil,
                history: [],
                seen_ms: nil,
                anchors: %Anchors{},
                frame: nil,
                joins: 0
              ]

  @typedoc """
  `frame` is the one that the belief is in: `nil` for that of the start poses. `joins` counts how often it came into
  another.
  """
  @type t :: %__MODULE__{
          start: Pose.t(),
          odometry: Pose.t() | nil,
          odometry_frame: reference() | nil,
          belief: Belief.t() | nil,
          history: [{at_ms :: integer(), odometry :: Pose.t()}],
          seen_ms: integer() | nil,
          anchors: Anchors.t(),
          frame: Anchors.frame() | nil,
          joins: non_neg_integer()
        }

  @doc "A robot that was switched on at `start`, where its odometry said zero."
  @spec new(Pose.t()) :: t()
  def new(%Pose{} = start), do: %__MODULE__{start: start}

  @doc """
  What to find the pose by from now on. In a frame that is new to it the robot is as much less sure as that
  frame's robot is unsure of its own pose, and then by what that robot becomes less sure.
  """
  @spec anchors(t(), Anchors.t()) :: t()
  def anchors(localiser, %Anchors{frame: frame, marks: marks} = anchors) do
    localiser = localiser |> join(frame) |> Map.put(:anchors, anchors)

    if marks == [] and localiser.belief != nil,
      do: %{localiser | belief: Belief.forget(localiser.belief)},
      else: localiser
  end

  # Where a leader is believed to be stays true when nobody leads any more.
  defp join(localiser, nil), do: localiser
  defp join(%{belief: nil} = localiser, _frame), do: localiser

  # Way back makes a position surer again, but nothing a heading by half: that is a robot that was started anew.
  defp join(%{frame: %{key: key} = known} = localiser, %{key: key} = frame)
       when 4 * frame.heading >= known.heading do
    position = max(frame.position - known.position, 0.0)
    heading = max(frame.heading - known.heading, 0.0)
    most = %{frame | position: known.position + position, heading: known.heading + heading}
    reframe(localiser, most, position, heading)
  end

  defp join(localiser, frame) do
    {position, heading} = between(localiser.frame, frame)
    localiser = reframe(localiser, frame, position, heading)
    %{localiser | joins: localiser.joins + 1}
  end

  # What nobody knows of one frame in another: one may have begun in the other, or both elsewhere.
  defp between(nil, frame), do: {frame.position, frame.heading}
  defp between(%{key: key}, %{base: key} = frame), do: {frame.position, frame.heading}
  defp between(%{base: key} = known, %{key: key}), do: {known.position, known.heading}

  defp between(known, frame),
    do: {known.position + frame.position, known.heading + frame.heading}

  defp reframe(localiser, frame, position, heading) do
    belief = Belief.reframe(localiser.belief, frame.at, position, heading)
    %{localiser | frame: frame, belief: belief}
  end

  @doc """
  Moves the estimate by the percept's odometry, corrects it by the percept's blobs, and fills in the percept's
  `pose`, `uncertainty` and `blobs_pose`. Without odometry there is no pose.
  """
  @spec update(t(), Percept.t()) :: {Percept.t(), t()}
  def update(localiser, %Percept{odometry: nil} = percept),
    do: {%{percept | pose: nil, uncertainty: nil, blobs_pose: nil}, localiser}

  def update(localiser, %Percept{odometry: %Odometry{} = odometry} = percept) do
    localiser =
      localiser
      |> framed(odometry.frame)
      |> move(odometry.pose)
      |> see(percept)
      |> remember(percept.at_ms)

    percept = %{
      percept
      | pose: localiser.belief.pose,
        uncertainty: uncertainty(localiser),
        blobs_pose: percept.blobs_at_ms && pose_at(localiser, percept.blobs_at_ms)
    }

    {percept, localiser}
  end

  defp uncertainty(%{belief: belief, frame: frame, joins: joins}) do
    {position, _across, heading} = Belief.sd(belief)

    %{
      radius: Belief.radius(belief),
      position: position,
      heading: heading,
      frame: frame && frame.key,
      joins: joins
    }
  end

  defp framed(%{odometry_frame: frame} = localiser, frame), do: localiser
  defp framed(%{belief: nil} = localiser, frame), do: %{localiser | odometry_frame: frame}

  # Poses of the frame before mean nothing any more.
  defp framed(localiser, frame),
    do: %{
      localiser
      | odometry_frame: frame,
        odometry: nil,
        history: [],
        belief: Belief.doubt(localiser.belief)
    }

  defp move(%{odometry: nil, belief: nil} = localiser, odometry) do
    belief = Belief.new(Pose.compose(localiser.start, odometry))
    %{localiser | odometry: odometry, belief: belief}
  end

  defp move(%{odometry: nil} = localiser, odometry), do: %{localiser | odometry: odometry}

  defp move(localiser, odometry) do
    step = Pose.relative(localiser.odometry, odometry)
    %{localiser | odometry: odometry, belief: Belief.move(localiser.belief, step)}
  end

  # Every picture counts once.
  defp see(localiser, %Percept{blobs: nil}), do: localiser
  defp see(%{seen_ms: at_ms} = localiser, %Percept{blobs_at_ms: at_ms}), do: localiser

  # Turned right by the landmark, it knows better which robot is which.
  defp see(localiser, percept) do
    {landmarks, robots} = Enum.split_with(localiser.anchors.marks, &(&1.kind == :landmark))

    %{localiser | seen_ms: percept.blobs_at_ms}
    |> see_landmarks(landmarks, percept)
    |> see_robots(robots, percept)
  end

  # There is one landmark: whatever has its colour is it.
  defp see_landmarks(localiser, landmarks, percept) do
    Enum.reduce(landmarks, localiser, fn mark, localiser ->
      whole = Enum.filter(percept.blobs, &(&1.colour == mark.colour and not &1.clipped?))

      case Enum.max_by(whole, & &1.area, fn -> nil end) do
        nil ->
          localiser

        blob ->
          correct(localiser, percept, mark, blob, 0.0, Sighting.distance(blob, percept.blobs))
      end
    end)
  end

  defp see_robots(localiser, robots, percept) do
    view = Sighting.field_of_view(percept)
    exposed = pose_at(localiser, percept.blobs_at_ms)

    robots
    |> Matching.pairs(percept.blobs, localiser.belief, exposed, percept.blobs_pan, view)
    |> Enum.reduce(localiser, fn %{mark: mark, blob: blob, slack: slack} = pair, localiser ->
      distance = if pair.whole?, do: Sighting.distance_by_width(blob, mark.radius, view)
      correct(localiser, percept, mark, blob, slack, distance)
    end)
  end

  defp correct(localiser, percept, mark, blob, slack, distance) do
    far = Pose.distance(pose_at(localiser, percept.blobs_at_ms), mark.at)
    bearing = Sighting.bearing(blob, percept.blobs_pan, Sighting.field_of_view(percept))

    cond do
      far < @near ->
        localiser

      distance == nil ->
        turn(localiser, percept, mark, far, bearing, slack)

      true ->
        localiser
        |> turn(percept, mark, far, bearing, slack)
        |> stretch(percept, mark, far, distance)
    end
  end

  # The picture was taken a moment ago, and the body may have turned since.
  defp turn(localiser, percept, mark, far, seen, slack) do
    {belief, exposed, {dx, dy, distance}} = meet(localiser, percept, mark, far)
    expected = Pose.wrap(:math.atan2(dy, dx) - exposed.heading)
    square = distance * distance
    slope = {{dy / square, -dx / square, -1.0}, {0.0, 0.0}}
    noise = @bearing_sd * @bearing_sd + @repeated * slack * slack
    error = Pose.wrap(seen - expected)
    %{localiser | belief: Belief.correct(belief, mark.key, error, slope, noise)}
  end

  defp stretch(localiser, percept, mark, far, seen) do
    {belief, _exposed, {dx, dy, distance}} = meet(localiser, percept, mark, far)

    {scale, scales} =
      case mark.kind do
        :landmark -> {elem(belief.scales, 0), {distance, 0.0}}
        :robot -> {elem(belief.scales, 1), {0.0, distance}}
      end

    slope = {{-dx / distance, -dy / distance, 0.0}, scales}
    noise = @repeated * :math.pow(@range_share * distance + @range_sd, 2)
    error = seen - distance * (1 + scale)
    %{localiser | belief: Belief.correct(belief, mark.key, error, slope, noise)}
  end

  # The way from where the picture was taken to where the thing is by now believed to be.
  defp meet(localiser, percept, mark, far) do
    exposed = pose_at(localiser, percept.blobs_at_ms)
    {belief, {x, y}} = Belief.meet(localiser.belief, mark.key, mark.at, place_sd(mark, far))
    {dx, dy} = {x - exposed.x, y - exposed.y}
    {belief, exposed, {dx, dy, max(:math.sqrt(dx * dx + dy * dy), 0.1)}}
  end

  defp place_sd(%{kind: :landmark, sd: sd}, far), do: sd + @landmark_bias * far

  defp place_sd(%{kind: :robot, sd: sd}, far) do
    bias = @robot_bias * (1 + far)
    :math.sqrt(sd * sd + bias * bias)
  end

  defp remember(localiser, at_ms) do
    history = Enum.take([{at_ms, localiser.odometry} | localiser.history], @history)

    %{localiser | history: history}
  end

  # The estimate at an earlier time: back along the odometry from the present estimate. Between two
  # ticks it is taken in proportion; before all that is remembered there is only the present one.
  defp pose_at(localiser, at_ms) do
    case Enum.split_while(localiser.history, fn {time_ms, _odometry} -> time_ms > at_ms end) do
      {_later, []} ->
        localiser.belief.pose

      {later, [{time_ms, then} | _]} ->
        step = Pose.relative(then, after_(later, localiser))
        part = part(later, time_ms, at_ms)
        between = Pose.new(step.x * part, step.y * part, step.heading * part)
        back = Pose.relative(localiser.odometry, Pose.compose(then, between))
        Pose.compose(localiser.belief.pose, back)
    end
  end

  defp after_([], localiser), do: localiser.odometry
  defp after_(later, _localiser), do: later |> List.last() |> elem(1)

  defp part(_later, at_ms, at_ms), do: 0.0
  defp part([], _time_ms, _at_ms), do: 1.0

  defp part(later, time_ms, at_ms) do
    {next_ms, _odometry} = List.last(later)
    (at_ms - time_ms) / (next_ms - time_ms)
  end
end
