defmodule Hal.RFlex.Driver do
  @moduledoc """
  Drives a base with an rFLEX controller on a serial line. `Hal.Device` runs it.

  | option | allowed | default |
  |---|---|---|
  | `:port` | the line's device | required, unless `serial: [pty: LINK]` is given |
  | `:speed` | baud | `115_200` |
  | `:serial` | `pty:`, `module:` of `Hal.Serial` (only `Hal.Serial.Native` stops the wheels when the VM is killed); `keep_alive_ms:`, 100 to 300 | `[]` |
  | `:profile` | `:magellan`, `:atrv_mini` or a `Hal.Profile` | `:magellan` |
  | `:conversions` | `distance:` units per metre, `angle:` per radian, `wheel_ratio:` 0.8 to 1.25, `range:` per metre of sonar, `ir_a:`, `ir_b:` (`Hal.RFlex.Conversions`) | none: the drive does not arm |
  | `:limits` | `max_linear:` m/s, `max_turn:` rad/s, `max_acceleration:` m/s2, `max_turn_acceleration:` rad/s2, none above the profile's; `max_braking:`, `max_turn_braking:` up to 10 | the profile's; braking twice the acceleration |
  | `:bumpers` | `style:` `:bit` or `:address`, `base:` 0 to 255, `count:` 0 to 64, `segments:` list of 0 to 15 | `:bit`, `0x40`, the profile's, see `Hal.RFlex.Sensors.Bumpers` |
  | `:sonar_banks` | how many sonars are fitted on each board, 0 to 16 | boards of 8 |
  | `:sonar_stride` | ids per board, 1 to 16 | `16` |
  | `:sonar_age` | a range is the least of this many readings, 1 to 20 | `1` |
  | `:sonar_times` | `{echo, ping, set}`, microseconds | `{30_000, 1250, 0}`; ping is 0 for an ATRV mini |
  | `:ir_banks`, `:ir_base_bank` | infrareds on each board, 0 to 8; the first board | boards of 8; `0` |
  | `:ir_order` | for each pose of the profile, its place in the reports | a Magellan's; otherwise as they come |
  | `:ir_law`, `:ir_min` | `:metres` or `:millimetres`; metres | `:metres`; `0.1` |
  | `:power_offset` | volts by which the controller reads too low | `0.0` |
  | `:joystick` | whether a person may drive by the base's own joystick | `false`: it is not polled |
  | `:joystick_ratios` | `{m/s, rad/s}` a count of its two axes, -1.0 to 1.0 | `{0.006, -0.01}`, those of the thesis's ATRV mini |
  | `:home` | address of the heading switch | `nil`: none |
  | `:report_period` | between reports of wheels and bumpers, microseconds | `100_000` |
  | `:pace_ms` | between two commands, 1 to 50 | `12` |
  | `:clock` | `{m, f, a}` that returns integer milliseconds | monotonic time |

  ## Driving

  Every speed passes `Hal.Drive.SlewLimiter`, the last step before the wire, every 50 ms. It is
  repeated every 100 ms, zero too, because a frame may be lost, and because the controller stops
  by itself when it hears nothing for some time (how long is not known). A stop is not ramped: it
  is the next command on the wire, and the controller brakes with `max_braking`. A value that is
  not a speed (`Hal.Drive.SlewLimiter.check/1`) counts as a stop, and is counted. `Hal.Device`
  sees to it that speeds are renewed.

  The brake is released before the first speed, and again when the controller reports that it is
  set; `init` sets it. A driver that was held up until the line sent its last words loses the line (`Hal.Serial`), and
  starts again in the same way: from rest, with the brake set.

  Without `distance` or `angle` there is no odometry, and every speed becomes a stop.

  The line's last words stop both axes and set the brake, twice (`Hal.RFlex.Commands`).

  ## Readings

  They are those of `Hal.Drive`. Ranges come with each sonar report, once every sonar was heard.
  The base reports only changes of bumpers, so their state is repeated every 100 ms while the base
  reports anything. The joystick, polled ten times a second, is a reading, too: this driver does not drive by it, and the
  robot's comms takes it for the word of a person (`Swarm.Comms.Joystick`).

  Odometry continues where it was when a lost line is opened again in the same process; a new
  process starts at zero, in a new frame (`Hal.Odometry`). When a counter jumps
  (`Hal.RFlex.Sensors.Odometry`), the pose stays where it is and continues in a new frame, because
  the way that the robot went meanwhile is unknown.

  A controller that sends no wheel report for 0.5 s is set up again, every second, because it may
  have been switched off and on; one that sends no packet at all for 2 s is the error `:silent`.
  """
  @behaviour Hal.Drive
  alias Hal.{Serial, SerialBase, Twist}
  alias Hal.RFlex.{Commands, Counters, Options, OptionCheck, Readings, Receiver, Schedule, Speeds}
  alias Hal.RFlex.Protocol.{Command, Decoder, Queue}

  @tick_ms 50
  @repeat_ms 100
  @status_ms 500
  @no_wheels_ms 500
  @again_ms 1_000
  @silent_ms 2_000
  # The echoes in a report: our assumption, because no source gives their number.
  @reported 4

  @enforce_keys [:options, :line, :ref, :queue, :ramp, :senses, :heard_ms, :bytes_ms, :stepped_ms]
  defstruct @enforce_keys ++
              [
                decoder: Decoder.new(),
                wanted: Twist.zero(),
                said: nil,
                due: %{},
                pump: nil,
                released?: false,
                refused: 0,
                overruns: 0,
                told: %{}
              ]

  @type t :: %__MODULE__{}

  @doc "Checks the options; the error is one line that says what is wrong."
  @spec options(keyword()) :: {:ok, Options.t()} | {:error, String.t()}
  def options(options), do: Options.new(options)

  @impl Hal.Drive
  defdelegate option_table, to: Options, as: :table

  @doc """
  Opens the line, and queues the set-up, a stop of the wheels and the brake. Wrong options raise
  `ArgumentError`.
  """
  @impl Hal.Drive
  def init(options) do
    options =
      case Options.new(options) do
        {:ok, options} -> options
        {:error, line} -> raise ArgumentError, line
      end

    serial = SerialBase.Options.line(options) ++ [last_words: Commands.last_words(options)]
    with {:ok, line} <- Serial.open(serial), do: {:ok, start(options, line)}
  end

  @doc "Whether the drive may be armed; the error names the missing conversions."
  @impl Hal.Drive
  def ready(%__MODULE__{options: options}),
    do: OptionCheck.ready(options)

  @doc "What the options alone say; `Hal.RFlex.OptionCheck` judges both this and `ready/1`."
  @impl Hal.Drive
  def judge(given) do
    with {:ok, options} <- Options.new(given) do
      senses = Commands.senses(options)
      odd = OptionCheck.odd(options, given)
      {:ok, %{ready: OptionCheck.ready(options), senses: senses, odd: odd}}
    end
  end

  @doc """
  Its sonars fire one after the other (`:sonar_times`); a report is assumed to hold four echoes.

      iex> Hal.RFlex.Driver.sonar_round_s(port: "/dev/ttyR0")
      0.59375
  """
  @impl Hal.Drive
  def sonar_round_s(given) do
    with {:ok, %{sonar_banks: banks, sonar_times: {echo_us, ping_us, set_us}}} <-
           Options.new(given) do
      ((Enum.sum(banks) + @reported - 1) * (echo_us + ping_us) + set_us) / 1.0e6
    else
      # A driver with such options does not start.
      {:error, _line} -> 0.0
    end
  end

  @doc """
  Describes an error in words.

      iex> Hal.RFlex.Driver.explain(:silent, port: "/dev/ttyR0", speed: 9600)
      "/dev/ttyR0: the base does not report its wheels (is it on, its cable right, its speed 9600 baud?)"
  """
  @impl Hal.Drive
  def explain(:silent, options) do
    "#{SerialBase.Options.line_name(options)}: the base does not report its wheels (is it on, its cable right, its speed " <>
      "#{options[:speed] || 115_200} baud?)"
  end

  def explain(reason, options), do: Serial.explain(reason, SerialBase.Options.line_name(options))

  @impl Hal.Drive
  def drive(twist, s) do
    at_ms = now(s)
    s |> Speeds.want(twist) |> Speeds.say(at_ms) |> pump(at_ms)
  end

  @impl Hal.Drive
  def handle_message({__MODULE__, ref, :tick}, %{ref: ref} = s), do: tick(s, now(s))

  def handle_message({__MODULE__, ref, :pump}, %{ref: ref} = s) do
    with {:ok, s} <- pump(%{s | pump: nil}, now(s)), do: {:ok, [], s}
  end

  def handle_message(message, s) do
    case Serial.handle(s.line, message) do
      {:data, bytes} -> hear(Receiver.bytes(s, bytes, now(s)))
      {:error, reason} -> {:error, reason, s}
      :unknown -> {:ok, [], s}
    end
  end

  @impl Hal.Drive
  def terminate(s) do
    # Kept for the device's next opening: odometry that starts again at zero would be a jump.
    Process.put(
      {__MODULE__, SerialBase.Options.line_name(s.options)},
      {s.senses.odometry, s.senses.frame}
    )

    Serial.last_words(s.line, Commands.farewell(s.options))
    Serial.close(s.line)
  end

  @doc """
  What went wrong on the line since it was opened: bytes `skipped`, beginnings of frames
  `given_up`, frames with `ghosts`, packets `unknown` or `malformed`, wheel reports `dropped`,
  counter `jumps`, speeds `refused`, …
  """
  @spec counts(t()) :: %{atom() => non_neg_integer()}
  defdelegate counts(driver), to: Counters

  defp start(options, line) do
    {m, f, a} = options.clock
    at_ms = apply(m, f, a)
    ref = make_ref()
    Process.send_after(self(), {__MODULE__, ref, :tick}, 0)

    # A new process does not know of earlier movement: what it counts from now on is in a frame of
    # its own.
    {before, frame} =
      Process.delete({__MODULE__, SerialBase.Options.line_name(options)}) || {nil, make_ref()}

    queue = Enum.reduce(Commands.first_words(options), Queue.new(options.pace_ms), &put/2)
    queue = Queue.stop(put({:brake, Command.brake()}, queue), Commands.stop(options))

    %__MODULE__{
      options: options,
      line: line,
      ref: ref,
      queue: queue,
      ramp: options.limits,
      senses: Readings.new(options, before, frame),
      heard_ms: at_ms,
      bytes_ms: at_ms,
      stepped_ms: at_ms,
      due: %{
        speed: at_ms + Speeds.repeat_ms(),
        setup: at_ms + @again_ms,
        tell: at_ms + Counters.tell_ms()
      }
    }
  end

  defp put({key, bytes}, queue), do: Queue.put(queue, key, bytes)

  defp tick(s, at_ms) do
    Process.send_after(self(), {__MODULE__, s.ref, :tick}, @tick_ms)
    {readings, s} = Receiver.idle(s, at_ms)
    s = s |> Speeds.say(at_ms) |> ask(at_ms) |> set_up(at_ms) |> Counters.tell(at_ms)
    {standing, s} = standing(s, at_ms)

    # A driver that was silent itself does not say so of its base.
    with :ok <- keep_alive(s),
         :ok <- alive(s, at_ms),
         {:ok, s} <- pump(s, at_ms),
         do: {:ok, readings ++ standing, s}
  end

  defp ask(s, at_ms) do
    s =
      if Schedule.due?(s, :status, at_ms),
        do: put_again(s, :status, Command.status(), at_ms, @status_ms),
        else: s

    if s.options.joystick and Schedule.due?(s, :joystick, at_ms),
      do: put_again(s, :joystick, Command.joystick(), at_ms, @repeat_ms),
      else: s
  end

  defp set_up(s, at_ms) do
    wheels? = s.senses.motor_ms != nil and at_ms - s.senses.motor_ms < @no_wheels_ms

    if not wheels? and Schedule.due?(s, :setup, at_ms) do
      queue = Enum.reduce(Commands.first_words(s.options), s.queue, &put/2)
      Schedule.again(%{s | queue: queue}, :setup, at_ms, @again_ms)
    else
      s
    end
  end

  defp standing(s, at_ms) do
    if at_ms - s.heard_ms < @no_wheels_ms and Schedule.due?(s, :standing, at_ms),
      do: {Readings.standing(s.senses), Schedule.again(s, :standing, at_ms, @repeat_ms)},
      else: {[], s}
  end

  defp alive(s, at_ms),
    do: if(at_ms - s.heard_ms >= @silent_ms, do: {:error, :silent, s}, else: :ok)

  defp keep_alive(s) do
    case Serial.keep_alive(s.line) do
      :ok -> :ok
      {:error, reason} -> lost(s, reason)
    end
  end

  # The line is behind, but has not lost anything.
  defp lost(_s, :overrun), do: :ok
  defp lost(s, reason), do: {:error, reason, s}

  defp hear({readings, s}), do: {:ok, readings, s}

  defp pump(s, at_ms) do
    case Queue.take(s.queue, at_ms) do
      :empty -> {:ok, s}
      {:wait, ms} -> {:ok, wait(s, ms)}
      {:send, bytes, queue} -> write(%{s | queue: queue}, bytes, at_ms)
    end
  end

  defp write(s, bytes, at_ms) do
    case Serial.write(s.line, bytes) do
      :ok -> s |> written() |> pump(at_ms)
      {:error, :overrun} -> pump(%{s | overruns: s.overruns + 1}, at_ms)
      {:error, reason} -> {:error, reason, s}
    end
  end

  defp written(s), do: %{s | queue: Queue.written(s.queue, now(s))}

  defp wait(%{pump: nil} = s, ms),
    do: %{s | pump: Process.send_after(self(), {__MODULE__, s.ref, :pump}, ms)}

  defp wait(s, _ms), do: s

  defp put_again(s, key, bytes, at_ms, ms),
    do: Schedule.again(%{s | queue: Queue.put(s.queue, key, bytes)}, key, at_ms, ms)

  defp now(%{options: %{clock: {m, f, a}}}), do: apply(m, f, a)
end
