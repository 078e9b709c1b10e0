defmodule Robot.Departure do
  @moduledoc """
  Decides whether a robot whose processes, or whose node, start again on the way stands at its start pose. A drive that starts
  again counts from zero, so the odometry alone would say so: `Robot.Departure.Note` remembers in which odometry frame
  (`Hal.Odometry`) the robot has left it. Pure.
  """
  alias Hal.Pose

  # Farther from zero than this, in metres or radians, the robot has left its start pose: a fence of 50 m is wrong by a
  # metre then.
  @left 0.02
  @unknown "unknown"

  @typedoc "The odometry frame whose zero is the start pose, as text; another one's is not known."
  @type frame :: String.t()

  @doc """
  Whether this pose of the odometry has left the one at which it began to count.

      iex> Robot.Departure.left?(Hal.Pose.new(0.01, 0.0, 0.0))
      false
      iex> Robot.Departure.left?(Hal.Pose.new(0.0, 0.0, -0.1))
      true
  """
  @spec left?(Pose.t()) :: boolean()
  def left?(%Pose{heading: heading} = odometry),
    do: Pose.distance(odometry, {0.0, 0.0}) > @left or abs(heading) > @left

  @doc """
  A frame as text. References begin with the time at which their node started, so none comes twice. The zero of a
  driver that tells no frame is unknown.
  """
  @spec frame(reference() | nil) :: frame()
  def frame(nil), do: @unknown
  def frame(reference), do: inspect(reference)

  @doc """
  Whether the zero of this odometry is the start pose: the robot has not left it (`nil`), or has in this frame.

      iex> frame = make_ref()
      iex> noted = Robot.Departure.frame(frame)
      iex> {Robot.Departure.start?(nil, frame), Robot.Departure.start?(noted, frame)}
      {true, true}
      iex> {Robot.Departure.start?(noted, make_ref()), Robot.Departure.start?("unknown", nil)}
      {false, false}
  """
  @spec start?(frame() | nil, reference() | nil) :: boolean()
  def start?(nil, _frame), do: true
  def start?(_noted, nil), do: false
  def start?(noted, frame), do: noted == frame(frame)
end
