defmodule Robot.FileDrive do
  @moduledoc false
  # A drive that says what options it takes, and takes any port.
  @behaviour Hal.Drive

  @impl Hal.Drive
  def option_table do
    [
      port: [:path, required: true],
      sonar_banks: {:list, {:integer, 0, 16}},
      conversions: {:keys, distance: {:number, 0, 1.0e6}, angle: {:number, 0, 1.0e6}},
      bumpers: {:keys, count: {:integer, 0, 16}},
      profile: {:struct, Hal.Profile}
    ]
  end

  def options(options) do
    sonars = options[:profile] && length(options[:profile].sonars)
    banks = options[:sonar_banks] && Enum.sum(options[:sonar_banks])

    if sonars && banks && sonars != banks,
      do: {:error, "drive option sonar_banks has #{banks} for #{sonars}"},
      else: {:ok, options}
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

defmodule Robot.FileLidar do
  @moduledoc false
  # A lidar that takes any options.
  @behaviour Hal.Lidar

  @impl Hal.Lidar
  def init(options), do: {:ok, options}
  @impl Hal.Lidar
  def handle_message(_message, state), do: {:ok, [], state}
  @impl Hal.Lidar
  def terminate(_state), do: :ok
end
