defmodule Robot.Percept do
  @moduledoc """
  Holds everything that a robot perceives and estimates at one tick. Behaviours and missions read nothing else.

  A reading that was older than its limit when the percept was taken is `nil` (`[]` for bumpers),
  so that no behaviour uses stale readings (`Robot.Percept.Snapshot`); `peers` have no such limit.
  `detections: nil` means that there is no fresh picture, `detections.blobs: []` that nothing was
  detected in it. `pose` is the robot's estimate of its pose in the `map` frame.
  """
  alias Hal.{Odometry, Pose, Profile, Twist}

  @enforce_keys [:robot, :at_ms, :profile]
  defstruct @enforce_keys ++
              [
                pose: nil,
                uncertainty: nil,
                odometry: nil,
                sonar: nil,
                ir: nil,
                bumpers: [],
                power: nil,
                ptz: nil,
                detections: nil,
                objects: nil,
                peers: %{},
                driving: nil,
                grid: nil,
                ways: nil
              ]

  @typedoc """
  What another robot reported: its pose and speed in the `map` frame, when it was heard, and the
  radius of its body (metres). `mode` is `:moving` for a robot that avoids others too, `:holding`
  for one that stands and does not give way, and `:dead` for one that is assumed to stand where it
  was last heard. `beat` is its last heartbeat, and `direct_ms` the time at which it was last
  heard directly, not through another robot.
  """
  @type peer :: %{
          required(:pose) => Pose.t(),
          required(:twist) => Twist.t(),
          required(:radius) => float(),
          required(:at_ms) => integer(),
          required(:mode) => :moving | :holding | :dead,
          optional(:direct_ms) => integer() | nil,
          optional(:beat) => struct()
        }

  @typedoc """
  The uncertainty of the pose. By the filter's estimate, the error is within `radius` metres in 95
  of 100 cases. It is `lost?` if it was started again on its way, or finds by its floor plan that it is elsewhere, and has not found its place since; `place` is what the
  plan says (`Robot.Localiser.MonteCarlo.told/1`), `nil` for nothing.
  `position` (along the direction of greatest uncertainty, metres; see also
  `spread`) and `heading` (radians) are standard deviations. `frame` is the key of the frame of
  the pose (`Robot.Localiser.Anchors`), `nil` for the frame of the start poses; `start` are the
  pose's variances (m2, rad2) in the frame of the start poses. `frame_no` is the number of the
  frame that the robot's own poses define for others. `drift` is what dead reckoning has added
  since the start: variances of way and turn (m2, rad2), and the sum of all angles turned
  (radians); `slip` is the standard deviation of the wheel slip per radian turned.
  """
  @type uncertainty :: %{
          radius: float(),
          lost?: boolean(),
          place: :tracking | {:ambiguous | :lost, String.t()} | nil,
          position: float(),
          spread: Robot.Localiser.Anchors.spread(),
          heading: float(),
          frame: term(),
          frame_no: non_neg_integer(),
          start: {position :: float(), heading :: float()},
          drift: {way :: float(), turn :: float(), turned :: float()},
          slip: float()
        }

  @typedoc """
  `detections` are the blobs of the newest picture, `objects` the largest of each colour (`Robot.Percept.Sighting`), `nil`
  before the robot has looked. `driving` is the speed that the gate last let
  through, and the limits that it applied. `grid` is what the robot knows of
  walls, by a floor plan or by its sonars (`Nav.OccupancyGrid`), `nil` for nothing; `ways` is the floor plan
  with what its sonars have seen besides (`Nav.KnownWalls`), `nil` if that is nothing.
  """
  @type t :: %__MODULE__{
          robot: atom(),
          at_ms: integer(),
          profile: Profile.t(),
          pose: Pose.t() | nil,
          uncertainty: uncertainty() | nil,
          odometry: Odometry.t() | nil,
          sonar: [float()] | nil,
          ir: [float()] | nil,
          bumpers: [0..15],
          power: float() | nil,
          ptz: %{pan: float(), tilt: float(), field_of_view: float()} | nil,
          detections: Vision.Detections.t() | nil,
          objects: Robot.Percept.Sighting.objects() | nil,
          peers: %{atom() => peer()},
          driving: %{twist: Twist.t(), limits: [atom()]} | nil,
          grid: Nav.Grid.t() | nil,
          ways: Nav.Grid.t() | nil
        }

  @doc """
  Why the robot does not know where it is on its floor plan, for people; `nil` of one that knows, or has no plan that it could
  trust. What it is then in place for, or done with, it must not say.

      iex> percept = %Robot.Percept{robot: :mag1, at_ms: 0, profile: Hal.Profile.magellan()}
      iex> for place <- [:tracking, {:lost, "lost: nothing of what it hears fits the plan"}],
      ...>   do: Robot.Percept.astray(%{percept | uncertainty: %{place: place}})
      [nil, "lost: nothing of what it hears fits the plan"]
      iex> Robot.Percept.astray(percept)
      nil
  """
  @spec astray(t()) :: String.t() | nil
  def astray(%{uncertainty: %{place: {_state, reason}}}), do: reason
  def astray(_percept), do: nil
end
