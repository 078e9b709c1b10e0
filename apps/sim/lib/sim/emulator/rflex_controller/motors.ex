defmodule Sim.Emulator.RFlexController.Motors do
  @moduledoc false
  # Emulates both axes of the controller, forward and turn: commanded speeds with their accelerations, the brake, the stop
  # when commands are missing, and the counters. Pure; counts are in the controller's units, times in milliseconds.
  #
  # Where the sheet leaves it open: an acceleration of 0 keeps the previous one; a set brake stops
  # the wheels at once, and no speed is accepted while it is set; an axis gets no faster than a base
  # of that size can, 2.5 m/s and 5 rad/s, whatever the command. (A damaged command whose checksum
  # happens to fit may ask for 20 m/s at 100 m/s2; an axis that obeyed would then brake for 20 s.)
  import Bitwise
  alias Hal.{Odometry, Pose, Twist}

  # The maximum speed of an axis, in m/s and rad/s.
  @top_linear 2.5
  @top_turn 5.0

  @enforce_keys [:conversions, :start, :timeout_ms, :brake?, :at_ms]
  defstruct @enforce_keys ++
              [
                axes:
                  {%{target: 0, ramp: 0.0, acceleration: 0, torque: 0},
                   %{target: 0, ramp: 0.0, acceleration: 0, torque: 0}},
                commanded_ms: nil,
                gone: {0.0, 0.0},
                measured: {0.0, 0.0},
                pose: nil
              ]

  @type t :: %__MODULE__{}
  @type axis :: 0 | 1

  @doc "Motors at rest, of a controller with these options (`Sim.Emulator.RFlexController.Options`)."
  @spec new(map(), integer()) :: t()
  def new(options, at_ms) do
    %__MODULE__{
      conversions: {options.conversions[:distance], options.conversions[:angle]},
      start: options.counters,
      timeout_ms: options.timeout_ms,
      brake?: options.brake == :set,
      at_ms: at_ms
    }
  end

  @doc "A motion command for an axis: counts/s, counts/s2."
  @spec command(t(), axis(), integer(), non_neg_integer(), non_neg_integer(), integer()) :: t()
  def command(%__MODULE__{} = motors, axis, speed, acceleration, torque, at_ms) do
    motors = advance(motors, at_ms)
    before = elem(motors.axes, axis)

    after_it = %{
      before
      | target: if(motors.brake?, do: 0, else: speed),
        acceleration: if(acceleration == 0, do: before.acceleration, else: acceleration),
        torque: torque
    }

    %{motors | axes: put_elem(motors.axes, axis, after_it), commanded_ms: at_ms}
  end

  @doc "Sets or releases the brake."
  @spec brake(t(), boolean(), integer()) :: t()
  def brake(%__MODULE__{} = motors, set?, at_ms) do
    motors = advance(motors, at_ms)
    if set?, do: %{still(motors) | brake?: true}, else: %{motors | brake?: false}
  end

  @doc "Stops both axes with their accelerations."
  @spec halt(t(), integer()) :: t()
  def halt(%__MODULE__{} = motors, at_ms), do: motors |> advance(at_ms) |> aim_at_rest()

  defp still(motors), do: each(motors, &%{&1 | target: 0, ramp: 0.0})
  defp aim_at_rest(motors), do: each(motors, &%{&1 | target: 0})
  defp each(%{axes: {a, b}} = motors, change), do: %{motors | axes: {change.(a), change.(b)}}

  @doc "The motors at a later time."
  @spec advance(t(), integer()) :: t()
  def advance(%__MODULE__{} = motors, at_ms) when at_ms > motors.at_ms do
    end_ms = end_ms(motors)

    if end_ms != nil and end_ms <= at_ms do
      ramp(%{aim_at_rest(ramp(motors, max(end_ms, motors.at_ms))) | commanded_ms: nil}, at_ms)
    else
      ramp(motors, at_ms)
    end
  end

  def advance(motors, _same_ms), do: motors

  @doc "When the motors stop because no command came; `nil` if no command is awaited."
  @spec end_ms(t()) :: integer() | nil
  def end_ms(%__MODULE__{timeout_ms: :off}), do: nil
  def end_ms(%__MODULE__{commanded_ms: nil}), do: nil
  def end_ms(%__MODULE__{axes: {%{target: 0}, %{target: 0}}}), do: nil
  def end_ms(%__MODULE__{} = motors), do: motors.commanded_ms + motors.timeout_ms

  defp ramp(motors, at_ms) do
    s = (at_ms - motors.at_ms) / 1000

    {way, turn} = motors.axes
    {distance, angle} = motors.conversions

    axes = {
      %{way | ramp: ramp(way, s, @top_linear * abs(distance))},
      %{turn | ramp: ramp(turn, s, @top_turn * abs(angle))}
    }

    %{motors | at_ms: at_ms, axes: axes}
  end

  defp ramp(axis, s, top),
    do: axis.ramp |> towards(axis.target, axis.acceleration * s) |> max(-top) |> min(top)

  defp towards(from, to, most), do: from + ((to - from) |> max(-most) |> min(most))

  @doc "The speed that the wheels should have now."
  @spec wanted(t()) :: Twist.t()
  def wanted(%__MODULE__{axes: {way, turn}, conversions: {distance, angle}}),
    do: Twist.new(way.ramp / distance, turn.ramp / angle)

  @doc """
  The counters after the wheels moved on to this reading. The distance is computed from the poses,
  so that a lost reading does not lose counts.
  """
  @spec roll(t(), Odometry.t()) :: t()
  def roll(%__MODULE__{} = motors, %Odometry{pose: pose, twist: twist}) do
    {way, turn} = motors.gone
    {ahead, round} = if motors.pose, do: between(motors.pose, pose), else: {0.0, 0.0}

    %{
      motors
      | pose: pose,
        gone: {way + ahead, turn + round},
        measured: {twist.linear, twist.turn}
    }
  end

  defp between(from, to) do
    turn = Pose.wrap(to.heading - from.heading)
    middle = from.heading + turn / 2
    {(to.x - from.x) * :math.cos(middle) + (to.y - from.y) * :math.sin(middle), turn}
  end

  @doc "The position and speed of an axis: counter and counts/s, signed 32 bits."
  @spec counts(t(), axis()) :: {position :: integer(), velocity :: integer()}
  def counts(%__MODULE__{} = motors, axis) do
    conversion = elem(motors.conversions, axis)
    gone = round(elem(motors.gone, axis) * conversion)
    {wrap(elem(motors.start, axis) + gone), wrap(round(elem(motors.measured, axis) * conversion))}
  end

  @doc "The last command to an axis: acceleration and torque."
  @spec told(t(), axis()) :: {non_neg_integer(), non_neg_integer()}
  def told(%__MODULE__{axes: axes}, axis) do
    %{acceleration: acceleration, torque: torque} = elem(axes, axis)
    {acceleration, torque}
  end

  defp wrap(count) do
    <<signed::signed-32>> = <<count &&& 0xFFFFFFFF::32>>
    signed
  end
end
