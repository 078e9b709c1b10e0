defmodule Hal.SerialBase.Options do
  @moduledoc """
  Checks what the options of all bases on a serial line have in common: the line, the body, and the limits, which never
  exceed what the body can do. Pure.
  """
  alias Hal.{Options, Profile, Serial}
  alias Hal.Drive.SlewLimiter

  # If the VM freezes, the wheels turn on for this long; a driver gives a sign of life every 50 ms.
  @serial Serial.table()
          |> Keyword.take([:pty, :module])
          |> Keyword.put(:keep_alive_ms, {:integer, 100, 300, "ms"})
  @limits [
    max_linear: {:number, 1.0e-3, 10.0, "m/s"},
    max_turn: {:number, 1.0e-3, 10.0, "rad/s"},
    max_acceleration: {:number, 1.0e-3, 10.0, "m/s2"},
    max_turn_acceleration: {:number, 1.0e-3, 10.0, "rad/s2"},
    max_braking: {:number, 1.0e-3, 10.0, "m/s2"},
    max_turn_braking: {:number, 1.0e-3, 10.0, "rad/s2"}
  ]
  @of_body Enum.take(Keyword.keys(@limits), 4)

  @typedoc "What a body can do, as `Hal.Profile` says it: the four limits without braking, in SI units."
  @type abilities :: Profile.t() | %{atom() => float()}

  @doc "The options of a line of this speed (baud), of its limits, and of the clock (`{m, f, a}` of milliseconds)."
  @spec table(baud :: pos_integer()) :: Options.table()
  def table(baud) do
    [
      port: [:path, default: nil],
      speed: [{:integer, 1, 20_000_000, "baud"}, default: baud],
      serial: [{:keys, @serial}, default: []],
      limits: [{:keys, @limits}, default: []],
      clock: [:mfa, default: {System, :monotonic_time, [:millisecond]}]
    ]
  end

  @doc "The options for `Hal.Serial.open/1`, without last words."
  @spec line(keyword() | map() | struct()) :: keyword()
  def line(%{port: nil, speed: speed, serial: serial}), do: [speed: speed] ++ serial
  def line(%{port: port, speed: speed, serial: serial}), do: [port: port, speed: speed] ++ serial
  def line(options) when is_list(options), do: options |> Map.new() |> line()

  @doc "The name by which people know the line: its device, or the link of its pseudo-terminal."
  @spec line_name(keyword() | map() | struct()) :: String.t() | nil
  def line_name(%{port: port, serial: serial}), do: port || serial[:pty]
  def line_name(options), do: options[:port] || options[:serial][:pty]

  @doc """
  The limits at rest: those that are given, otherwise the body's. One that exceeds the body's is an error, which names the
  options of `subject`.

      iex> body = %{max_linear: 0.7, max_turn: 3.0, max_acceleration: 0.3, max_turn_acceleration: 3.5}
      iex> {:ok, limits} = Hal.SerialBase.Options.limits([max_linear: 0.2], body, "kobuki")
      iex> {limits.max_linear, limits.max_turn}
      {0.2, 3.0}
      iex> Hal.SerialBase.Options.limits([max_turn: 4.0], body, "kobuki")
      {:error, "kobuki option limits.max_turn: expected a number above 0 and up to 3.0, what the body can do, got 4.0"}
  """
  @spec limits(keyword(), abilities(), subject :: String.t()) ::
          {:ok, SlewLimiter.t()} | {:error, String.t()}
  def limits(given, body, subject) do
    case Enum.find(given, fn {key, value} -> value > Map.get(body, key, 10.0) end) do
      nil ->
        defaults = for key <- @of_body, do: {key, Map.fetch!(body, key)}
        {:ok, SlewLimiter.new(Keyword.merge(defaults, given))}

      {key, value} ->
        most = "a number above 0 and up to #{Map.fetch!(body, key)}, what the body can do,"
        Options.refuse(subject, [:limits, key], value, most)
    end
  end

  @doc "What a base can do when its makers and its body say so: the lower of both; `nil` for no body."
  @spec abilities(%{atom() => float()}, Profile.t() | nil) :: %{atom() => float()}
  def abilities(makers, nil), do: makers

  def abilities(makers, %Profile{} = body),
    do: Map.new(makers, fn {key, most} -> {key, min(most, Map.fetch!(body, key))} end)
end
