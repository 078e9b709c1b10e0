defmodule Hal.Odometry do
  @moduledoc "What the wheels say: the pose in the robot's own `odom` frame, and the present speed."

  @enforce_keys [:pose, :twist]
  defstruct @enforce_keys

  @type t :: %__MODULE__{pose: Hal.Pose.t(), twist: Hal.Twist.t()}
end
