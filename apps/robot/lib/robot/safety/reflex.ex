defmodule Robot.Safety.Reflex do
  @moduledoc """
  The gate before the wheels as a function: whatever is wished, what comes out is safe. It is no
  part of the market of wishes; it limits whoever won there. Pure: `wish/3` and `sense/3` tell it
  what happened, `step/2` (every 50 ms) says what the wheels may do now, and why it is less than wished.
  A reading that must not wait for the next step makes `sense/3` say `:now`; so does `forget/1`.

  In this order, each with its name in `limits`:

  | limit | what it does |
  |---|---|
  | `:estop` | latched: stands until `reset/1`; wishes from before are forgotten |
  | `:disarmed` | the drive is not armed: stands (`Hal.Device.Arming`) |
  | `:dead_man` | no wish for 200 ms: stands |
  | `:refused` | the wish was no number, or absurdly large: stands |
  | `:speed` | the profile's greatest speeds |
  | `:bumper` | no driving toward a touched side; away and turning are free |
  | `:near` | slow enough to stop 0.15 m before what the sonars see in the direction of motion |
  | `:corner` | a robot longer than wide turns its corners into nothing |
  | `:fence` | stops before the line of its fence (`Robot.Safety.Reflex.Fence`); not knowing where it is, it stands |
  | `:blind` | no sonar reading for 500 ms, though it has sonars: at most 0.1 m/s |
  | `:acceleration` | the profile's accelerations; braking before a near thing may be twice as hard |

  `:estop`, `:disarmed`, `:dead_man`, `:refused` and `:bumper` set the speed to zero at once: how hard the wheels
  then brake is the base's own affair. Everything else is continuous.
  """
  alias Hal.{Odometry, Pose, Profile, Twist}
  alias Robot.Safety.Reflex.{Body, Fence, Limits}

  @dead_man_ms 200
  # No base drives or turns this fast: such a number is a fault of the one who wished.
  @absurd 100.0
  # These set a speed to zero at once.
  @stops [:estop, :disarmed, :dead_man, :refused, :bumper]

  @enforce_keys [:profile]
  defstruct @enforce_keys ++
              [
                wish: nil,
                wish_at_ms: nil,
                sonar: [],
                sonar_at_ms: nil,
                bumpers: [],
                latched?: false,
                armed?: true,
                fence: nil,
                start: nil,
                frame: nil,
                place: nil,
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
          bumpers: [0..15],
          latched?: boolean(),
          armed?: boolean(),
          fence: Fence.t() | nil,
          start: Pose.t() | nil,
          frame: {:is, reference() | nil} | nil,
          place: {Pose.t(), integer()} | nil,
          twist: Twist.t(),
          at_ms: integer() | nil,
          before: {Twist.t(), integer() | nil}
        }

  @typedoc "Whether the next `step/2` is due at once, or with the next period."
  @type urgency :: :now | :later

  @type limit ::
          :estop
          | :disarmed
          | :dead_man
          | :refused
          | :speed
          | :bumper
          | :near
          | :corner
          | :fence
          | :blind
          | :acceleration

  @doc """
  A gate that stands. Options: `latched?` (default false), for a latch that survived a restart;
  `armed?` (default true), until a reading `{:arming, …}` says otherwise; `fence` (`Robot.Safety.Reflex.Fence`,
  default none), with `start`, the pose at which the odometry says zero (default the origin), and `frame`, what
  `frame/1` said of the gate before it.

  A fence believes odometry of one frame only, the first (`Hal.Odometry`). In another one zero is not the
  start any more but wherever the robot was: that place is not known, and the robot stands until it is started
  again at its start.
  """
  @spec new(Profile.t(), keyword()) :: t()
  def new(%Profile{} = profile, options \\ []) do
    options =
      Keyword.validate!(options,
        latched?: false,
        armed?: true,
        fence: nil,
        start: Pose.new(0, 0),
        frame: nil
      )

    %__MODULE__{
      profile: profile,
      latched?: options[:latched?] == true,
      armed?: options[:armed?] == true,
      fence: options[:fence],
      start: options[:start],
      frame: options[:frame]
    }
  end

  @doc "The frame of odometry that the fence is laid in; `nil` before the first reading, and without a fence."
  @spec frame(t()) :: {:is, reference() | nil} | nil
  def frame(%__MODULE__{frame: frame}), do: frame

  @doc "Takes a wish. Anything at all may come: what is not a sensible number counts as a wish to stop."
  @spec wish(t(), Twist.t() | term(), integer()) :: t()
  def wish(%__MODULE__{latched?: true} = reflex, _twist, _at_ms), do: reflex

  def wish(%__MODULE__{} = reflex, %{linear: linear, turn: turn}, at_ms) do
    wish = if sane?(linear) and sane?(turn), do: {linear * 1.0, turn * 1.0}, else: :refused
    %{reflex | wish: wish, wish_at_ms: at_ms}
  end

  def wish(%__MODULE__{} = reflex, _other, at_ms),
    do: %{reflex | wish: :refused, wish_at_ms: at_ms}

  defp sane?(number), do: is_number(number) and number > -@absurd and number < @absurd

  @doc """
  Drops the wish: its author is gone, or a stop was ordered. A robot that moves stops `:now`, without a ramp.
  """
  @spec forget(t()) :: {t(), urgency()}
  def forget(%__MODULE__{} = reflex),
    do: {%{reflex | wish: nil, wish_at_ms: nil}, if(moving?(reflex), do: :now, else: :later)}

  @doc """
  Takes a reading; those that no limit needs are ignored. While the robot moves, a touched bumper, whatever a
  sonar sees and a change of arming ask for a step `:now`.
  """
  @spec sense(t(), Hal.Drive.reading() | term(), integer()) :: {t(), urgency()}
  def sense(%__MODULE__{} = reflex, reading, at_ms) do
    urgency = if moving?(reflex) and urgent?(reading), do: :now, else: :later
    {note(reflex, reading, at_ms), urgency}
  end

  defp moving?(reflex), do: not Twist.zero?(reflex.twist)

  defp urgent?({:arming, _state}), do: true
  defp urgent?({:bumpers, [_ | _]}), do: true
  defp urgent?({:sonar, _ranges}), do: true
  defp urgent?(_reading), do: false

  defp note(reflex, {:sonar, ranges}, at_ms) when is_list(ranges),
    do: %{reflex | sonar: Body.points(reflex.profile, ranges), sonar_at_ms: at_ms}

  defp note(reflex, {:bumpers, pressed}, _at_ms) when is_list(pressed),
    do: %{reflex | bumpers: pressed}

  defp note(%{fence: %Fence{}} = reflex, {:odometry, %Odometry{} = odometry}, at_ms) do
    case reflex.frame || {:is, odometry.frame} do
      {:is, frame} when frame == odometry.frame ->
        place = {Pose.compose(reflex.start, odometry.pose), at_ms}
        %{reflex | frame: {:is, frame}, place: place}

      _another ->
        %{reflex | place: nil}
    end
  end

  # What was wished before it was armed, or disarmed, counts no more.
  defp note(%{armed?: before?} = reflex, {:arming, %{state: state}}, _at_ms) do
    case state == :armed do
      ^before? -> reflex
      armed? -> %{reflex | armed?: armed?, wish: nil, wish_at_ms: nil}
    end
  end

  defp note(reflex, _reading, _at_ms), do: reflex

  @doc "Latches the emergency stop."
  @spec estop(t()) :: t()
  def estop(%__MODULE__{} = reflex),
    do: %{reflex | latched?: true, wish: nil, wish_at_ms: nil}

  @doc "Releases the latch. The robot still stands until a new wish comes."
  @spec reset(t()) :: t()
  def reset(%__MODULE__{} = reflex), do: %{reflex | latched?: false}

  @doc """
  What the wheels may do from now until the next step, and which limits made it less than wished.

  Of several steps at one time the last counts: the speed of the one before was in force for no time, so
  that nothing is ramped from it. Only a stop holds for the rest of that millisecond.
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
  defp wanted(%{wish: wish}, _at_ms), do: wish
end
