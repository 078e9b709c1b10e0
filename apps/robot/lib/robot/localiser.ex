defmodule Robot.Localiser do
  @moduledoc """
  Where a robot is in the map frame: odometry from its start pose, corrected by what it sees of
  things whose places it was told. Pure; an extended Kalman filter over (x, y, heading).

  References are told by the mission (`anchors`): the landmark where the leader sees it, and the
  robots ahead in the formation where they say they are. Corrections run one way, from the leader
  down, so that no robot ever corrects itself by its own echo. A reference gives a bearing, the
  landmark a range too. Sightings of the same thing repeat the same errors, so each counts for
  much less than its noise would allow.

  Formulas: Siegwart and Nourbakhsh 2004 (odometry), the standard EKF with scalar updates in turn.
  """
  alias Hal.{Odometry, Pose}
  alias Robot.{Percept, Sighting}

  # Standard deviations of odometry: of the way driven, of the angle turned (skid steering slips by
  # 5 % and more, R74), of angle per metre.
  @way_share 0.01
  @turn_share 0.06
  @turn_per_metre 0.01
  @start_sd {0.03, 0.03, 0.02}
  # A single sighting: bearing in radians, range as a share and in metres.
  @bearing_sd 0.04
  @range_share 0.10
  @range_sd 0.15
  @gate 9.0
  # A robot that is seen must be the one that is expected: no other expected one within this angle.
  @match 0.12
  # After so many pictures in a row that contradict the estimate, it is the estimate that is doubted.
  @doubt 8
  @doubt_sd {0.3, 0.3, 0.3}
  @history 12

  @enforce_keys [:start]
  defstruct @enforce_keys ++
              [
                odometry: nil,
                pose: nil,
                covariance: nil,
                history: [],
                seen_ms: nil,
                anchors: [],
                refused: 0
              ]

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
  @type t :: %__MODULE__{start: Pose.t(), pose: Pose.t() | nil, anchors: [anchor()]}

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

  def update(localiser, %Percept{odometry: %Odometry{pose: odometry}} = percept) do
    localiser = localiser |> move(odometry) |> see(percept) |> remember(percept.at_ms)
    blobs_pose = percept.blobs_at_ms && pose_at(localiser, percept.blobs_at_ms)
    {%{percept | pose: localiser.pose, blobs_pose: blobs_pose}, localiser}
  end

  defp move(%{odometry: nil} = localiser, odometry) do
    {x, y, heading} = @start_sd

    %{
      localiser
      | odometry: odometry,
        pose: Pose.compose(localiser.start, odometry),
        covariance: {x * x, 0.0, 0.0, y * y, 0.0, heading * heading}
    }
  end

  # With d the way driven and h the heading half-way, F = [1 0 -d sin h; 0 1 d cos h; 0 0 1].
  defp move(localiser, odometry) do
    step = Pose.relative(localiser.odometry, odometry)
    way = :math.sqrt(step.x * step.x + step.y * step.y)
    pose = Pose.compose(localiser.pose, step)
    a = -(pose.y - localiser.pose.y)
    b = pose.x - localiser.pose.x
    {xx, xy, xh, yy, yh, hh} = localiser.covariance
    along = :math.pow(@way_share * way, 2)

    turned = :math.pow(@turn_share * abs(step.heading), 2) + :math.pow(@turn_per_metre * way, 2)

    covariance = {
      xx + 2 * a * xh + a * a * hh + along,
      xy + a * yh + b * xh + a * b * hh,
      xh + a * hh,
      yy + 2 * b * yh + b * b * hh + along,
      yh + b * hh,
      hh + turned
    }

    %{localiser | odometry: odometry, pose: pose, covariance: covariance}
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
        scalar(localiser, bearing_error, {dy / square, -dx / square, -1.0}, bearing_noise)

      range = anchor.range? && Sighting.distance(blob, percept.blobs)

      if range do
        range_noise = :math.pow(@range_share * distance + @range_sd, 2) + :math.pow(anchor.sd, 2)

        scalar(
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

  # One scalar measurement: K = P H' / S, x + K e, (1 - K H) P; beyond three sigma it is not believed.
  defp scalar(localiser, error, {a, b, c}, noise) do
    {xx, xy, xh, yy, yh, hh} = localiser.covariance
    px = xx * a + xy * b + xh * c
    py = xy * a + yy * b + yh * c
    ph = xh * a + yh * b + hh * c
    s = a * px + b * py + c * ph + noise

    if error * error > @gate * s do
      refuse(localiser)
    else
      {kx, ky, kh} = {px / s, py / s, ph / s}
      pose = localiser.pose

      %{
        localiser
        | pose: Pose.new(pose.x + kx * error, pose.y + ky * error, pose.heading + kh * error),
          covariance: {
            xx - kx * px,
            xy - kx * py,
            xh - kx * ph,
            yy - ky * py,
            yh - ky * ph,
            hh - kh * ph
          }
      }
    end
  end

  # Wheels that slip take the estimate farther than odometry admits; then it has to be found again.
  defp refuse(%{refused: refused} = localiser) when refused < @doubt,
    do: %{localiser | refused: refused + 1}

  defp refuse(localiser) do
    {xx, xy, xh, yy, yh, hh} = localiser.covariance
    {x, y, heading} = @doubt_sd
    covariance = {xx + x * x, xy, xh, yy + y * y, yh, hh + heading * heading}
    %{localiser | refused: 0, covariance: covariance}
  end

  defp remember(localiser, at_ms) do
    history =
      Enum.take([{at_ms, localiser.pose, localiser.odometry} | localiser.history], @history)

    %{localiser | history: history}
  end

  # The estimate at an earlier time: back along the odometry from the present estimate.
  defp pose_at(localiser, at_ms) do
    case Enum.find(localiser.history, fn {time, _pose, _odometry} -> time <= at_ms end) do
      {time, _pose, then} when time == at_ms or localiser.history == [] ->
        Pose.compose(localiser.pose, Pose.relative(localiser.odometry, then))

      {time, _pose, then} ->
        later = localiser.history |> Enum.take_while(fn {t, _, _} -> t > at_ms end) |> List.last()

        {next_ms, after_} =
          case later do
            nil -> {nil, localiser.odometry}
            {next_ms, _pose, after_} -> {next_ms, after_}
          end

        part = if next_ms, do: (at_ms - time) / (next_ms - time), else: 1.0
        step = Pose.relative(then, after_)
        between = Pose.compose(then, Pose.new(step.x * part, step.y * part, step.heading * part))
        Pose.compose(localiser.pose, Pose.relative(localiser.odometry, between))

      nil ->
        localiser.pose
    end
  end
end
