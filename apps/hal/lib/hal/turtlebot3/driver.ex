defmodule Hal.TurtleBot3.Driver do
  @moduledoc """
  Drives a TurtleBot3 by its OpenCR board with the firmware for ROS 2, without ROS. `Hal.Device` runs it. (The firmware for ROS 1
  speaks another protocol, and is silent here.)

  | option | allowed | default |
  |---|---|---|
  | `:port` | the line's device | required, unless `serial: [pty: LINK]` is given |
  | `:speed` | baud | `1_000_000` |
  | `:serial` | `pty:`, `module:` of `Hal.Serial` (only `Hal.Serial.Native` stops the wheels when the VM is killed); `keep_alive_ms:`, 100 to 300 | `[]` |
  | `:model` | `:burger` or `:waffle`: the distance of the wheels, 0.160 or 0.287 m | `:burger` |
  | `:calibrate` | whether it calibrates its gyro when its line is first opened, and after a restart; it must stand still for 5 s | `true` |
  | `:profile` | a `Hal.Profile`, the body | none: the limits of the maker |
  | `:limits` | `max_linear:` m/s, `max_turn:` rad/s, `max_acceleration:` m/s2, `max_turn_acceleration:` rad/s2, none above 0.22, 2.84, 0.5, 3.0 (a Burger's speeds; the accelerations are our choice) and the body's; `max_braking:`, `max_turn_braking:` up to 10 | those; braking twice the acceleration |
  | `:clock` | `{m, f, a}` that returns integer milliseconds | monotonic time |

  The board takes speeds in steps of 0.01 m/s and 0.01 rad/s. The heading is that of its own sensors.

  **The firmware's watchdog is fed only while orders are fresh**: the heartbeat, every 100 ms, comes from the same place as the speed, so
  the board stops the wheels 500 ms after the last one, whatever dies: the VM, the port program, or the computer. The line's last words
  stop them at once, and take the torque off.
  """
  use Hal.SerialBase,
    subject: "turtlebot3",
    speed: 1_000_000,
    limits: %{
      max_linear: 0.22,
      max_turn: 2.84,
      max_acceleration: 0.5,
      max_turn_acceleration: 3.0
    }

  alias Hal.{SerialBase, Twist}
  alias Hal.TurtleBot3.{Packet, Readings}

  @wheel_bases %{burger: 0.160, waffle: 0.287}
  @reply_ms 20
  @beat_ms 100
  @calibrate_ms 5_000

  @enforce_keys [:senses, :calibrates?, :calibrated?]
  defstruct @enforce_keys ++
              [
                rest: <<>>,
                twist: Twist.zero(),
                due: [],
                asked: nil,
                beat: 0,
                beat_ms: nil,
                still_ms: nil,
                refused?: false
              ]

  @impl Hal.SerialBase
  def own_table do
    [
      model: [{:one_of, Map.keys(@wheel_bases)}, default: :burger],
      calibrate: [:boolean, default: true]
    ]
  end

  @impl Hal.SerialBase
  def new(options, before, at_ms) do
    {odometry, calibrated?} = before || {nil, false}

    protocol = %__MODULE__{
      senses: Readings.new(@wheel_bases[options.model], odometry),
      calibrates?: options.calibrate,
      calibrated?: calibrated?
    }

    next(%{protocol | due: [:speed | setup(protocol)]}, at_ms)
  end

  defp setup(%{calibrates?: true, calibrated?: false}), do: [:torque, :calibrate]
  defp setup(_protocol), do: [:torque]

  @impl Hal.SerialBase
  def hear(protocol, bytes, at_ms) do
    read = fn reply, protocol -> reply(reply, answered(protocol, at_ms), at_ms) end
    {readings, protocol} = SerialBase.read(protocol, bytes, &Packet.cut/1, read)
    {said, protocol} = next(protocol, at_ms)
    {readings, said, protocol}
  end

  defp answered(%{asked: {:calibrate, _ms}} = protocol, at_ms),
    do: %{protocol | asked: nil, still_ms: at_ms + @calibrate_ms}

  defp answered(protocol, _at_ms), do: %{protocol | asked: nil}

  # The low bits are a code; the highest one only warns.
  defp reply({error, _data}, protocol, _at_ms) when rem(error, 128) != 0 do
    line = "its board refuses what it is told (error #{rem(error, 128)})"
    {[{:refused, :drive, line}], %{protocol | refused?: true}}
  end

  defp reply({_well, data}, protocol, at_ms) do
    {_from, size} = Readings.block()

    if byte_size(data) == size do
      {readings, senses} = Readings.table(protocol.senses, data, at_ms)

      {readings ++ obeyed(protocol),
       restarted(%{protocol | senses: senses, refused?: false}, protocol)}
    else
      {[], protocol}
    end
  end

  defp obeyed(%{refused?: true}), do: [obeyed: :drive]
  defp obeyed(_protocol), do: []

  # A board that was switched off and on has no torque, and its gyro is not calibrated.
  defp restarted(%{senses: %{restarts: n, torque: torque}} = protocol, %{senses: %{restarts: n}}),
    do: if(torque == 0, do: put_due(protocol, [:torque]), else: protocol)

  defp restarted(protocol, _before) do
    protocol = %{protocol | calibrated?: false, still_ms: nil}
    put_due(protocol, setup(protocol))
  end

  defp put_due(protocol, wanted), do: %{protocol | due: Enum.uniq(protocol.due ++ wanted)}

  @impl Hal.SerialBase
  def say(protocol, twist, fresh?, at_ms) do
    stop? = Twist.zero?(twist) and not Twist.zero?(protocol.twist)
    beat? = fresh? and (protocol.beat_ms == nil or at_ms - protocol.beat_ms >= @beat_ms)
    wanted = [:speed] ++ if(beat?, do: [:beat], else: []) ++ [:read]
    protocol = put_due(%{protocol | twist: twist}, wanted)

    # A stop waits for no answer; one that is late is not awaited any more.
    if stop? or late?(protocol, at_ms),
      do: protocol |> unanswered() |> next(at_ms),
      else: next(protocol, at_ms)
  end

  defp late?(%{asked: nil}, _at_ms), do: false
  defp late?(%{asked: {_what, asked_ms}}, at_ms), do: at_ms - asked_ms >= @reply_ms

  # What is said but once is asked again.
  defp unanswered(%{asked: {what, _ms}} = protocol) when what in [:torque, :calibrate],
    do: put_due(%{protocol | asked: nil}, [what])

  defp unanswered(protocol), do: %{protocol | asked: nil}

  # One request at a time; the speed comes before all others.
  defp next(%{asked: nil, due: [_ | _] = due} = protocol, at_ms) do
    first = if :speed in due, do: :speed, else: hd(due)
    {bytes, protocol} = request(first, protocol, at_ms)
    {bytes, %{protocol | due: List.delete(due, first), asked: {first, at_ms}}}
  end

  defp next(protocol, _at_ms), do: {[], protocol}

  defp request(:speed, protocol, _at_ms), do: {speed(protocol.twist), protocol}
  defp request(:torque, protocol, _at_ms), do: {Packet.write(149, <<1>>), protocol}

  defp request(:calibrate, protocol, _at_ms), do: {Packet.write(59, <<1>>), protocol}

  defp request(:beat, protocol, at_ms) do
    beat = rem(protocol.beat + 1, 256)
    {Packet.write(19, <<beat>>), %{protocol | beat: beat, beat_ms: at_ms}}
  end

  defp request(:read, protocol, _at_ms) do
    {from, size} = Readings.block()
    {Packet.read(from, size), protocol}
  end

  # All six speeds at once: along x first, about z last.
  defp speed(%Twist{linear: linear, turn: turn}) do
    Packet.write(
      150,
      <<round(100 * linear)::little-signed-32, 0::128, round(100 * turn)::little-signed-32>>
    )
  end

  @impl Hal.SerialBase
  def keep(protocol), do: {protocol.senses.odometry, calibrated?(protocol)}

  defp calibrated?(%{calibrated?: true}), do: true

  defp calibrated?(%{still_ms: still_ms, senses: %{last: {_time, at_ms}}}) when still_ms != nil,
    do: at_ms >= still_ms

  defp calibrated?(_not_yet), do: false

  @impl Hal.SerialBase
  def able(protocol) do
    if protocol.calibrates? and not calibrated?(protocol),
      do: {:error, "its gyro is being calibrated: it must stand still for 5 s"},
      else: Readings.able(protocol.senses)
  end

  @impl Hal.SerialBase
  def stop_words(_options), do: speed(Twist.zero()) <> Packet.write(149, <<0>>)
end
