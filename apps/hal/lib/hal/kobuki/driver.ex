defmodule Hal.Kobuki.Driver do
  @moduledoc """
  Drives a Kobuki, the base of a TurtleBot 2. `Hal.Device` runs it.

  | option | allowed | default |
  |---|---|---|
  | `:port` | the line's device | required, unless `serial: [pty: LINK]` is given |
  | `:speed` | baud | `115_200` |
  | `:serial` | `pty:`, `module:` of `Hal.Serial` (only `Hal.Serial.Native` stops the wheels when the VM is killed); `keep_alive_ms:`, 100 to 300 | `[]` |
  | `:profile` | a `Hal.Profile`, the body | none: the limits of the maker |
  | `:limits` | `max_linear:` m/s, `max_turn:` rad/s, `max_acceleration:` m/s2, `max_turn_acceleration:` rad/s2, none above the maker's (0.7, π, 0.3, 3.5) and the body's; `max_braking:`, `max_turn_braking:` up to 10 | those; braking twice the acceleration |
  | `:clock` | `{m, f, a}` that returns integer milliseconds | monotonic time |

  The heading is the gyro's, the way is the wheels'. A difference of more than 0.2 rad in a second is told as slip.

  **Its firmware has no time-out that is known**: it does what it was told last. What stops it when nothing drives it any more are the
  line's last words; when the port program itself is killed, or the cable is pulled, nothing does until the line is open
  again, which sends a stop first.

  The wheels stop, and a person arms them again, when one hangs in the air or a cliff sensor sees no floor. It does not arm before it has
  told the version of its firmware, which it is asked every second.
  """
  use Hal.SerialBase,
    subject: "kobuki",
    speed: 115_200,
    limits: %{
      max_linear: 0.7,
      max_turn: 3.14159,
      max_acceleration: 0.3,
      max_turn_acceleration: 3.5
    }

  alias Hal.{Kobuki, SerialBase, Twist}
  alias Hal.Kobuki.Readings

  @ask_ms 1_000

  @enforce_keys [:senses, :asked_ms]
  defstruct @enforce_keys ++ [rest: <<>>]

  @impl Hal.SerialBase
  def own_table, do: []

  @impl Hal.SerialBase
  def new(%{profile: profile}, before, at_ms) do
    bumpers = if profile, do: profile.bumpers, else: 6
    protocol = %__MODULE__{senses: Readings.new(bumpers, before), asked_ms: at_ms}
    {[Kobuki.speed(Twist.zero()), Kobuki.ask()], protocol}
  end

  @impl Hal.SerialBase
  def hear(protocol, bytes, at_ms) do
    {readings, protocol} =
      SerialBase.read(protocol, bytes, &Kobuki.cut/1, fn payload, protocol ->
        {readings, senses} = Readings.packet(protocol.senses, payload, at_ms)
        {readings, %{protocol | senses: senses}}
      end)

    {readings, [], protocol}
  end

  @impl Hal.SerialBase
  def say(%{senses: %{firmware: nil}, asked_ms: asked_ms} = protocol, twist, _fresh?, at_ms)
      when at_ms - asked_ms >= @ask_ms,
      do: {[Kobuki.speed(twist), Kobuki.ask()], %{protocol | asked_ms: at_ms}}

  def say(protocol, twist, _fresh?, _at_ms), do: {Kobuki.speed(twist), protocol}

  @impl Hal.SerialBase
  def keep(protocol), do: protocol.senses.odometry

  @impl Hal.SerialBase
  def able(protocol), do: Readings.able(protocol.senses)

  @impl Hal.SerialBase
  def stop_words(_options), do: Kobuki.speed(Twist.zero())
end
