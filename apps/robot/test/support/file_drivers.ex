defmodule Robot.FileDrive do
  @moduledoc false
  # A drive that says what options it takes, and takes any port.
  @behaviour Hal.Drive

  @keys [:port, :sonar_banks, :conversions]

  def options(options) do
    case Keyword.keys(options) -- @keys do
      [] -> if options[:port], do: {:ok, options}, else: {:error, "drive option :port is missing"}
      more -> {:error, Enum.map(more, &"drive has no option #{inspect(&1)}")}
    end
  end

  @impl Hal.Drive
  def init(options), do: {:ok, options}
  @impl Hal.Drive
  def drive(_twist, state), do: {:ok, state}
  @impl Hal.Drive
  def handle_message(_message, state), do: {:ok, [], state}
  @impl Hal.Drive
  def terminate(_state), do: :ok
end

defmodule Robot.FilePtz do
  @moduledoc false
  # A head that takes any options.
  @behaviour Hal.Ptz

  @impl Hal.Ptz
  def init(options), do: {:ok, options}
  @impl Hal.Ptz
  def look(_pan, _tilt, state), do: {:ok, state}
  @impl Hal.Ptz
  def handle_message(_message, state), do: {:ok, [], state}
  @impl Hal.Ptz
  def terminate(_state), do: :ok
end
