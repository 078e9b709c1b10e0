defmodule Hal.SerialBase.Odometry do
  @moduledoc """
  Computes pose and speed from the counters of a left and a right wheel, which wrap. Pure; times are whole milliseconds.

  The way is the mean of both wheels, the turn their difference divided by their distance, unless the base measures its
  turn itself; each step is taken at the heading halfway through its turn (Siegwart and Nourbakhsh 2004, section 5.2.4).

  A report that cannot be a movement is dropped and counted: a wheel that has gone further than 1.5 times what its greatest
  speed allows in the time since the last report and 0.3 s more (for reports that were held up and come together). When the
  next report continues a dropped one, when the base says that it has restarted, or when so much time has passed that a
  counter may have wrapped unseen, the counters have **jumped**: they are followed from there on, and the pose stays where it
  is, in a new frame (`Hal.Odometry`), because how far the robot went meanwhile is unknown.
  """
  import Bitwise
  alias Hal.{Pose, Twist}

  @margin 1.5
  @held_up_ms 300
  @clocks_ms 500

  @enforce_keys [:bits, :metres_per_tick, :wheel_base, :max_wheel, :frame]
  defstruct @enforce_keys ++
              [pose: Pose.new(0, 0), last: nil, suspect: nil, dropped: 0, jumps: 0]

  @typedoc "`last` and `suspect` are `{left, right, at_ms}` of the last report, and of one that was dropped."
  @type t :: %__MODULE__{
          bits: 16 | 32,
          metres_per_tick: float(),
          wheel_base: float(),
          max_wheel: float(),
          frame: reference(),
          pose: Pose.t(),
          last: {integer(), integer(), integer()} | nil,
          suspect: {integer(), integer(), integer()} | nil,
          dropped: non_neg_integer(),
          jumps: non_neg_integer()
        }

  @typedoc """
  A report: both counters, when it arrived, how long its base says that it is since its last one (`nil`: as long as by the arrival), the turn
  that the base itself has measured since then (radians, left positive; `nil`: none), and whether it has restarted.
  """
  @type report :: %{
          left: integer(),
          right: integer(),
          at_ms: integer(),
          elapsed_ms: non_neg_integer() | nil,
          turn: float() | nil,
          restarted?: boolean()
        }

  @doc """
  Odometry at the origin of a new frame. `bits` are those of a counter, `wheel_base` is the distance of the wheels (m),
  `max_wheel` the greatest speed of one (m/s).
  """
  @spec new(16 | 32, float(), float(), float()) :: t()
  def new(bits, metres_per_tick, wheel_base, max_wheel) do
    %__MODULE__{
      bits: bits,
      metres_per_tick: metres_per_tick,
      wheel_base: wheel_base,
      max_wheel: max_wheel,
      frame: make_ref()
    }
  end

  @doc "The same place in a new frame, for counters that begin anew."
  @spec anew(t()) :: t()
  def anew(%__MODULE__{} = t), do: %{t | last: nil, suspect: nil, frame: make_ref()}

  @doc """
  Takes a report. The first one only sets the counters; `nil` is one that was dropped.

      iex> odometry = Hal.SerialBase.Odometry.new(16, 0.001, 0.2, 1.0)
      iex> report = %{left: 65_500, right: 65_500, at_ms: 0, elapsed_ms: nil, turn: nil, restarted?: false}
      iex> {%Hal.Odometry{}, odometry} = Hal.SerialBase.Odometry.report(odometry, report)
      iex> {reading, _odometry} = Hal.SerialBase.Odometry.report(odometry, %{report | left: 64, right: 64, at_ms: 1_000})
      iex> {reading.pose, reading.twist}
      {Hal.Pose.new(0.1, 0), Hal.Twist.new(0.1, 0)}
  """
  @spec report(t(), report()) :: {Hal.Odometry.t() | nil, t()}
  def report(%__MODULE__{last: nil} = t, report), do: stand(t, seen(report))

  def report(%__MODULE__{last: {_, _, before_ms}} = t, report) do
    seen = seen(report)

    cond do
      report.restarted? or wrapped?(t, report.at_ms - before_ms) -> jump(t, seen)
      near?(t, t.last, seen) -> step(t, seen, report)
      t.suspect != nil and near?(t, t.suspect, seen) -> jump(t, seen)
      true -> {nil, %{t | suspect: seen, dropped: t.dropped + 1}}
    end
  end

  @doc """
  How long it is since the last report by the base's own clock of so many bits, which counts milliseconds and wraps, and whether the base has
  restarted: its clock went back, or differs from ours by more than half a second. `before` is `{its time, our time}` of the last report.

      iex> Hal.SerialBase.Odometry.elapsed({65_530, 1_000}, 14, 1_020, 16)
      {20, false}
      iex> for time <- [900, 1_060, 1_700], do: elem(Hal.SerialBase.Odometry.elapsed({1_000, 0}, time, 50, 32), 1)
      [true, false, true]
  """
  @spec elapsed({integer(), integer()} | nil, integer(), integer(), 16 | 32) ::
          {non_neg_integer() | nil, restarted? :: boolean()}
  def elapsed(nil, _time, _at_ms, _bits), do: {nil, false}

  def elapsed({before, before_ms}, time, at_ms, bits) do
    gap_ms = at_ms - before_ms
    <<elapsed_ms::size(bits)>> = <<time - before::size(bits)>>
    <<signed_ms::signed-size(bits)>> = <<elapsed_ms::size(bits)>>
    <<off_ms::signed-size(bits)>> = <<elapsed_ms - gap_ms::size(bits)>>
    back? = signed_ms < 0 and gap_ms < 1 <<< (bits - 1)
    {elapsed_ms, back? or abs(off_ms) > @clocks_ms}
  end

  defp seen(%{left: left, right: right, at_ms: at_ms}), do: {left, right, at_ms}

  # Half of all counts, at the greatest speed.
  defp wrapped?(t, gap_ms),
    do: gap_ms * t.max_wheel > 1_000 * (1 <<< (t.bits - 1)) * t.metres_per_tick

  defp near?(t, {left, right, before_ms}, {new_left, new_right, at_ms}) do
    most = @margin * t.max_wheel * (max(at_ms - before_ms, 0) + @held_up_ms) / 1_000
    abs(way(t, left, new_left)) <= most and abs(way(t, right, new_right)) <= most
  end

  defp way(%{bits: bits} = t, from, to) do
    <<ticks::signed-size(bits)>> = <<to - from::size(bits)>>
    ticks * t.metres_per_tick
  end

  defp jump(t, seen), do: stand(%{t | jumps: t.jumps + 1, frame: make_ref()}, seen)

  defp stand(t, seen) do
    t = %{t | last: seen, suspect: nil}
    {%Hal.Odometry{pose: t.pose, twist: Twist.zero(), frame: t.frame}, t}
  end

  defp step(%{last: {left, right, before_ms}} = t, {new_left, new_right, at_ms} = seen, report) do
    left = way(t, left, new_left)
    right = way(t, right, new_right)
    turn = report.turn || (right - left) / t.wheel_base
    pose = go(t.pose, (left + right) / 2, turn)
    t = %{t | last: seen, suspect: nil, pose: pose}
    twist = twist((left + right) / 2, turn, report.elapsed_ms || at_ms - before_ms)
    {%Hal.Odometry{pose: pose, twist: twist, frame: t.frame}, t}
  end

  defp go(pose, way, turn) do
    middle = pose.heading + turn / 2
    x = pose.x + way * :math.cos(middle)
    Pose.new(x, pose.y + way * :math.sin(middle), pose.heading + turn)
  end

  defp twist(_way, _turn, ms) when ms <= 0, do: Twist.zero()
  defp twist(way, turn, ms), do: Twist.new(way * 1_000 / ms, turn * 1_000 / ms)
end
