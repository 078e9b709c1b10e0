defmodule Sim.Emulator.Wheels do
  @moduledoc """
  Turns two wheels of an emulated base by explicit time: they approach the speeds that they are told with one acceleration, and
  what they have gone is exact. Pure; metres, m/s, whole milliseconds.

  With a body in a world, which reports its odometry (`feel/2`), the ways are the body's, and the speeds here are what the motors
  ask of it.

  A `Sim.Emulator.Core` that says `use Sim.Emulator.Wheels`, and keeps them as `wheels` beside its checked `options`, feels where its body
  goes, and is switched off and on as at the start, while the body stays where it is.
  """
  alias Hal.{Odometry, Pose, Twist}

  @repeat_ms 100

  @enforce_keys [:base, :acceleration, :at_ms]
  defstruct @enforce_keys ++
              [
                told: {0.0, 0.0},
                speeds: {0.0, 0.0},
                gone: {0.0, 0.0},
                body: nil,
                moved_ms: nil,
                wished: nil
              ]

  @typedoc """
  Pairs are of the left and the right wheel; `base` is the distance between them; `moved_ms` is when a wheel turned last, by what the
  motors ask; `wished` is what the body was asked last.
  """
  @type t :: %__MODULE__{
          base: float(),
          acceleration: float(),
          at_ms: integer(),
          told: {float(), float()},
          speeds: {float(), float()},
          gone: {float(), float()},
          body: Pose.t() | nil,
          moved_ms: integer() | nil,
          wished: {Twist.t(), at_ms :: integer()} | nil
        }

  defmacro __using__(_no_options) do
    quote do
      @behaviour Sim.Emulator.Core

      @impl Sim.Emulator.Core
      def feel(core, {:odometry, odometry}, _at_ms),
        do: %{core | wheels: Sim.Emulator.Wheels.feel(core.wheels, odometry)}

      def feel(core, _other, _at_ms), do: core

      @impl Sim.Emulator.Core
      def restart(core, at_ms) do
        {:ok, new} = new(Map.to_list(core.options), at_ms)
        %{new | wheels: %{new.wheels | body: core.wheels.body}}
      end

      defoverridable feel: 3, restart: 2
    end
  end

  @doc "Wheels at rest."
  @spec new(base :: float(), acceleration :: float(), at_ms :: integer()) :: t()
  def new(base, acceleration, at_ms),
    do: %__MODULE__{base: base, acceleration: acceleration, at_ms: at_ms}

  @doc """
  Tells the wheels their speeds from now on.

      iex> wheels = Sim.Emulator.Wheels.new(0.2, 1.0, 0) |> Sim.Emulator.Wheels.tell({0.1, 0.1}, 0)
      iex> {left, right} = Sim.Emulator.Wheels.advance(wheels, 1_100).gone
      iex> {Float.round(left, 6), left == right}
      {0.105, true}
  """
  @spec tell(t(), {number(), number()}, integer()) :: t()
  def tell(%__MODULE__{} = wheels, {left, right}, at_ms),
    do: %{advance(wheels, at_ms) | told: {left * 1.0, right * 1.0}}

  @doc "The wheels at a later time."
  @spec advance(t(), integer()) :: t()
  def advance(%__MODULE__{at_ms: before_ms} = wheels, at_ms) when at_ms <= before_ms, do: wheels

  def advance(%__MODULE__{} = wheels, at_ms) do
    seconds = (at_ms - wheels.at_ms) / 1_000
    {left, left_way, left_s} = roll(wheels, 0, seconds)
    {right, right_way, right_s} = roll(wheels, 1, seconds)
    {gone_left, gone_right} = wheels.gone

    gone = if wheels.body, do: wheels.gone, else: {gone_left + left_way, gone_right + right_way}

    turned_s = max(left_s, right_s)

    moved_ms = if turned_s > 0, do: wheels.at_ms + round(turned_s * 1_000), else: wheels.moved_ms

    %{wheels | at_ms: at_ms, speeds: {left, right}, gone: gone, moved_ms: moved_ms}
  end

  # The speed at the end, the way until then, and how long the wheel turned: it changes its speed evenly, and then keeps it.
  defp roll(wheels, n, seconds) do
    speed = elem(wheels.speeds, n)
    told = elem(wheels.told, n)
    change_s = min(abs(told - speed) / wheels.acceleration, seconds)

    ending =
      if change_s < seconds,
        do: told,
        else: speed + sign(told - speed) * wheels.acceleration * change_s

    way = (speed + ending) / 2 * change_s + told * (seconds - change_s)

    turned_s =
      cond do
        told != 0 or ending != 0 -> seconds
        speed != 0 -> change_s
        true -> 0.0
      end

    {ending, way, turned_s}
  end

  defp sign(number) when number < 0, do: -1
  defp sign(_number), do: 1

  @doc "The body has moved to there; the counters of the wheels are what it went."
  @spec feel(t(), Odometry.t()) :: t()
  def feel(%__MODULE__{body: nil} = wheels, %Odometry{pose: pose}), do: %{wheels | body: pose}

  def feel(%__MODULE__{body: from, gone: {left, right}} = wheels, %Odometry{pose: to}) do
    turn = Pose.wrap(to.heading - from.heading)
    middle = from.heading + turn / 2
    way = (to.x - from.x) * :math.cos(middle) + (to.y - from.y) * :math.sin(middle)
    half = turn * wheels.base / 2
    %{wheels | body: to, gone: {left + way - half, right + way + half}}
  end

  @doc """
  The speed that the motors ask of the body.

      iex> wheels = Sim.Emulator.Wheels.new(0.2, 9.0, 0) |> Sim.Emulator.Wheels.tell({-0.1, 0.1}, 0)
      iex> Sim.Emulator.Wheels.twist(Sim.Emulator.Wheels.advance(wheels, 100))
      Hal.Twist.new(0, 1)
  """
  @spec twist(t()) :: Twist.t()
  def twist(%__MODULE__{speeds: {left, right}, base: base}),
    do: Twist.new((left + right) / 2, (right - left) / base)

  @doc "What the body should do now: that speed, where it has changed, and every 100 ms."
  @spec wishes(t(), integer()) :: {[Sim.Emulator.Core.wish()], t()}
  def wishes(%__MODULE__{} = wheels, at_ms) do
    twist = twist(wheels)

    case wheels.wished do
      {^twist, since_ms} when at_ms - since_ms < @repeat_ms -> {[], wheels}
      _other_or_long_ago -> {[{:drive, twist}], %{wheels | wished: {twist, at_ms}}}
    end
  end

  @doc "How far the robot has turned, by its wheels (radians, left positive)."
  @spec turned(t()) :: float()
  def turned(%__MODULE__{gone: {left, right}, base: base}), do: (right - left) / base
end
