defmodule Hal.Create.Driver do
  @moduledoc """
  Drives an iRobot Create 2 or a Roomba 600 to 800 by its serial interface. `Hal.Device` runs it. (A Create 1 and a Roomba 500 have no
  encoders in it, a Create 3 has no such interface: they are not driven.)

  | option | allowed | default |
  |---|---|---|
  | `:port` | the line's device | required, unless `serial: [pty: LINK]` is given |
  | `:speed` | baud | `115_200` |
  | `:serial` | `pty:`, `module:` of `Hal.Serial` (only `Hal.Serial.Native` stops the wheels when the VM is killed); `keep_alive_ms:`, 100 to 300 | `[]` |
  | `:profile` | a `Hal.Profile`, the body | none: the limits of the maker |
  | `:limits` | `max_linear:` m/s, `max_turn:` rad/s, `max_acceleration:` m/s2, `max_turn_acceleration:` rad/s2, none above 0.5, 4.25, 0.5, 3.0 (the accelerations are our choice) and the body's; `max_braking:`, `max_turn_braking:` up to 10 | those; braking twice the acceleration |
  | `:clock` | `{m, f, a}` that returns integer milliseconds | monotonic time |

  It is driven in its safe mode: by itself it stops at a cliff, when a wheel drops, and on a charger, and the wheels then have no power. The driver tells the
  reason, and gives them power again when it is gone; a person arms. Its own switch, or a reset, takes the power, too.

  **It has no time-out**: it does what it was told last. What stops it when nothing drives it any more are the line's last words, a stop
  and no power for the wheels; when the port program itself is killed, or the cable is pulled, it drives on until it
  is lifted or at a cliff, or until the line is open again.

  Its encoders count by the direction that was commanded: pushed by hand, they err. A base that was silent for 0.5 s is
  set up again, every 0.5 s, and its odometry goes on in a new frame.
  """
  use Hal.SerialBase,
    subject: "create",
    speed: 115_200,
    limits: %{
      max_linear: 0.5,
      max_turn: 4.25,
      max_acceleration: 0.5,
      max_turn_acceleration: 3.0
    }

  alias Hal.{Create, SerialBase}
  alias Hal.Create.Readings

  @again_ms 500

  @enforce_keys [:senses, :opened_ms]
  defstruct @enforce_keys ++ [rest: <<>>, due: [], powered_ms: nil]

  @impl Hal.SerialBase
  def own_table, do: []

  @impl Hal.SerialBase
  def new(%{profile: profile}, before, at_ms) do
    bumpers = if profile, do: profile.bumpers, else: 8
    protocol = %__MODULE__{senses: Readings.new(bumpers, before), opened_ms: at_ms}
    # After a change of its mode it hears nothing for 20 ms; the rest comes with the next ticks.
    {Create.stop(), %{protocol | due: [Create.stream()]}}
  end

  @impl Hal.SerialBase
  def hear(protocol, bytes, at_ms) do
    read = fn report, protocol ->
      {readings, senses} = Readings.report(protocol.senses, report, at_ms)
      {readings, %{protocol | senses: senses}}
    end

    {readings, protocol} = SerialBase.read(protocol, bytes, &Create.cut/1, read)
    {readings, [], protocol}
  end

  @impl Hal.SerialBase
  def say(%{due: [next | later]} = protocol, _twist, _fresh?, _at_ms),
    do: {next, %{protocol | due: later}}

  def say(protocol, twist, _fresh?, at_ms) do
    cond do
      at_ms - (protocol.senses.heard_ms || protocol.opened_ms) >= @again_ms ->
        protocol = %{protocol | opened_ms: at_ms, senses: %{protocol.senses | heard_ms: nil}}
        {Create.stop(), %{protocol | due: [Create.stream()]}}

      powers?(protocol, at_ms) ->
        {Create.safe(), %{protocol | powered_ms: at_ms}}

      true ->
        {Create.speed(twist), protocol}
    end
  end

  # Nothing stands against power for the wheels, which have none: it is asked for, at most twice a second.
  defp powers?(%{senses: senses, powered_ms: powered_ms}, at_ms) do
    Readings.clear?(senses) and not Readings.safe?(senses) and
      (powered_ms == nil or at_ms - powered_ms >= @again_ms)
  end

  @impl Hal.SerialBase
  def keep(protocol), do: protocol.senses.odometry

  @impl Hal.SerialBase
  def able(protocol), do: Readings.able(protocol.senses)

  @impl Hal.SerialBase
  def stop_words(_options), do: Create.stop()
end
