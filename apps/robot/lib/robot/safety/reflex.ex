defmodule Robot.Safety.Reflex do
  @moduledoc """
  Applies the safety limits between a wish and the drive's device, as a function. It limits the wish that the arbiter chose,
  so no behaviour and no mission comes after it; arming (`Hal.Device.Arming`) and the driver (`Hal.Drive.SlewLimiter`) do.
  Pure: `wish/3` and `sense/3` take what happened; `step/2` (every 50 ms) decides what the wheels may do now, and reports
  why it is less than wished. For a reading that must not wait for the next step `sense/3` returns `:now`; so does
  `forget/1` while the robot moves.

  The limits, each by its name in `limits`, in the order in which they are applied; each of the first five excludes all
  others, and `:blind` is in the place of `:near` and `:beside`:

  | limit | what it does |
  |---|---|
  | `:estop` | latched: stands until `reset/1`; earlier wishes are forgotten |
  | `:disarmed` | the drive is not armed: stands (`Hal.Device.Arming`) |
  | `:dead_man` | no wish for 200 ms: stands |
  | `:refused` | the wish was not a pair of numbers, or was absurdly large: stands |
  | `:absent` | no person has been heard for as long as the robot's file allows (`presence:`), and the wish is not to stand: stands |
  | `:speed` | the profile's greatest speeds |
  | `:blind` | no sonar reading for 500 ms, although it has sonars: at most 0.1 m/s, also for the corners of a robot longer than wide that turns; no scan, although it has a lidar: the same, and after 2 s, and before the first one, it stands |
  | `:near` | slow enough to stop 0.15 m before what sonars and lidar see in the direction of motion |
  | `:beside` | slowly past what they see less than 0.15 m beside its way |
  | `:corner` | a robot longer than wide does not turn a corner into what they see |
  | `:fence` | stops before its fence (`Robot.Fence`); no driving without a place |
  | `:acceleration` | the profile's accelerations; braking may be twice as hard |
  | `:bumper` | no driving toward a touched side; driving away and turning are allowed |

  `:estop`, `:disarmed`, `:dead_man`, `:refused`, `:absent` and `:bumper` set the speed to zero immediately:
  how hard the wheels then brake depends on the base. All other limits pass through the ramp of
  `:acceleration`.

  A reading of the bumpers holds until the next one: bases report changes, and a base that falls
  silent is stopped by its device (`Hal.Device.Reports`).
  """
  alias Hal.{Odometry, Pose, Profile, Scan, Twist}
  alias Robot.Departure
  alias Robot.Fence
  alias Robot.Safety.Reflex.{Body, Limits}

  @dead_man_ms 200
  # No base drives or turns this fast: a wish with such a number is an error.
  @absurd 100.0
  # No sonar and no pose reaches so far (m).
  @far 1.0e9
  # These set a speed to zero without a ramp.
  @stops [:estop, :disarmed, :dead_man, :refused, :absent, :bumper]

  @enforce_keys [:profile]
  defstruct @enforce_keys ++
              [
                wish: nil,
                wish_at_ms: nil,
                sonar: [],
                sonar_at_ms: nil,
                scan: [],
                scan_at_ms: nil,
                bumpers: [],
                latched?: false,
                armed?: true,
                fence: nil,
                start: nil,
                frame: nil,
                place: nil,
                presence_ms: nil,
                present_ms: nil,
                twist: %Twist{linear: 0.0, turn: 0.0},
                at_ms: nil,
                before: {%Twist{linear: 0.0, turn: 0.0}, nil}
              ]

  @type t :: %__MODULE__{
          profile: Profile.t(),
          wish: {float(), float()} | :refused | nil,
          wish_at_ms: integer() | nil,
          sonar: [Body.point()],
          sonar_at_ms: integer() | nil,
          scan: [Body.point()],
          scan_at_ms: integer() | nil,
          bumpers: [0..15],
          latched?: boolean(),
          armed?: boolean(),
          fence: Fence.t() | nil,
          start: Pose.t() | nil,
          frame: fence_frame(),
          place: {Pose.t(), integer()} | nil,
          presence_ms: pos_integer() | nil,
          present_ms: integer() | nil,
          twist: Twist.t(),
          at_ms: integer() | nil,
          before: {Twist.t(), integer() | nil}
        }

  @typedoc "The odometry frame of the fence; `:was` that in which the robot left its start pose, until odometry comes."
  @type fence_frame :: {:is, reference() | nil} | {:was, Departure.frame()} | nil

  @typedoc "Whether the next `step/2` is due now, or with the next period."
  @type urgency :: :now | :later

  @type limit ::
          :estop
          | :disarmed
          | :dead_man
          | :refused
          | :absent
          | :speed
          | :bumper
          | :near
          | :beside
          | :corner
          | :fence
          | :blind
          | :acceleration

  @doc """
  The state of a robot that stands. Options: `latched?` (default false), for a latch that survived
  a restart; `armed?` (default true), until a reading `{:arming, …}` says otherwise; `fence`
  (`Robot.Fence`, default none), with `start`, the pose at which the odometry reads
  zero (default the origin), and `frame`, the result of `frame/1` before a restart; `presence`, for how many seconds after a
  person was heard (`present/2`) the robot may move (default `nil`: always), and `present_ms`, when one was heard last.

  A fence uses odometry of one frame only, the first (`Hal.Odometry`). In another frame, zero is
  no longer the start but wherever the robot was when that frame began: its place is unknown, and
  the robot does not drive until it is started again at its start.
  """
  @spec new(Profile.t(), keyword()) :: t()
  def new(%Profile{} = profile, options \\ []) do
    options =
      Keyword.validate!(options,
        latched?: false,
        armed?: true,
        fence: nil,
        start: Pose.new(0, 0),
        frame: nil,
        presence: nil,
        present_ms: nil
      )

    %__MODULE__{
      profile: profile,
      latched?: options[:latched?] == true,
      armed?: options[:armed?] == true,
      fence: options[:fence],
      start: options[:start],
      frame: options[:frame],
      presence_ms: options[:presence] && round(options[:presence] * 1_000),
      present_ms: options[:present_ms]
    }
  end

  @doc "The odometry frame of the fence; `nil` before the first reading, and without a fence."
  @spec frame(t()) :: fence_frame()
  def frame(%__MODULE__{frame: frame}), do: frame

  @doc "Whether the e-stop is latched."
  @spec latched?(t()) :: boolean()
  def latched?(%__MODULE__{latched?: latched?}), do: latched?

  @doc "Takes a wish, any term; one without sensible numbers counts as a wish to stop."
  @spec wish(t(), Twist.t() | term(), integer()) :: t()
  def wish(%__MODULE__{latched?: true} = reflex, _twist, _at_ms), do: reflex

  def wish(%__MODULE__{} = reflex, %{linear: linear, turn: turn}, at_ms) do
    wish = if sane?(linear) and sane?(turn), do: {linear * 1.0, turn * 1.0}, else: :refused
    %{reflex | wish: wish, wish_at_ms: at_ms}
  end

  def wish(%__MODULE__{} = reflex, _other, at_ms),
    do: %{reflex | wish: :refused, wish_at_ms: at_ms}

  defp sane?(number), do: is_number(number) and number > -@absurd and number < @absurd

  @doc "A person was heard then, who looks after the robot."
  @spec present(t(), integer()) :: t()
  def present(%__MODULE__{present_ms: before} = reflex, at_ms),
    do: %{reflex | present_ms: max(before || at_ms, at_ms)}

  @doc """
  Drops the wish, because the process behind it is gone or a stop was ordered. A robot that moves
  stops `:now`, without a ramp.
  """
  @spec forget(t()) :: {t(), urgency()}
  def forget(%__MODULE__{} = reflex),
    do: {%{reflex | wish: nil, wish_at_ms: nil}, if(moving?(reflex), do: :now, else: :later)}

  @doc "The limits that set the speed to zero without a ramp."
  @spec stops() :: [limit(), ...]
  def stops, do: @stops

  @doc """
  Takes a reading; readings that no limit needs are ignored. While the robot moves, a touched
  bumper, a sonar reading, a scan and a reading of arming ask for a step `:now`. A reading that is not
  whole counts as none: the last whole one grows old.
  """
  @spec sense(t(), Hal.Drive.reading() | term(), integer()) :: {t(), urgency()}
  def sense(%__MODULE__{} = reflex, reading, at_ms) do
    if whole?(reading) do
      urgency = if moving?(reflex) and urgent?(reading), do: :now, else: :later
      {note(reflex, reading, at_ms), urgency}
    else
      {reflex, :later}
    end
  end

  defp whole?({:sonar, ranges}), do: list?(ranges, &finite?/1)
  defp whole?({:scan, scan}), do: Scan.whole?(scan)
  defp whole?({:bumpers, pressed}), do: list?(pressed, &is_integer/1)

  defp whole?({:odometry, %Odometry{pose: %Pose{x: x, y: y, heading: heading}}}),
    do: finite?(x) and finite?(y) and finite?(heading)

  defp whole?({:odometry, _other}), do: false
  defp whole?(_reading), do: true

  # With which one can calculate: there are integers too large for it.
  defp finite?(number), do: is_number(number) and number > -@far and number < @far

  # Not `Enum.all?/2`, which raises for an improper list.
  defp list?([first | rest], fits?), do: fits?.(first) and list?(rest, fits?)
  defp list?(rest, _fits?), do: rest == []

  defp moving?(reflex), do: not Twist.zero?(reflex.twist)

  defp urgent?({:arming, _state}), do: true
  defp urgent?({:bumpers, [_ | _]}), do: true
  defp urgent?({:sonar, _ranges}), do: true
  defp urgent?({:scan, _scan}), do: true
  defp urgent?(_reading), do: false

  defp note(reflex, {:sonar, ranges}, at_ms),
    do: %{reflex | sonar: Body.points(reflex.profile, ranges), sonar_at_ms: at_ms}

  # A lidar that the body does not have is nowhere.
  defp note(%{profile: %{scan: nil}} = reflex, {:scan, _scan}, _at_ms), do: reflex

  defp note(reflex, {:scan, scan}, at_ms),
    do: %{reflex | scan: Body.scanned(reflex.profile, scan), scan_at_ms: at_ms}

  defp note(reflex, {:bumpers, pressed}, _at_ms), do: %{reflex | bumpers: pressed}

  defp note(%{fence: %Fence{}} = reflex, {:odometry, %Odometry{} = odometry}, at_ms) do
    if fences?(reflex.frame, odometry.frame) do
      place = {Pose.compose(reflex.start, odometry.pose), at_ms}
      %{reflex | frame: {:is, odometry.frame}, place: place}
    else
      %{reflex | place: nil}
    end
  end

  # A wish from before a change of arming is dropped.
  defp note(%{armed?: before?} = reflex, {:arming, %{state: state}}, _at_ms) do
    case state == :armed do
      ^before? -> reflex
      armed? -> %{reflex | armed?: armed?, wish: nil, wish_at_ms: nil}
    end
  end

  defp note(reflex, _reading, _at_ms), do: reflex

  defp fences?(nil, _frame), do: true
  defp fences?({:is, frame}, odometry), do: frame == odometry
  defp fences?({:was, noted}, frame), do: Departure.start?(noted, frame)

  @doc "Latches the emergency stop and drops the wish."
  @spec estop(t()) :: t()
  def estop(%__MODULE__{} = reflex),
    do: %{reflex | latched?: true, wish: nil, wish_at_ms: nil}

  @doc "Releases the latch. The robot still stands until a new wish comes."
  @spec reset(t()) :: t()
  def reset(%__MODULE__{} = reflex), do: %{reflex | latched?: false}

  @doc """
  The speeds of the wheels from now until the next step, and the limits that reduced them.

  If there are several steps at the same time, the last one counts: the speed of the one before
  was never in force, so the ramp does not start from it. After a stop, however, it starts from
  zero, even within the same millisecond.
  """
  @spec step(t(), integer()) :: {Twist.t(), [limit()], t()}
  def step(%__MODULE__{at_ms: at_ms, before: {twist, then_ms}} = reflex, at_ms),
    do: decide(%{reflex | twist: twist, at_ms: then_ms}, at_ms)

  def step(%__MODULE__{} = reflex, at_ms), do: decide(reflex, at_ms)

  defp decide(reflex, at_ms) do
    {twist, limits} =
      case wanted(reflex, at_ms) do
        {:stop, limit} -> {Twist.zero(), [limit]}
        {linear, turn} -> Limits.limit(reflex, linear, turn, at_ms)
      end

    stopped? = Enum.any?(limits, &(&1 in @stops))
    before = if stopped?, do: {twist, at_ms}, else: {reflex.twist, reflex.at_ms}
    {twist, limits, %{reflex | twist: twist, at_ms: at_ms, before: before}}
  end

  defp wanted(%{latched?: true}, _at_ms), do: {:stop, :estop}
  defp wanted(%{armed?: false}, _at_ms), do: {:stop, :disarmed}
  defp wanted(%{wish: nil}, _at_ms), do: {:stop, :dead_man}

  defp wanted(%{wish_at_ms: wish_at_ms}, at_ms) when at_ms - wish_at_ms > @dead_man_ms,
    do: {:stop, :dead_man}

  defp wanted(%{wish: :refused}, _at_ms), do: {:stop, :refused}

  defp wanted(%{wish: wish} = reflex, at_ms) do
    if wish != {0.0, 0.0} and absent?(reflex, at_ms), do: {:stop, :absent}, else: wish
  end

  defp absent?(%{presence_ms: nil}, _at_ms), do: false
  defp absent?(%{present_ms: nil}, _at_ms), do: true

  defp absent?(%{presence_ms: most_ms, present_ms: heard_ms}, at_ms),
    do: at_ms - heard_ms > most_ms
end
