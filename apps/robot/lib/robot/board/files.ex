defmodule Robot.Board.Files do
  @moduledoc false
  # What the board's process keeps on disks, so that it outlives the board: the e-stop latch, as a file that exists
  # while it is set, and the note that the robot has left its start pose. A disk may hang; so all is `:raw`, in the
  # calling process: else the node's one file server would hang with it.
  alias Hal.Event
  alias Robot.Departure

  @enforce_keys [:robot, :estop, :departure]
  defstruct @enforce_keys ++ [told?: false]

  @typedoc "`told?`: a note that failed has been reported."
  @type t :: %__MODULE__{
          robot: atom(),
          estop: Path.t() | nil,
          departure: Path.t() | nil,
          told?: boolean()
        }

  @doc "The files of a robot, its latch, and the frame in which it has left its start pose, as they say."
  @spec read(Robot.Config.t()) :: {t(), latched? :: boolean(), Departure.frame() | nil}
  def read(%Robot.Config{id: robot, estop_file: estop, departure_file: departure}) do
    latched? = estop != nil and File.exists?(estop, [:raw])
    files = %__MODULE__{robot: robot, estop: estop, departure: departure}
    {files, latched?, Departure.Note.read(departure)}
  end

  @doc "Makes the e-stop file say whether the latch is set, or reports that it cannot."
  @spec latch(t(), latched? :: boolean()) :: :ok
  def latch(%__MODULE__{estop: nil}, _latched?), do: :ok

  def latch(%__MODULE__{robot: robot, estop: path}, latched?) do
    with {:error, reason} <- write(path, latched?) do
      about = %{robot: robot, file: path, reason: reason}
      Event.execute([:robot, :estop_file, :error], %{}, about)
    end
  end

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
