defmodule Hal.Drive.SlewLimiter do
  @moduledoc """
  Limits every speed that a driver is given, and its change. Pure. In the drivers that use it (`Hal.RFlex.Driver`, all of `Hal.SerialBase`) it is the
  last limit before the wire, after gate and arming; the gate's ramp (`Robot.Safety.Reflex`) is the same, `approach/4`.

  Each of the two speeds is kept within its limit, grows at most by its acceleration, and shrinks
  at most by its braking, which may be larger. **A requested speed of zero applies at once**: a
  stop does not wait for any ramp; the base then brakes by itself, as hard as it was configured
  to. After a stop, and when the direction changes, a speed grows from zero.
  """
  alias Hal.Twist

  # A pause of the whole machine must not let the speed jump.
  @longest_step 0.2
  # Larger numbers are not speeds but mistakes, and no reason to drive at all.
  @senseless 1.0e6

  @keys [
    :max_linear,
    :max_turn,
    :max_acceleration,
    :max_turn_acceleration,
    :max_braking,
    :max_turn_braking
  ]
  @enforce_keys @keys
  defstruct @keys ++ [twist: %Twist{linear: 0.0, turn: 0.0}]

  @typedoc "Limits in m/s, rad/s, m/s2 and rad/s2, and the present speed."
  @type t :: %__MODULE__{
          max_linear: float(),
          max_turn: float(),
          max_acceleration: float(),
          max_turn_acceleration: float(),
          max_braking: float(),
          max_turn_braking: float(),
          twist: Twist.t()
        }

  @doc """
  A limiter at rest. All limits are positive numbers; braking is by default twice the
  acceleration.
  """
  @spec new(keyword()) :: t()
  def new(limits) do
    limits =
      limits
      |> Keyword.put_new(:max_braking, 2 * limits[:max_acceleration])
      |> Keyword.put_new(:max_turn_braking, 2 * limits[:max_turn_acceleration])

    struct!(__MODULE__, for({key, value} <- limits, do: {key, value * 1.0}))
  end

  @doc """
  Checks that a value is a speed: two floats of at most a million either way.

      iex> Hal.Drive.SlewLimiter.check(Hal.Twist.new(99, 0))
      :ok
      iex> Hal.Drive.SlewLimiter.check(%Hal.Twist{linear: :nan, turn: 0.0})
      {:error, "a speed of :nan m/s and 0.0 rad/s is not a speed"}
  """
  @spec check(term()) :: :ok | {:error, String.t()}
  def check(%Twist{linear: linear, turn: turn})
      when is_float(linear) and is_float(turn) and abs(linear) <= @senseless and
             abs(turn) <= @senseless,
      do: :ok

  def check(%Twist{linear: linear, turn: turn}),
    do: {:error, "a speed of #{show(linear)} m/s and #{show(turn)} rad/s is not a speed"}

  def check(other), do: {:error, "#{show(other)} is not a speed"}

  @doc """
  The speed now, when `wanted` is requested and the last step was `seconds` ago; more than 0.2 s
  count as 0.2 s. A value that is not a speed (`check/1`) counts as a stop.

      iex> alias Hal.Drive.SlewLimiter
      iex> ramp = SlewLimiter.new(max_linear: 0.5, max_turn: 1, max_acceleration: 0.5, max_turn_acceleration: 1)
      iex> {twist, ramp} = SlewLimiter.step(ramp, Hal.Twist.new(99, 0), 0.1)
      iex> twist
      Hal.Twist.new(0.05, 0)
      iex> {twist, _ramp} = SlewLimiter.step(ramp, Hal.Twist.zero(), 0.0)
      iex> twist
      Hal.Twist.zero()
  """
  @spec step(t(), Twist.t(), number()) :: {Twist.t(), t()}
  def step(%__MODULE__{twist: now} = ramp, wanted, seconds) do
    seconds = seconds |> max(0.0) |> min(@longest_step)
    %{linear: linear, turn: turn} = if check(wanted) == :ok, do: wanted, else: Twist.zero()

    twist =
      Twist.new(
        axis(
          now.linear,
          clamp(linear, ramp.max_linear),
          ramp.max_acceleration * seconds,
          ramp.max_braking * seconds
        ),
        axis(
          now.turn,
          clamp(turn, ramp.max_turn),
          ramp.max_turn_acceleration * seconds,
          ramp.max_turn_braking * seconds
        )
      )

    {twist, %{ramp | twist: twist}}
  end

  @doc "The same limits, at rest."
  @spec standing(t()) :: t()
  def standing(%__MODULE__{} = ramp), do: %{ramp | twist: Twist.zero()}

  defp axis(_now, wanted, _faster, _slower) when wanted == 0.0, do: 0.0

  defp axis(now, wanted, faster, slower) when now * wanted < 0,
    do: approach(now, 0.0, faster, slower)

  defp axis(now, wanted, faster, slower), do: approach(now, wanted, faster, slower)

  @doc """
  One step from a speed towards another: it grows by at most `faster` and shrinks by at most
  `slower`. If it passes zero within the step, it gets no further than it would from rest.

      iex> alias Hal.Drive.SlewLimiter
      iex> for to <- [0.5, 0.31, 0.1, -0.5], do: SlewLimiter.approach(0.3, to, 0.03125, 0.0625)
      [0.33125, 0.31, 0.2375, 0.2375]
      iex> SlewLimiter.approach(0.03125, -0.5, 0.03125, 0.125)
      -0.03125
  """
  @spec approach(from :: float(), to :: float(), faster :: float(), slower :: float()) :: float()
  def approach(from, to, faster, slower) do
    low = if from > 0, do: max(from - slower, min(-faster, 0.0)), else: from - faster
    high = if from < 0, do: min(from + slower, max(faster, 0.0)), else: from + faster
    to |> max(low) |> min(high)
  end

  defp clamp(value, most), do: value |> max(-most) |> min(most)

  defp show(value), do: inspect(value, limit: 5, printable_limit: 40, width: :infinity)
end
