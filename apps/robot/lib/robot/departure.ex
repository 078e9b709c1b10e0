defmodule Robot.Departure do
  @moduledoc """
  Remembers in a file that a robot has left its start pose, for its processes, or its node, that start again on the
  way. A drive that starts again counts from zero, so the odometry alone would say that the robot stands at its start
  pose.

  The file holds the boot of the machine and the odometry frame (`Hal.Odometry`) whose zero is the start pose. A file
  of an earlier boot does not count: whoever boots the machine puts the robot at its start pose. So does who starts the
  robot by hand, and who stops its service (`Swarm.Host.DepartureFile`): then the file is deleted.

  What cannot be read counts as left.
  """
  alias Hal.Pose

  # Farther from zero than this, in metres or radians, the robot has left its start pose: a fence of 50 m is wrong by a
  # metre then.
  @left 0.02
  @boot_id "/proc/sys/kernel/random/boot_id"
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
  A frame as text. References begin with the time at which their node started, so none comes twice; of a driver that
  tells no frame nobody knows where its zero is.
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

  @doc "The frame that was noted since the machine was booted; `nil` if the robot has not left its start pose."
  @spec noted(Path.t() | nil) :: frame() | nil
  def noted(nil), do: nil

  def noted(path) do
    case File.read(path) do
      {:ok, text} -> whole(String.split(text, "\n"), boot())
      {:error, :enoent} -> nil
      {:error, _reason} -> @unknown
    end
  end

  defp whole([boot, frame, ""], boot), do: frame
  defp whole([before, _frame, ""], boot) when @unknown not in [before, boot], do: nil
  defp whole(_half, _boot), do: @unknown

  @doc "Notes that the robot has left the start pose."
  @spec note(Path.t(), frame()) :: :ok | {:error, File.posix()}
  def note(path, frame) do
    aside = path <> ".new"
    with :ok <- File.write(aside, "#{boot()}\n#{frame}\n"), do: File.rename(aside, path)
  end

  @doc "Deletes the note."
  @spec forget(Path.t()) :: :ok | {:error, File.posix()}
  def forget(path), do: with({:error, :enoent} <- File.rm(path), do: :ok)

  defp boot do
    case File.read(@boot_id) do
      {:ok, text} -> String.trim(text)
      {:error, _reason} -> @unknown
    end
  end
end
