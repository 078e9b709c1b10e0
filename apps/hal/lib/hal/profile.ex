defmodule Hal.Profile do
  @moduledoc """
  Describes the body of a kind of robot: geometry, sensors, limits. SI units; sensor poses are in `base_link`, whose origin is
  the middle between the wheels. Nothing is decided by its `name`, which is for people and for configurations.

  The two bodies of the thesis are here, because the driver of their base is; `Robot.File.Body` has all.
  Sources: the thesis and the public rFLEX sample configurations. The accelerations
  are our choice: 0.5 m/s2 and 1 rad/s2 for both bases, unless configured.

  A body is round, or a box of `length` by `width` whose middle is `offset` ahead of `base_link` (`round?/1`, `corners/1`).
  `radius` is that of the circle round all of it, about `base_link`: what it needs to turn on the spot.

  `sonar_round_s` is how long the sonars take until each has fired and was reported, in seconds: so old is a range at most
  while none is lost. It is 0 if all fire at once; a driver that knows better says so (`c:Hal.Drive.sonar_round_s/1`). With a
  lidar it is at least the time of a turn.

  `bumpers` are so many segments round the body, the first ahead, of which those within `bumper_span` about it exist.
  `scan` is a lidar: its pose, how many rays it has in a turn, how wide it sees (radians, in the middle of which is the heading
  of its pose), its least and greatest range (metres), and the time of a turn (s); `nil` for a body without one (`Hal.Scan`).
  `camera` is `nil` for a body without one. `about` is what people call it, `mass` is in kg; `nil` if that is not known.
  `rflex` says whose published wiring and conversions an rFLEX controller in it has, `nil` for none; `board` which other controller
  with a driver and an emulator of ours is in it, if any. `model` of a `scan` says the same of the lidar.
  """
  alias Hal.Pose

  # A Sony EVI-D30, and pictures of a quarter of its size.
  @camera %{
    width: 320,
    height: 240,
    field_of_view: :math.pi() / 3,
    mount_height: 0.6,
    max_pan: 1.745,
    max_tilt: 0.436,
    pan_rate: 1.396,
    tilt_rate: 0.873
  }

  # One turn of many small ones, round.
  @scan %{
    pose: %Pose{x: 0.0, y: 0.0, heading: 0.0},
    rays: 360,
    field_of_view: 2 * :math.pi(),
    min: 0.15,
    max: 12.0,
    period: 0.1,
    model: nil
  }

  @enforce_keys [:name, :radius, :length, :width, :wheel_base, :max_linear, :max_turn, :sonars]
  defstruct @enforce_keys ++
              [
                max_acceleration: 0.5,
                max_turn_acceleration: 1.0,
                height: 0.5,
                offset: 0.0,
                about: nil,
                mass: nil,
                rflex: nil,
                board: nil,
                sonar_min: 0.15,
                sonar_max: 5.1,
                sonar_cone: :math.pi() / 6,
                sonar_round_s: 0.0,
                scan: nil,
                irs: [],
                ir_max: 0.8,
                bumpers: 16,
                bumper_span: 2 * :math.pi(),
                camera: @camera
              ]

  @type board :: :kobuki | :create | :turtlebot3_burger | :turtlebot3_waffle | :arduino

  @type scan :: %{
          pose: Pose.t(),
          rays: pos_integer(),
          field_of_view: float(),
          min: float(),
          max: float(),
          period: float(),
          model: :lds01 | :lds02 | :rplidar | nil
        }

  @type t :: %__MODULE__{
          name: atom(),
          radius: float(),
          length: float(),
          width: float(),
          height: float(),
          offset: float(),
          about: String.t() | nil,
          mass: float() | nil,
          rflex: :magellan | :atrv_mini | nil,
          board: board() | nil,
          wheel_base: float(),
          max_linear: float(),
          max_turn: float(),
          max_acceleration: float(),
          max_turn_acceleration: float(),
          sonars: [Pose.t()],
          sonar_min: float(),
          sonar_max: float(),
          sonar_cone: float(),
          sonar_round_s: float(),
          scan: scan() | nil,
          irs: [Pose.t()],
          ir_max: float(),
          bumpers: 0..16,
          bumper_span: float(),
          camera: map() | nil
        }

  @doc """
  Magellan Pro: round, 0.40 m across, 16 sonars, 16 infrareds and 16 bumpers all round.

      iex> length(Hal.Profile.magellan().sonars)
      16
  """
  @spec magellan() :: t()
  def magellan do
    ring = for k <- 0..15, do: ring_pose(11 - k, 0.2)

    %__MODULE__{
      name: :magellan,
      about: "a Magellan Pro",
      mass: 20.0,
      rflex: :magellan,
      radius: 0.2,
      length: 0.4,
      width: 0.4,
      wheel_base: 0.36,
      max_linear: 0.5,
      max_turn: 1.0,
      sonars: ring,
      irs: ring
    }
  end

  @doc """
  ATRV mini: four driven wheels, 0.5 by 0.3 m; 16 sonars, dense in front and at the sides, two
  behind and none diagonally behind. `radius` is that of the circle around its corners.

      iex> Hal.Profile.atrv_mini().max_turn
      0.8
  """
  @spec atrv_mini() :: t()
  def atrv_mini do
    left = [
      {0.2, 0.1, 0.0},
      {0.18, 0.11, 0.314},
      {0.16, 0.13, 0.628},
      {0.14, 0.14, 0.942},
      {0.12, 0.15, 1.257},
      {0.1, 0.15, 1.571},
      {-0.2, 0.15, 1.571},
      {-0.2, 0.15, :math.pi()}
    ]

    %__MODULE__{
      name: :atrv_mini,
      about: "an ATRV mini",
      mass: 40.0,
      rflex: :atrv_mini,
      radius: 0.292,
      length: 0.5,
      width: 0.3,
      wheel_base: 0.3,
      max_linear: 0.5,
      max_turn: 0.8,
      sonars:
        Enum.map(left, fn {x, y, angle} -> Pose.new(x, y, angle) end) ++
          Enum.map(left, fn {x, y, angle} -> Pose.new(x, -y, -angle) end)
    }
  end

  @doc "The lidar of a body that says no more of it."
  @spec scan() :: scan()
  def scan, do: @scan

  @doc "The camera of a body that says no more of it."
  @spec camera() :: map()
  def camera, do: @camera

  @doc """
  Whether the body is round, so that it turns on the spot without reaching further; a square box has corners farther off.

      iex> Enum.map([Hal.Profile.magellan(), Hal.Profile.atrv_mini()], &Hal.Profile.round?/1)
      [true, false]
  """
  @spec round?(t()) :: boolean()
  def round?(%__MODULE__{length: length, width: width, radius: radius}),
    do: length == width and radius < 0.7 * length

  @doc """
  The corners of a box in `base_link` (metres), from the left front one to the left; none of a round body.

      iex> Hal.Profile.corners(Hal.Profile.atrv_mini())
      [{0.25, 0.15}, {-0.25, 0.15}, {-0.25, -0.15}, {0.25, -0.15}]
  """
  @spec corners(t()) :: [Pose.point()]
  def corners(%__MODULE__{length: length, width: width, offset: offset} = profile) do
    {front, back, side} = {offset + length / 2, offset - length / 2, width / 2}

    if round?(profile),
      do: [],
      else: [{front, side}, {back, side}, {back, -side}, {front, -side}]
  end

  # Index 11 points straight ahead, and indices grow clockwise (public sample configuration).
  defp ring_pose(steps, radius) do
    angle = steps * :math.pi() / 8
    Pose.new(radius * :math.cos(angle), radius * :math.sin(angle), angle)
  end
end
