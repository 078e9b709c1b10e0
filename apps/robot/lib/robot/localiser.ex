defmodule Robot.Localiser do
  @moduledoc """
  Where a robot is in the map frame: odometry from its start pose, corrected by what it sees of
  things whose places it was told. Pure; the filter itself is `Robot.Localiser.Belief`.

  References are told by the mission (`anchors`): the landmark where the leader sees it, and the
  robots ahead in the formation where they say they are. Corrections run one way, from the leader
  down, so that no robot ever corrects itself by its own echo. A reference gives a bearing, the
  landmark a range too. Sightings of the same thing repeat the same errors, so each counts for
  much less than its noise would allow.

  Odometry that begins again in another frame (`Hal.Odometry`) moves the robot nowhere: it goes on from
  where it was believed to be. The few decimetres of its stop that nobody counted are doubted.
  """
  alias Hal.{Odometry, Pose}
  alias Robot.Localiser.Belief
  alias Robot.{Percept, Sighting}

  # A single sighting: bearing in radians, range as a share and in metres. Errors that the next picture has again
  # count as shared.
  @bearing_sd 0.015
  @bearing_bias 0.005
  @edge_bias 0.01
  @edge_bias_share 0.01
  @range_share 0.05
  @range_sd 0.05
  # A robot that is seen must be the one that is expected, within this angle.
  @match 0.12
  @fits 0.45
  @clear 0.22
  @widest 0.5
  @history 12

  @enforce_keys [:start]
  defstruct @enforce_keys ++
              [odometry: nil, frame: nil, belief: nil, history: [], seen_ms: nil, anchors: [], told: nil]

  @typedoc """
  Something of a colour at a place (map frame); `sd` is how well the place is known, in metres.
  With a `radius` only a blob as wide as that is taken for it; `range?`: its distance counts too.
  """
  @type anchor :: %{
          colour: String.t(),
          at: Pose.point(),
          sd: float(),
          range?: boolean(),
          radius: float() | nil
        }
  @type t :: %__MODULE__{
          start: Pose.t(),
          odometry: Pose.t() | nil,
          frame: reference() | nil,
          belief: Belief.t() | nil,
          history: [{at_ms :: integer(), odometry :: Pose.t()}],
          seen_ms: integer() | nil,
          anchors: [anchor()]
        }

  @doc "A robot that was switched on at `start`, where its odometry said zero."
  @spec new(Pose.t()) :: t()
  def new(%Pose{} = start), do: %__MODULE__{start: start}

  @doc "The references to use from now on."
  @spec anchors(t(), [anchor()]) :: t()
  def anchors(localiser, []), do: %{localiser | anchors: [], belief: localiser.belief && Belief.forget(localiser.belief)}
  def anchors(localiser, {frame, anchors}), do: %{tell(localiser, frame) | anchors: anchors}

  defp tell(%{belief: nil} = localiser, _frame), do: localiser
  defp tell(%{told: %{key: key} = told} = localiser, %{key: key} = frame) do
    p = max(frame.position_var - told.position_var, 0.0)
    h = max(frame.heading_var - told.heading_var, 0.0)
    reframe(localiser, frame, p, h)
  end
  defp tell(localiser, frame), do: reframe(localiser, frame, frame.position_var, frame.heading_var)

  defp reframe(localiser, frame, p, h) do
    %{localiser | told: frame, belief: Belief.reframe(localiser.belief, frame.at, p, h)}
  end

  @doc """
  Moves the estimate by the percept's odometry, corrects it by the percept's blobs, and fills in
  the percept's `pose` and `blobs_pose`. Without odometry there is no pose.
  """
  @spec update(t(), Percept.t()) :: {Percept.t(), t()}
  def update(localiser, %Percept{odometry: nil} = percept),
    do: {%{percept | pose: nil, blobs_pose: nil}, localiser}

  def update(localiser, %Percept{odometry: %Odometry{} = odometry} = percept) do
    localiser =
      localiser
      |> framed(odometry.frame)
      |> move(odometry.pose)
      |> see(percept)
      |> remember(percept.at_ms)

    blobs_pose = percept.blobs_at_ms && pose_at(localiser, percept.blobs_at_ms)
    {%{percept | pose: localiser.belief.pose, blobs_pose: blobs_pose, pose_sd: Belief.sd(localiser.belief), pose_frame: localiser.told && localiser.told.key}, localiser}
  end

  defp framed(%{frame: frame} = localiser, frame), do: localiser
  defp framed(%{belief: nil} = localiser, frame), do: %{localiser | frame: frame}

  # Poses of the frame before mean nothing any more.
  defp framed(localiser, frame),
    do: %{
      localiser
      | frame: frame,
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

  defp see(localiser, percept) do
    localiser = %{localiser | seen_ms: percept.blobs_at_ms}
    view = Sighting.field_of_view(percept)
    # The picture was taken a moment ago, and the body may have turned since.
    exposed = pose_at(localiser, percept.blobs_at_ms)

    {marks, robots} = Enum.split_with(localiser.anchors, & &1.range?)

    localiser =
      Enum.reduce(marks, localiser, fn anchor, localiser ->
        case mark(anchor, percept) do
          nil -> localiser
          blob -> correct(localiser, Map.put(anchor, :slack, 0.0), blob, exposed, percept, view)
        end
      end)

    # Turned right by the landmark, one knows better which robot is which.
    exposed = pose_at(localiser, percept.blobs_at_ms)

    Enum.reduce(pairs(robots, localiser, percept, exposed, view), localiser, fn {anchor, blob, slack, off}, localiser ->
      correct(localiser, Map.merge(anchor, %{slack: slack, width?: off < 0.15}), blob, pose_at(localiser, percept.blobs_at_ms), percept, view)
    end)
  end

  # There is one landmark: whatever has its colour is it.
  defp mark(anchor, percept) do
    percept.blobs
    |> Enum.filter(&(&1.colour == anchor.colour and not &1.clipped?))
    |> Enum.max_by(& &1.area, fn -> nil end)
  end

  # A blob counts where it can be one robot only, and that robot one blob only. What is half hidden looks narrower than it is.
  defp pairs(robots, localiser, percept, exposed, view) do
    candidates =
      for anchor <- robots,
          gate = gate(anchor, localiser, exposed),
          expected = Pose.bearing(exposed, anchor.at),
          distance = Pose.distance(exposed, anchor.at),
          blob <- percept.blobs,
          blob.colour == anchor.colour,
          bearing = Sighting.bearing(blob, percept.blobs_pan, view),
          ratio = Sighting.width_ratio(blob, anchor.radius, distance, view),
          ratio > 0.3 and ratio < 2.5,
          half = :math.asin(min(anchor.radius / max(distance, 0.01), 1.0)),
          slack = abs(ratio - 1) * half,
          abs(Pose.wrap(bearing - expected)) < gate + slack,
          do: {anchor, blob, abs(:math.log(ratio)), slack}

    for {anchor, blob, off, slack} <- candidates,
        anchor.sd != nil,
        blob.left > 0 and blob.right < blob.width - 1,
        off < @fits,
        rivals = Enum.filter(candidates, fn {a, b, _, _} -> (a == anchor) != (b == blob) end),
        Enum.all?(rivals, fn {_, _, other, _} -> other > off + @clear end),
        do: {anchor, blob, slack, off}
  end

  defp gate(anchor, localiser, exposed) do
    {ax, ay} = anchor.at
    dx = ax - exposed.x
    dy = ay - exposed.y
    square = max(dx * dx + dy * dy, 0.09)
    sd = anchor.sd || 0.3
    variance = Belief.variance(localiser.belief, {dy / square, -dx / square, -1.0}) + sd * sd / square + @bearing_sd * @bearing_sd
    (3 * :math.sqrt(variance)) |> max(@match) |> min(@widest)
  end

  defp correct(localiser, anchor, blob, exposed, percept, view) do
    dbg_(localiser, anchor, blob, percept, view, exposed)
    distance = Pose.distance(exposed, anchor.at)

    if distance < 0.3 do
      localiser
    else
      sd = sds(anchor, distance)
      localiser = bearing(localiser, anchor, sd, exposed, Sighting.bearing(blob, percept.blobs_pan, view))
      range = if anchor.range?, do: Sighting.distance(blob, percept.blobs), else: anchor.width? && Sighting.width_distance(blob, anchor.radius, view)
      if range, do: range(localiser, anchor, sd, pose_at(localiser, percept.blobs_at_ms), range), else: localiser
    end
  end

  defp sds(%{range?: true, sd: sd}, distance) do
    sd = sd + @bearing_bias * distance
    {sd, sd}
  end

  defp sds(%{sd: sd}, distance) do
    across = @edge_bias + @edge_bias_share * distance
    sd = :math.sqrt(sd * sd + across * across)
    {sd, sd}
  end

  defp bearing(localiser, anchor, sd, exposed, seen) do
    {belief, at} = Belief.meet(localiser.belief, anchor.key, anchor.at, sd)
    {dx, dy, square} = way(exposed, at)
    error = Pose.wrap(seen - Pose.bearing(exposed, at))
    %{localiser | belief: Belief.correct(belief, anchor.key, error, {dy / square, -dx / square, -1.0}, {0.0, 0.0}, @bearing_sd * @bearing_sd + 20 * anchor.slack * anchor.slack)}
  end

  defp range(localiser, anchor, sd, exposed, seen) do
    {belief, at} = Belief.meet(localiser.belief, anchor.key, anchor.at, sd)
    {dx, dy, square} = way(exposed, at)
    distance = :math.sqrt(square)
    noise = :math.pow(@range_share * distance + @range_sd, 2)
    {m, n} = belief.scales
    {scale, use} = if anchor.range?, do: {m, {distance, 0.0}}, else: {n, {0.0, distance}}
    %{localiser | belief: Belief.correct(belief, anchor.key, seen - distance * (1 + scale), {-dx / distance, -dy / distance, 0.0}, use, noise)}
  end

  defp way(exposed, {ax, ay}) do
    dx = ax - exposed.x
    dy = ay - exposed.y
    {dx, dy, max(dx * dx + dy * dy, 0.01)}
  end

  defp dbg_(localiser, anchor, blob, percept, view, exposed) do
    with f when is_function(f) <- Process.get(:dbg), do: f.(percept.robot, localiser, anchor, blob, Sighting.bearing(blob, percept.blobs_pan, view), percept, exposed)
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
