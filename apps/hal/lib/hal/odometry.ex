defmodule Hal.Odometry do
  @moduledoc """
  What the wheels report: the pose in the robot's own `odom` frame, and the current speed.

  Poses belong together as long as `frame` is the same. A driver that had to begin again at zero,
  because its process crashed, reports another frame; so does one whose base's counters jumped,
  because its controller was switched off and on: how far the robot moved between the two frames
  is unknown.
  """

  @enforce_keys [:pose, :twist]
  defstruct @enforce_keys ++ [frame: nil]

  @typedoc "`frame`: `nil` of a driver that never begins again."
  @type t :: %__MODULE__{pose: Hal.Pose.t(), twist: Hal.Twist.t(), frame: reference() | nil}
end
