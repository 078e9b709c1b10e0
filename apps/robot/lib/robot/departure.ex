defmodule Robot.Departure do
  @moduledoc """
  Remembers in a file that a robot has left its start pose, for its processes, or its node, that start again on the
  way. A drive that starts again counts from zero, so the odometry alone would say that the robot stands at its start
  pose.

  The file holds the boot of the machine and the odometry frame (`Hal.Odometry`) whose zero is the start pose; a file
  of an earlier boot does not count. Whoever ends the robot in an orderly way deletes it (`forget/1`): the next start
  is by a person, who puts the robot at its start pose.
  """
  alias Hal.{Event, Pose}

  # Farther from zero than this, in metres or radians, the robot has left its start pose.
  @left 0.1
  @boot_id "/proc/sys/kernel/random/boot_id"

  @typedoc "The odometry frame whose zero is the start pose, as text."
  @type frame :: String.t()

  @doc """
  Whether this pose of the odometry has left the one at which it began to count.

      iex> Robot.Departure.left?(Hal.Pose.new(0.02, 0.0, 0.05))
      false
      iex> Robot.Departure.left?(Hal.Pose.new(0.0, 0.0, -0.2))
      true
  """
  @spec left?(Pose.t()) :: boolean()
  def left?(%Pose{heading: heading} = odometry),
    do: Pose.distance(odometry, {0.0, 0.0}) > @left or abs(heading) > @left

  @doc "A frame as text. References begin with the time at which their node started, so none comes twice."
  @spec frame(reference() | nil) :: frame()
  def frame(reference), do: inspect(reference)

  @doc "The frame that was noted since the machine was booted; `nil` if the robot has not left its start pose."
  @spec noted(Path.t() | nil) :: frame() | nil
  def noted(nil), do: nil

  def noted(path) do
    boot = boot()

    with {:ok, text} <- File.read(path), [^boot, frame] <- String.split(text, "\n", trim: true) do
      frame
    else
      _none_or_of_another_boot -> nil
    end
  end

  @doc "Notes that the robot has left the start pose."
  @spec note(Path.t(), frame()) :: :ok | {:error, File.posix()}
  def note(path, frame) do
    aside = path <> ".new"
    with :ok <- File.write(aside, "#{boot()}\n#{frame}\n"), do: File.rename(aside, path)
  end

  @doc "Notes it for this robot; that it cannot is an event, which the log tells."
  @spec note_for(robot :: atom(), Path.t(), frame()) :: :ok
  def note_for(robot, path, frame) do
    with {:error, reason} <- note(path, frame) do
      about = %{robot: robot, file: path, reason: reason}
      Event.execute([:robot, :departure_file, :failed], %{}, about)
    end
  end

  @doc "Deletes the note."
  @spec forget(Path.t()) :: :ok
  def forget(path) do
    _none = File.rm(path)
    :ok
  end

  # Where there is no such file, every note counts until it is deleted.
  defp boot do
    case File.read(@boot_id) do
      {:ok, text} -> String.trim(text)
      {:error, _reason} -> "unknown"
    end
  end
end
