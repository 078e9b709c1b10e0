defmodule Robot.Board.Files do
  @moduledoc false
  # What the board's process keeps on disks, so that it outlives the board: the e-stop latch, as a file that exists
  # while it is set, and the note that the robot has left its start pose. A disk may hang; so all is `:raw`, in the
  # calling process: else the node's one file server would hang with it.
  alias Hal.Event
  alias Robot.Departure

  @enforce_keys [:robot, :estop, :departure]
  defstruct @enforce_keys ++ [told?: false, failed: nil]

  @typedoc "`told?`: a note that failed has been reported; `failed`: why the e-stop file is not as the latch is."
  @type t :: %__MODULE__{
          robot: atom(),
          estop: Path.t() | nil,
          departure: Path.t() | nil,
          told?: boolean(),
          failed: File.posix() | nil
        }

  @typedoc "A file that could not be written or deleted, and why."
  @type fault :: {Path.t(), File.posix()}

  @doc "The files of a robot, its latch, and the frame in which it has left its start pose, as they say."
  @spec read(Robot.Config.t()) :: {t(), latched? :: boolean(), Departure.frame() | nil}
  def read(%Robot.Config{id: robot, estop_file: estop, departure_file: departure}) do
    latched? = estop != nil and File.exists?(estop, [:raw])
    files = %__MODULE__{robot: robot, estop: estop, departure: departure}
    {files, latched?, Departure.Note.read(departure)}
  end

  @doc "Makes the e-stop file say whether the latch is set. Reports once why it cannot, and that it could again."
  @spec latch(t(), latched? :: boolean()) :: {:ok | {:error, fault()}, t()}
  def latch(%__MODULE__{estop: nil} = files, _latched?), do: {:ok, files}

  def latch(%__MODULE__{estop: path} = files, latched?) do
    case write(path, latched?) do
      :ok ->
        if files.failed, do: event(files, :healed, %{})
        {:ok, %{files | failed: nil}}

      {:error, reason} ->
        if reason != files.failed, do: event(files, :error, %{reason: reason})
        {{:error, {path, reason}}, %{files | failed: reason}}
    end
  end

  defp event(%{robot: robot, estop: path}, name, more),
    do:
      Event.execute(
        [:robot, :estop_file, name],
        %{},
        Map.merge(%{robot: robot, file: path}, more)
      )

  defp write(path, true), do: File.write(path, "e-stop\n", [:raw, :sync])
  defp write(path, false), do: with({:error, :enoent} <- :file.delete(path, [:raw]), do: :ok)

  @doc "Notes that the robot has left its start pose. A failure is reported once."
  @spec depart(t(), Departure.frame()) :: {:ok | :error, t()}
  def depart(%__MODULE__{departure: nil} = files, _frame), do: {:ok, files}

  def depart(%__MODULE__{robot: robot, departure: path, told?: told?} = files, frame) do
    case Departure.Note.write(path, frame) do
      :ok ->
        {:ok, %{files | told?: false}}

      {:error, _reason} ->
        about = %{robot: robot, file: path}
        unless told?, do: Event.execute([:robot, :departure_file, :failed], %{}, about)
        {:error, %{files | told?: true}}
    end
  end
end
