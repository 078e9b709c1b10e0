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

  # A single sighting: bearing in radians, range as a share and in metres.
  @bearing_sd 0.04
  @range_share 0.10
  @range_sd 0.15
  # A robot that is seen must be the one that is expected: no other expected one within this angle.
  @match 0.12
  @history 12

  @enforce_keys [:start]
  defstruct @enforce_keys ++
              [odometry: nil, frame: nil, belief: nil, history: [], seen_ms: nil, anchors: []]

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
  def anchors(localiser, anchors), do: %{localiser | anchors: anchors}

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
    {%{percept | pose: localiser.belief.pose, blobs_pose: blobs_pose}, localiser}
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

    Enum.reduce(localiser.anchors, localiser, fn anchor, localiser ->
      case match(anchor, localiser.anchors, percept, exposed, view) do
        nil -> localiser
        blob -> correct(localiser, anchor, blob, exposed, percept, view)
      end
    end)
  end

  defp match(anchor, anchors, percept, exposed, view) do
    expected = Pose.bearing(exposed, anchor.at)

    alone? =
      Enum.all?(anchors, fn other ->
        other == anchor or other.colour != anchor.colour or
          abs(Pose.wrap(Pose.bearing(exposed, other.at) - expected)) > 2 * @match
      end)

    near =
      Enum.filter(percept.blobs, fn blob ->
        bearing = Sighting.bearing(blob, percept.blobs_pan, view)

        blob.colour == anchor.colour and not blob.clipped? and
          abs(Pose.wrap(bearing - expected)) < gate(anchor) and
          fits?(blob, anchor, Pose.distance(exposed, anchor.at), view)
      end)

    if alone?, do: Enum.max_by(near, & &1.area, fn -> nil end)
  end

  defp fits?(_blob, %{radius: nil}, _distance, _view), do: true

  defp fits?(blob, anchor, distance, view),
    do: Sighting.fits?(blob, anchor.radius, distance, view)

  # There is one landmark: whatever has its colour is it.
  defp gate(%{range?: true}), do: 2 * :math.pi()
  defp gate(_robot), do: @match

  defp correct(localiser, anchor, blob, exposed, percept, view) do
    {ax, ay} = anchor.at
    dx = ax - exposed.x
    dy = ay - exposed.y
    square = dx * dx + dy * dy
    distance = :math.sqrt(square)

    if distance < 0.3 do
      localiser
    else
      bearing_error =
        Pose.wrap(
          Sighting.bearing(blob, percept.blobs_pan, view) - Pose.bearing(exposed, anchor.at)
        )

      bearing_noise = :math.pow(@bearing_sd, 2) + :math.pow(anchor.sd / distance, 2)

      localiser =
        measure(localiser, bearing_error, {dy / square, -dx / square, -1.0}, bearing_noise)

      range = anchor.range? && Sighting.distance(blob, percept.blobs)

      if range do
        range_noise = :math.pow(@range_share * distance + @range_sd, 2) + :math.pow(anchor.sd, 2)

        measure(
          localiser,
          range - distance,
          {-dx / distance, -dy / distance, 0.0},
          range_noise
        )
      else
        localiser
      end
    end
  end

  defp measure(localiser, error, slope, noise),
    do: %{localiser | belief: Belief.correct(localiser.belief, error, slope, noise)}

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
