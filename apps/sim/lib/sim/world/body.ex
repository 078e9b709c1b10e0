defmodule Sim.World.Body do
  @moduledoc false
  # Models one robot's body in the world: wheels, odometry, pan-tilt unit, bumpers. Pure.
  #
  # The wheels follow the wanted speed with the profile's accelerations and a first-order lag of
  # 0.1 s; poses are integrated with the mean heading of a step. A body that is stopped by a wall
  # or another body stalls its wheels: they do not slip.
  #
  # Odometry has errors according to `noise`: `:default` draws for each robot a scale error and a
  # turn error of 0.3 %, of either sign, and adds 1e-6 m2 of variance per metre to each wheel;
  # `:slip` adds the behaviour of skid-steered bases: a turn to the left goes 5.5 % further
  # than the wheels say, a turn to the right 5.5 % less far, and each turn has a random error of 1.7
  # % more (1.5 degrees in 90).
  #
  # In addition a body may have wheels that differ from what its odometry assumes, whatever the
  # noise: `wheels` with `distance` (true metres per counted metre), `base` (true wheel base
  # relative to the profile's) and `ratio` (true distance of the right wheel relative to the left
  # one's when odometry counts the same); each 1.0 unless given. Calibration finds these.
  alias Hal.{Odometry, Pose, Profile, Twist}
  alias Sim.{Noise, Trig}

  @lag_s 0.1
  @still 1.0e-4
  @latch_ms 200
  # An infrared's beam is a few degrees wide.
  @ir_cone :math.pi() / 45

  @wheels %{distance: 1.0, base: 1.0, ratio: 1.0}

  @enforce_keys [:id, :index, :profile, :pose, :odometry, :gains, :geometry]
  defstruct @enforce_keys ++
              [
                alive: true,
                wheels: @wheels,
                wanted: %Twist{linear: 0.0, turn: 0.0},
                ramp: {0.0, 0.0},
                speed: {0.0, 0.0},
                measured: %Twist{linear: 0.0, turn: 0.0},
                turn: {0, 0},
                look: {0.0, 0.0},
                pan: 0.0,
                tilt: 0.0,
                field_of_view: nil,
                sonar: [],
                lidar: <<>>,
                scan: nil,
                scan_ms: nil,
                infrared: <<>>,
                ir: [],
                pressed: %{}
              ]

  @type noise :: :off | :default | :slip
  @type t :: %__MODULE__{
          id: atom(),
          index: non_neg_integer(),
          profile: Profile.t(),
          pose: Pose.t(),
          odometry: Pose.t(),
          gains: {float(), float()},
          geometry: binary(),
          alive: boolean(),
          wheels: %{distance: float(), base: float(), ratio: float()},
          wanted: Twist.t(),
          ramp: {float(), float()},
          speed: {float(), float()},
          measured: Twist.t(),
          turn: {-1 | 0 | 1, non_neg_integer()},
          look: {float(), float()},
          pan: float(),
          tilt: float(),
          field_of_view: float() | nil,
          sonar: [float()],
          lidar: binary(),
          scan: Hal.Scan.t() | nil,
          scan_ms: integer() | nil,
          infrared: binary(),
          ir: [float()],
          pressed: %{(0..15) => integer()}
        }

  @doc "A body at rest; with `infrared: true` it has infrared sensors, too."
  @spec new(map(), non_neg_integer(), integer(), noise()) :: t()
  def new(
        %{id: id, profile: %Profile{} = profile, pose: %Pose{} = pose} = robot,
        index,
        seed,
        noise
      ) do
    %__MODULE__{
      id: id,
      index: index,
      profile: profile,
      pose: pose,
      odometry: Map.get(robot, :odometry, Pose.new(0, 0)),
      gains: gains(seed, index, noise),
      wheels: Map.merge(@wheels, Map.new(Map.get(robot, :wheels, []))),
      field_of_view: profile.camera && profile.camera.field_of_view * 1.0,
      geometry: geometry(profile.sonars, profile.sonar_cone),
      lidar: rays(profile.scan),
      infrared: if(robot[:infrared], do: geometry(profile.irs, @ir_cone), else: <<>>)
    }
  end

  defp gains(_seed, _index, :off), do: {1.0, 1.0}

  defp gains(seed, index, _noise) do
    [scale, turn] =
      for use <- [0, 1], do: 1.0 + 0.003 * Noise.sign(Noise.hash(seed, 0x6A15, index, use))

    {scale, turn}
  end

  # Each sensor has its place and five directions across its cone.
  defp geometry(poses, cone) do
    for %Pose{x: x, y: y, heading: heading} <- poses, into: <<>> do
      rays =
        for k <- -2..2, into: <<>> do
          {c, s} = Trig.cos_sin(heading + k * cone / 4)
          <<c::float-native, s::float-native>>
        end

      <<x::float-native, y::float-native, rays::binary>>
    end
  end

  # A lidar has its place and the direction of each ray.
  defp rays(nil), do: <<>>

  defp rays(%{pose: %Pose{x: x, y: y, heading: heading}, rays: count} = scan) do
    {start, step} = turn(scan)

    rays =
      for k <- 0..(count - 1), into: <<>> do
        {c, s} = Trig.cos_sin(heading + start + k * step)
        <<c::float-native, s::float-native>>
      end

    <<x::float-native, y::float-native, rays::binary>>
  end

  # The rays of a lidar divide what it sees, from the right.
  defp turn(%{rays: count, field_of_view: field_of_view}) do
    step = field_of_view / count
    {(step - field_of_view) / 2, step}
  end

  @doc "Whether the body has a lidar whose turn ends now."
  @spec scans?(t(), integer()) :: boolean()
  def scans?(%__MODULE__{lidar: <<>>}, _at_ms), do: false
  def scans?(%__MODULE__{scan_ms: nil}, _at_ms), do: true

  def scans?(%__MODULE__{scan_ms: scan_ms, profile: %{scan: scan}}, at_ms),
    do: at_ms - scan_ms >= scan.period * 1000

  @doc "Its lidar, as `Sim.Compute.scan/4` takes it."
  @spec lidar(t()) :: Sim.Compute.lidar()
  def lidar(%__MODULE__{pose: pose, profile: %{scan: scan}} = body) do
    {c, s} = Trig.cos_sin(pose.heading)
    {body.index, pose.x, pose.y, c, s, scan.min * 1.0, scan.max * 1.0, body.lidar}
  end

  @doc "The body whose lidar has measured these ranges."
  @spec scanned(t(), binary(), integer()) :: t()
  def scanned(%__MODULE__{profile: %{scan: scan}} = body, ranges, at_ms) do
    {start, step} = turn(scan)
    %{body | scan: %Hal.Scan{start: start, step: step, ranges: ranges}, scan_ms: at_ms}
  end

  @doc "The speed for the next `dt_ms`, before anything stops the body."
  @spec accelerate(t(), pos_integer()) :: t()
  def accelerate(%__MODULE__{profile: profile, wanted: wanted} = body, dt_ms) do
    s = dt_ms / 1000
    {ramp_v, ramp_w} = body.ramp
    {v, w} = body.speed

    ramp_v =
      towards(ramp_v, limit(wanted.linear, profile.max_linear), profile.max_acceleration * s)

    ramp_w =
      towards(ramp_w, limit(wanted.turn, profile.max_turn), profile.max_turn_acceleration * s)

    follow = s / (s + @lag_s)
    v = v + (ramp_v - v) * follow
    w = w + (ramp_w - w) * follow
    %{body | ramp: {ramp_v, ramp_w}, speed: {rest(v, ramp_v), rest(w, ramp_w)}}
  end

  @doc """
  The motion of the body in `dt_ms` if nothing stops it: the displacement of its centre
  `{dx, dy}`, the distance along its heading and the true turn.
  """
  @spec intend(t(), pos_integer(), integer(), noise()) ::
          {t(), {float(), float()}, way :: float(), turn :: float()}
  def intend(%__MODULE__{speed: {v, w}} = body, dt_ms, seed, noise) do
    s = dt_ms / 1000
    body = count_turns(body, w)
    turn = w * s * slip(body, w, seed, noise)
    {c, sine} = Trig.cos_sin(body.pose.heading + turn / 2)
    {body, {v * s * c, v * s * sine}, v * s, turn}
  end

  defp count_turns(body, w) when w == 0.0, do: body

  defp count_turns(%__MODULE__{turn: {side, count}} = body, w) do
    now = if w > 0.0, do: 1, else: -1
    if now == side, do: body, else: %{body | turn: {now, count + 1}}
  end

  defp slip(%__MODULE__{turn: {side, count}, index: index}, w, seed, :slip) when w != 0.0,
    do: 1.0 + 0.055 * side + 1.5 / 90 * Noise.gauss(Noise.hash(seed, 0x5119, index, count))

  defp slip(_body, _w, _seed, _noise), do: 1.0

  @doc """
  The body after it moved by `share` (0 to 1) of its displacement to `place`. Its odometry
  measures the wheels.
  """
  @spec arrive(
          t(),
          Pose.point(),
          float(),
          {float(), float()},
          pos_integer(),
          {integer(), integer()},
          noise()
        ) :: t()
  def arrive(%__MODULE__{} = body, {x, y}, share, {way, turn}, dt_ms, key, noise) do
    {v, w} = body.speed
    s = dt_ms / 1000
    {way_o, turn_o} = measure(body, way * share, w * s, key, noise)
    {c, sine} = Trig.cos_sin(body.odometry.heading + turn_o / 2)

    %{
      body
      | pose: Pose.new(x, y, body.pose.heading + turn),
        odometry:
          Pose.new(
            body.odometry.x + way_o * c,
            body.odometry.y + way_o * sine,
            body.odometry.heading + turn_o
          ),
        measured: %Twist{linear: way_o / s, turn: turn_o / s},
        speed: if(share < 1.0, do: {0.0, w}, else: {v, w}),
        ramp: if(share < 1.0, do: {0.0, elem(body.ramp, 1)}, else: body.ramp)
    }
  end

  defp measure(%{wheels: @wheels}, way, turn, _key, :off), do: {way, turn}

  # Each wheel moves its true distance; odometry counts that divided by the wheel's factor, and
  # assumes the wheel base that it knows. The factors of unequal wheels have the mean 1.
  defp measure(body, way, turn, key, noise) do
    %{distance: distance, base: wider, ratio: ratio} = body.wheels
    base = body.profile.wheel_base * wider
    {scale, turn_gain} = body.gains

    [left, right] =
      for {wheel, use} <- [{way - turn * base / 2, 0}, {way + turn * base / 2, 1}],
          do: wheel + shake(body, wheel, key, use, noise)

    left = left / (distance * 2 / (ratio + 1))
    right = right / (distance * 2 * ratio / (ratio + 1))
    {(left + right) / 2 * scale, (right - left) / body.profile.wheel_base * turn_gain}
  end

  defp shake(_body, _wheel, _key, _use, :off), do: 0.0

  defp shake(body, wheel, {seed, step}, use, _noise) do
    draw = Noise.gauss(Noise.hash(seed, step, body.index, 0x0D0 + use))
    :math.sqrt(1.0e-6 * abs(wheel)) * draw
  end

  @doc "Turns the camera for `dt_ms`, as fast as the unit can."
  @spec slew(t(), pos_integer()) :: t()
  def slew(%__MODULE__{profile: %Profile{camera: nil}} = body, _dt_ms), do: body

  def slew(%__MODULE__{profile: %Profile{camera: camera}, look: {pan, tilt}} = body, dt_ms) do
    s = dt_ms / 1000

    %{
      body
      | pan: towards(body.pan, limit(pan, camera.max_pan), camera.pan_rate * s),
        tilt: towards(body.tilt, limit(tilt, camera.max_tilt), camera.tilt_rate * s)
    }
  end

  @doc """
  Presses the bumpers towards these points of contact; a segment stays pressed for 200 ms. A point
  at the border of two segments presses both.
  """
  @spec press(t(), [Pose.point()], integer()) :: t()
  def press(%__MODULE__{pressed: pressed} = body, [], _at_ms) when pressed == %{}, do: body

  def press(%__MODULE__{profile: %Profile{bumpers: 0}} = body, _points, _at_ms), do: body

  def press(%__MODULE__{profile: %Profile{bumpers: count} = profile} = body, points, at_ms) do
    # Cosine of half a segment; the segments that the body has.
    {half, _sine} = Trig.cos_sin(:math.pi() / count)
    segments = Enum.filter(0..(count - 1), &segment?(&1, profile))
    held = for {k, until} <- body.pressed, until > at_ms, into: %{}, do: {k, until}

    now =
      for {x, y} <- points,
          {dx, dy} = {x - body.pose.x, y - body.pose.y},
          distance = :math.sqrt(dx * dx + dy * dy),
          distance > 0.0,
          k <- segments,
          {c, s} = Trig.cos_sin(body.pose.heading + 2 * k * :math.pi() / count),
          dx * c + dy * s >= (half - 1.0e-9) * distance,
          into: held,
          do: {k, at_ms + @latch_ms}

    %{body | pressed: now}
  end

  defp segment?(k, %Profile{bumpers: count, bumper_span: span}),
    do: abs(Pose.wrap(2 * k * :math.pi() / count)) <= span / 2 + 1.0e-9

  @doc """
  What the robot's devices report now; a body without sonars, or without a camera, reports none of them, and a lidar reports
  only at the end of a turn.
  """
  @spec readings(t(), integer()) :: [
          Hal.Drive.reading() | Hal.Ptz.reading() | Hal.Lidar.reading()
        ]
  def readings(%__MODULE__{} = body, at_ms) do
    all = [
      {:odometry, %Odometry{pose: body.odometry, twist: body.measured}},
      {:sonar, body.sonar},
      {:bumpers, body.pressed |> Map.keys() |> Enum.sort()},
      # Two lead-acid batteries that last for three hours.
      {:power, max(22.0, 25.6 - at_ms * 3.0e-7)},
      {:ptz, %{pan: body.pan, tilt: body.tilt, field_of_view: body.field_of_view}},
      {:ir, body.ir}
    ]

    all = Enum.filter(all, fn {sense, _reading} -> has?(body, sense) end)
    if body.scan != nil and body.scan_ms == at_ms, do: all ++ [{:scan, body.scan}], else: all
  end

  defp has?(%{geometry: geometry}, :sonar), do: geometry != <<>>
  defp has?(%{field_of_view: angle}, :ptz), do: angle != nil
  defp has?(%{ir: ranges}, :ir), do: ranges != []
  defp has?(_body, _sense), do: true

  defp towards(from, to, most) when to > from + most, do: from + most
  defp towards(from, to, most) when to < from - most, do: from - most
  defp towards(_from, to, _most), do: to * 1.0

  defp limit(value, most), do: value |> max(-most) |> min(most)

  # The lag never quite ends: below a tenth of a millimetre a second the wheels stand.
  defp rest(speed, target) when target == 0.0 and abs(speed) < @still, do: 0.0
  defp rest(speed, _target), do: speed
end
