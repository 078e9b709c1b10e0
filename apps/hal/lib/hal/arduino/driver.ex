defmodule Hal.Arduino.Driver do
  @moduledoc """
  Drives a base whose Arduino speaks the text protocol of ros_arduino_bridge. `Hal.Device` runs it.

  | option | allowed | default |
  |---|---|---|
  | `:port` | the line's device | required, unless `serial: [pty: LINK]` is given |
  | `:speed` | baud; some forks have 115,200 | `57_600` |
  | `:serial` | `pty:`, `module:` of `Hal.Serial` (only `Hal.Serial.Native` stops the wheels when the VM is killed); `keep_alive_ms:`, 100 to 300 | `[]` |
  | `:ticks` | counts of an encoder in a turn of its wheel | none: the drive does not arm |
  | `:wheel_radius`, `:wheel_base` | metres | none: the drive does not arm |
  | `:profile` | a `Hal.Profile`, the body | none: the limits below |
  | `:limits` | `max_linear:` m/s, `max_turn:` rad/s, `max_acceleration:` m/s2, `max_turn_acceleration:` rad/s2, none above 1.0, 6.0, 1.0, 6.0 and the body's; `max_braking:`, `max_turn_braking:` up to 10 | those of the body |
  | `:clock` | `{m, f, a}` that returns integer milliseconds | monotonic time |

  The wheels get whole counts per 1/30 s, so a base with few counts drives in coarse steps. Odometry is that of its encoders, ten times a second.

  Its firmware stops the wheels **2 s after the last command**, whatever dies; before that the line's last words do. Opening the line
  resets most Arduinos: for 2 s it says nothing. It has no checksum: after three answers in a row that say
  nothing known the wheels stop, and are armed anew when it is understood again.
  """
  use Hal.SerialBase,
    subject: "arduino",
    speed: 57_600,
    # It says nothing for 2 s after the opening of its line.
    silent_ms: 5_000,
    limits: %{
      max_linear: 1.0,
      max_turn: 6.0,
      max_acceleration: 1.0,
      max_turn_acceleration: 6.0
    }

  alias Hal.{Arduino, SerialBase, Twist}

  @loop_hz 30
  @ask_ms 100
  @bad 3

  @enforce_keys [:options, :odometry]
  defstruct @enforce_keys ++ [rest: <<>>, asked_ms: nil, bad: 0]

  @impl Hal.SerialBase
  def own_table do
    [
      ticks: [{:integer, 1, 10_000_000, "counts a turn"}, default: nil],
      wheel_radius: [{:number, 0.005, 1.0, "m"}, default: nil],
      wheel_base: [{:number, 0.02, 3.0, "m"}, default: nil]
    ]
  end

  @impl Hal.SerialBase
  def able_by(options) do
    case for key <- [:ticks, :wheel_radius, :wheel_base], options[key] == nil, do: key do
      [] -> :ok
      missing -> {:error, "measures of its wheels are missing: #{Enum.join(missing, ", ")}"}
    end
  end

  @impl Hal.SerialBase
  def new(options, before, _at_ms) do
    # Its counters began at 0 when the line was opened.
    odometry = if before, do: SerialBase.Odometry.anew(before), else: odometry(options)
    {[Arduino.probe(), stop_words(options)], %__MODULE__{options: options, odometry: odometry}}
  end

  defp odometry(options) do
    if able_by(options) == :ok do
      most = options.limits.max_linear + options.limits.max_turn * options.wheel_base / 2
      SerialBase.Odometry.new(32, round_m(options) / options.ticks, options.wheel_base, most)
    end
  end

  defp round_m(options), do: 2 * :math.pi() * options.wheel_radius

  @impl Hal.SerialBase
  def hear(protocol, bytes, at_ms) do
    read = fn answer, protocol -> answer(protocol, answer, at_ms) end
    {readings, protocol} = SerialBase.read(protocol, bytes, &Arduino.cut/1, read)
    {readings, [], protocol}
  end

  defp answer(protocol, :bad, _at_ms), do: {[], %{protocol | bad: min(protocol.bad + 1, @bad)}}

  defp answer(%{odometry: nil} = protocol, {:encoders, _left, _right}, _at_ms),
    do: {[{:report, :wheels}], %{protocol | bad: 0}}

  defp answer(protocol, {:encoders, left, right}, at_ms) do
    report = %{left: left, right: right, at_ms: at_ms}
    report = Map.merge(report, %{elapsed_ms: nil, turn: nil, restarted?: false})
    {reading, odometry} = SerialBase.Odometry.report(protocol.odometry, report)
    readings = if reading, do: [odometry: reading], else: []
    {readings, %{protocol | odometry: odometry, bad: 0}}
  end

  defp answer(protocol, _done_or_number, _at_ms), do: {[], %{protocol | bad: 0}}

  @impl Hal.SerialBase
  def say(%{asked_ms: asked_ms} = protocol, twist, _fresh?, at_ms) do
    motors = motors(protocol.options, twist)

    if asked_ms == nil or at_ms - asked_ms >= @ask_ms,
      do: {[motors, Arduino.encoders()], %{protocol | asked_ms: at_ms}},
      else: {motors, protocol}
  end

  # Without the measures the speed is 0 (`able_by/1`).
  defp motors(%{wheel_base: base} = options, %Twist{linear: linear, turn: turn})
       when linear != 0 or turn != 0 do
    counts = options.ticks / round_m(options) / @loop_hz
    half = turn * base / 2
    Arduino.motors(round((linear - half) * counts), round((linear + half) * counts))
  end

  defp motors(_options, _stop), do: Arduino.motors(0, 0)

  @impl Hal.SerialBase
  def keep(protocol), do: protocol.odometry

  @impl Hal.SerialBase
  def able(%{bad: @bad}),
    do: {:error, "its answers say nothing that is known (is its speed right?)"}

  def able(_protocol), do: :ok

  # The first byte ends what was half said.
  @impl Hal.SerialBase
  def stop_words(_options), do: "\r" <> Arduino.motors(0, 0)
end
