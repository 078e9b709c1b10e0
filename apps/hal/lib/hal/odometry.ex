defmodule Hal.Odometry do
  @moduledoc """
  Holds what the wheels report: the pose in the robot's own `odom` frame, and the current speed.

  Poses belong together while `frame` is the same. A driver reports a new frame when it had to
  start again at zero, because its process crashed, and when the counters of its base jumped,
  because the controller was switched off and on: how far the robot moved between the two frames
  is unknown.
  """

  @enforce_keys [:pose, :twist]
  defstruct @enforce_keys ++ [frame: nil]

  @typedoc "`frame` is `nil` from a driver that never starts again."
  @type t :: %__MODULE__{pose: Hal.Pose.t(), twist: Hal.Twist.t(), frame: reference() | nil}
end
