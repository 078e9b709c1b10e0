defmodule Hal.DriveCase.Run do
  @moduledoc false
  # One run of a rule of `Hal.DriveCase`: a base and a device on a line of their own, what is ordered, and what is heard.
  alias Hal.{Device, DeviceCase, Pose, Twist}

  # Slower than this the wheels stand, m/s and rad/s.
  @stands 0.005
  @turns 0.02
  # Odometry that goes further than this from one report to the next has jumped, m.
  @jump 0.5
  @look_ms 10
  @order_ms 50
  @hold_ms 500
  # Noise comes in chunks of so many bytes.
  @chunk 2_000

  @enforce_keys [:driver, :emulated, :options, :speed]
  defstruct @enforce_keys ++
              [
                kind: :drive,
                link: nil,
                ref: nil,
                pid: nil,
                device: nil,
                order: nil,
                ordered_ms: nil,
                odometry: nil,
                health: nil,
                jumped?: false
              ]

  @typedoc """
  `speed` is what it drives with (m/s, rad/s), `pid` the base, `order` the speed that is repeated, `odometry` and `health` are the
  last that was heard; `jumped?` says whether odometry has, in one frame.
  """
  @type t :: %__MODULE__{}

  @doc "From now on this speed is repeated; `nil` for silence."
  @spec order(t(), Twist.t() | nil) :: t()
  def order(t, twist), do: %{t | order: twist, ordered_ms: now() - @order_ms}

  @doc "Waits until it is so; the order is repeated, as a gate does it. The error is this line."
  @spec await(t(), String.t(), (t() -> boolean())) :: {:ok, t()} | {:error, String.t()}
  def await(t, line, condition), do: await(t, line, condition, now() + t.options[:wait_ms])

  defp await(t, line, condition, until_ms) do
    t = look(t, @look_ms)

    cond do
      condition.(t) -> {:ok, t}
      now() >= until_ms and not Process.alive?(t.device) -> {:error, line <> ", and has ended"}
      now() >= until_ms -> {:error, line}
      true -> await(t, line, condition, until_ms)
    end
  end

  @doc "For half a second it must be so all the time."
  @spec hold(t(), String.t(), (t() -> boolean())) :: {:ok, t()} | {:error, String.t()}
  def hold(t, line, condition), do: hold(t, line, condition, now() + @hold_ms)

  defp hold(t, line, condition, until_ms) do
    t = look(t, @look_ms)

    cond do
      not condition.(t) -> {:error, line}
      now() >= until_ms -> {:ok, t}
      true -> hold(t, line, condition, until_ms)
    end
  end

  @doc "Puts so many chunks of noise on the line while it drives."
  @spec noise(t(), non_neg_integer(), :rand.state()) :: {:ok, t()}
  def noise(t, 0, _rand), do: {:ok, t}

  def noise(t, times, rand) do
    rand = DeviceCase.noise(t, @chunk, rand)
    noise(look(t, @order_ms), times - 1, rand)
  end

  # Takes what is said for so long.
  defp look(%{order: %Twist{} = twist, ordered_ms: at_ms} = t, ms) do
    if now() - at_ms >= @order_ms do
      Device.drive(t.device, twist)
      listen(%{t | ordered_ms: now()}, now() + ms)
    else
      listen(t, now() + ms)
    end
  end

  defp look(t, ms), do: listen(t, now() + ms)

  defp listen(%{ref: ref} = t, until_ms) do
    receive do
      {^ref, reading} -> t |> note(reading) |> listen(until_ms)
    after
      max(until_ms - now(), 0) -> t
    end
  end

  defp note(t, {:odometry, %{frame: frame, pose: pose} = odometry}) do
    jumped? =
      match?(%{frame: ^frame}, t.odometry) and Pose.distance(t.odometry.pose, pose) > @jump

    %{t | odometry: odometry, jumped?: t.jumped? or jumped?}
  end

  defp note(t, {:health, _device, {health, _since_ms}}), do: %{t | health: health}
  defp note(t, _other), do: t

  @doc "The last health that was heard."
  @spec health(t()) :: :online | {:offline, term()} | nil
  def health(t), do: t.health

  @doc "The speed that the base gives its wheels."
  @spec wheels(t()) :: Twist.t()
  def wheels(t), do: DeviceCase.tell(t, :wheels)

  @doc "The speed by odometry; what rounding makes of a standing wheel is none."
  @spec measured(t()) :: Twist.t()
  def measured(%{odometry: nil}), do: Twist.zero()

  def measured(%{odometry: %{twist: %{linear: linear, turn: turn}}}) do
    linear = if abs(linear) > 0.01, do: linear, else: 0.0
    Twist.new(linear, if(abs(turn) > 0.02, do: turn, else: 0.0))
  end

  @doc "Whether the wheels stand."
  @spec standing?(t()) :: boolean()
  def standing?(t) do
    wheels = wheels(t)
    abs(wheels.linear) < @stands and abs(wheels.turn) < @turns
  end

  defp now, do: Hal.Clock.now_ms()
end
