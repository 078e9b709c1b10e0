defmodule Hal.RFlex.Sensors.Odometry do
  @moduledoc """
  Computes pose and speed from the controller's two counters: distance driven (axis 0) and angle
  turned (axis 1). Pure; the time of arrival is passed in, as integer milliseconds.

  The two counters come in separate frames. A pose is computed from two reports of one period: at
  axis 1 if there is a new report of axis 0, or at axis 0 if the last report of axis 1 has the
  same timestamp. If one is lost, the next pair bridges the gap, because the counters go on: only
  the shape of that piece of the path is lost. Each step is taken at the heading halfway through
  its turn.

  ## Implausible reports

  A counter has 32 bits, and wraps. A report that cannot be a movement is **dropped** and counted:

    * a step longer than 1.5 times what the speed limit allows in the time since the last report
      and 0.3 s more (for reports that were held up and come together; no more than 2 s count)
    * a speed of more than 4 times the limit
    * a counter that is suddenly near zero while its timestamp goes back or, where timestamps
      stand still, after a silence of 0.25 s: a controller that was switched off and on

  When the next report continues a dropped one, the counter has really jumped: it is followed from
  there on, the pose stays where it is, and `jumps` counts it. How far the robot went meanwhile is
  unknown.

  A checksum lets through 1 in 256 heavily damaged frames, and every frame that lost one zero byte
  and has another one twice; the number in it may be within the limits. If the next report does
  not continue the last one, but does continue the one before, the last one was wrong. The next
  report thus corrects it: no distance is lost, only the direction of the wrong pieces.
  """
  import Hal.RFlex, only: [difference: 2]
  alias Hal.{Pose, Twist}
  alias Hal.Drive.Wheels

  @margin 1.5
  @held_up_s 0.3
  @longest_s 2.0
  @speed_margin 4
  @gap_ms 250
  # A counter that started again is within this many seconds at the limit.
  @young_s 0.5
  @still_s 0.05

  @enforce_keys [:distance, :angle, :axes]
  defstruct @enforce_keys ++ [wheels: {1.0, 1.0}, pose: Pose.new(0, 0), dropped: 0, jumps: 0]

  @typedoc """
  `dropped` counts reports, `jumps` the jumps of a counter that were followed without moving.
  """
  @type t :: %__MODULE__{
          distance: float(),
          angle: float(),
          axes: map(),
          wheels: {base :: float(), ratio :: float()},
          pose: Pose.t(),
          dropped: non_neg_integer(),
          jumps: non_neg_integer()
        }

  @doc """
  The odometry at the origin. Conversions are in units per metre and radian, limits in m/s and
  rad/s; `wheels` are their base (metres) and ratio (`Hal.Drive.Wheels`).
  """
  @spec new(float(), float(), float(), float(), {float(), float()}) :: t()
  def new(distance, angle, max_linear, max_turn, wheels \\ {1.0, 1.0}) do
    axes = %{0 => axis(max_linear * distance), 1 => axis(max_turn * angle)}
    %__MODULE__{distance: distance, angle: angle, axes: axes, wheels: wheels}
  end

  @doc "Takes a report; a pair of reports gives the odometry."
  @spec report(t(), Hal.RFlex.Protocol.Report.axis(), integer()) ::
          {Hal.Odometry.t() | nil, t()}
  def report(%__MODULE__{axes: axes} = t, %{axis: n} = report, at_ms) when is_map_key(axes, n) do
    seen = {report.position, report.timestamp, at_ms}

    case judge(axes[n], report, seen) do
      :drop -> {nil, %{t | dropped: t.dropped + 1}}
      {:suspect, axis} -> {nil, %{t | dropped: t.dropped + 1, axes: %{axes | n => axis}}}
      {:jump, axis} -> pair(%{t | jumps: t.jumps + 1, axes: %{axes | n => axis}}, n)
      {:ok, axis} -> pair(%{t | axes: %{axes | n => axis}}, n)
    end
  end

  def report(%__MODULE__{} = t, _other_axis, _at_ms), do: {nil, t}

  defp axis(limit),
    do: %{
      limit: limit,
      last: nil,
      before: nil,
      suspect: nil,
      driven: 0,
      velocity: 0,
      fresh?: false
    }

  defp judge(axis, report, {position, _timestamp, _at_ms} = seen) do
    cond do
      abs(report.velocity) > @speed_margin * axis.limit + 1 ->
        :drop

      axis.last == nil ->
        {:ok, follow(axis, report, seen, {nil, 0})}

      continues?(axis, axis.last, seen) ->
        {:ok, follow(axis, report, seen, {axis.last, since(axis.last, position)})}

      # The last report was damaged. What it added is taken back.
      axis.before != nil and continues?(axis, axis.before, seen) ->
        {:ok, follow(axis, report, seen, {axis.before, since(axis.last, position)})}

      axis.suspect != nil and near?(axis, axis.suspect, seen) and not back?(axis.suspect, seen) ->
        {:jump, follow(axis, report, seen, {axis.suspect, since(axis.suspect, position)})}

      true ->
        {:suspect, %{axis | suspect: seen}}
    end
  end

  defp follow(axis, report, seen, {before, driven}) do
    %{
      axis
      | last: seen,
        before: before,
        suspect: nil,
        driven: axis.driven + driven,
        velocity: report.velocity,
        fresh?: true
    }
  end

  defp since({before, _timestamp, _at_ms}, position), do: difference(position, before)

  defp continues?(axis, from, seen),
    do: near?(axis, from, seen) and not restarted?(axis, from, seen)

  defp near?(axis, {before, _, before_ms}, {position, _, at_ms}) do
    seconds = min(max(at_ms - before_ms, 0) / 1000, @longest_s) + @held_up_s
    abs(difference(position, before)) <= @margin * axis.limit * seconds + 1
  end

  defp restarted?(axis, {before, timestamp, before_ms} = from, {position, now, at_ms} = seen) do
    young? = abs(position) <= axis.limit * @young_s
    moved? = abs(difference(position, before)) > axis.limit * @still_s
    silent? = now == timestamp and at_ms - before_ms >= @gap_ms
    young? and moved? and (silent? or back?(from, seen))
  end

  defp back?({_, before, _}, {_, now, _}), do: difference(now, before) < 0

  defp pair(%{axes: %{0 => move, 1 => turn}} = t, n) do
    together? = move.fresh? and turn.fresh?

    if together? and (n == 1 or same_time?(move.last, turn.last)),
      do: integrate(t, move, turn),
      else: {nil, t}
  end

  # A timestamp of zero means that there is no clock.
  defp same_time?({_, time, _}, {_, time, _}), do: time != 0
  defp same_time?(_one, _other), do: false

  # Siegwart and Nourbakhsh 2004, section 5.2.4: the chord at the middle heading.
  defp integrate(t, move, turn) do
    {distance, angle} = true_step(t, move.driven, turn.driven)
    middle = t.pose.heading + angle / 2

    pose =
      Pose.new(
        t.pose.x + distance * :math.cos(middle),
        t.pose.y + distance * :math.sin(middle),
        t.pose.heading + angle
      )

    axes = %{0 => %{move | driven: 0, fresh?: false}, 1 => %{turn | driven: 0, fresh?: false}}
    {linear, rate} = true_step(t, move.velocity, turn.velocity)
    twist = Twist.new(linear, rate)
    {%Hal.Odometry{pose: pose, twist: twist}, %{t | pose: pose, axes: axes}}
  end

  defp true_step(%{wheels: {base, ratio}} = t, move, turn),
    do: Wheels.correct({move / t.distance, turn / t.angle}, base, ratio)
end
