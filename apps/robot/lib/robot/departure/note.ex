defmodule Robot.Departure.Note do
  @moduledoc """
  Keeps the file that remembers that a robot has left its start pose (`Robot.Departure`).

  It holds the boot of the machine and the odometry frame whose zero is the start pose. A file of an earlier boot does
  not count: a person who boots the machine puts the robot at its start pose. So does one who starts the robot by hand, or
  stops its service (`Swarm.Host.DepartureFile`): then the file is deleted.

  What cannot be read counts as left.
  """
  alias Robot.Departure

  @boot_id "/proc/sys/kernel/random/boot_id"
  @unknown Departure.frame(nil)

  @doc "The frame that was noted since the machine was booted; `nil` if the robot has not left its start pose."
  @spec read(Path.t() | nil) :: Departure.frame() | nil
  def read(nil), do: nil

  def read(path) do
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
  @spec write(Path.t(), Departure.frame()) :: :ok | {:error, File.posix()}
  def write(path, frame) do
    aside = path <> ".new"
    # `:raw`: a disk that hangs, hangs the caller, and not the node's file server.
    with :ok <- File.write(aside, "#{boot()}\n#{frame}\n", [:raw]), do: File.rename(aside, path)
  end

  @doc "Deletes the note."
  @spec delete(Path.t()) :: :ok | {:error, File.posix()}
  def delete(path), do: with({:error, :enoent} <- File.rm(path), do: :ok)

  defp boot do
    case File.read(@boot_id) do
      {:ok, text} -> String.trim(text)
      {:error, _reason} -> @unknown
    end
  end
end
