defmodule Robot.FileDrive do
  @moduledoc false
  # A drive that says what options it takes, and takes any port.
  @behaviour Hal.Drive

  @keys [:port, :sonar_banks, :conversions, :bumpers, :profile]

  def options(options) do
    sonars = options[:profile] && length(options[:profile].sonars)
    banks = options[:sonar_banks] && Enum.sum(options[:sonar_banks])

    cond do
      more = Enum.find(Keyword.keys(options), &(&1 not in @keys)) ->
        {:error, "drive has no option #{inspect(more)}"}

      options[:port] == nil ->
        {:error, "drive option :port is missing"}

      sonars && banks && sonars != banks ->
        {:error, "drive option :sonar_banks has #{banks} for #{sonars}"}

      true ->
        {:ok,
         Keyword.merge(Enum.map(@keys, &{&1, nil}), conversions: [distance: nil, angle: nil])}
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
