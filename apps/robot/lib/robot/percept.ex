defmodule Robot.Percept do
  @moduledoc """
  All that a robot knows at one tick, frozen: behaviours and missions read nothing else.

  Whatever was older than its limit when the percept was taken is `nil` (or `[]` for bumpers):
  a behaviour never sees a stale reading. `detections: nil` means that there is no fresh
  picture, `detections.blobs: []` that the picture shows nothing. `pose` is the robot's estimate in the `map` frame.
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
                peers: %{},
                driving: nil
              ]

  @typedoc """
  What another robot told: its pose and speed in the `map` frame, when it was heard, and its
  body's radius (metres). `mode`: `:moving` avoids others too, `:holding` stands and gives no way,
  `:dead` is a body that stayed where it was last heard of. `beat` is all that it told last, and
  `direct_ms` when it was heard itself, not by way of another robot.
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
  How sure the pose is: within `radius` metres in 95 of 100 cases; `position` (along the worst direction, metres; `spread` says more) and
  `heading` (radians) are standard deviations. `frame` is the key of the frame that the pose is in (`Robot.Localiser.Anchors`): `nil`
  for that of the start poses, in which `start` are its variances (m2, rad2); `frame_no` is the number of the frame that it makes for
  others. `drift` is what odometry has added since the start: variances in m2 and rad2, and all angles turned; `slip` (a standard
  deviation) how well is known what slips in each of them.
  """
  @type uncertainty :: %{
          radius: float(),
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
  `detections` is what was found in the newest picture. `driving` is what the gate last let through, and why it limited it.
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
          peers: %{atom() => peer()},
          driving: %{twist: Twist.t(), limits: [atom()]} | nil
        }
end
