defmodule Hal.Device.Arming do
  @moduledoc """
  Whether wheels may turn, as a function. Pure; `Hal.Device` asks it, as it owns the hardware.

  | state | the wheels | until |
  |---|---|---|
  | `:disarmed` | stand | a person arms, or, with `:auto`, the drive is ready |
  | `:armed` | may turn | a person disarms, the drive is not ready any more, or the line is lost |
  | `{:error, reason}` | stand | a person acknowledges that the line was lost while they turned |

  With the policy `:manual` (real robots) nothing arms but a person, after each start and each loss
  of the line. With `:auto` (simulated ones) it arms by itself, and a loss is not an error; but where a
  person has disarmed, only a person arms. With `:never` nobody arms: a dry run.

  A drive is ready while its line is open, its driver lacks nothing (`c:Hal.Drive.ready/1`) and its base's
  reports are fresh (`Hal.Device.Reports`). `why` is the line that says what is missing, or `nil`.
  """
  alias Hal.{Odometry, Twist}

  # Below these the wheels stand as far as odometry can tell.
  @standing_linear 0.01
  @standing_turn 0.02

  defstruct policy: :auto,
            state: :disarmed,
            why: nil,
            held?: false,
            told: %Twist{linear: 0.0, turn: 0.0},
            measured: %Twist{linear: 0.0, turn: 0.0},
            refused: 0

  @type policy :: :auto | :manual | :never
  @type state :: :disarmed | :armed | {:error, reason :: term()}
  @typedoc "Whether the drive is ready: its line open, its driver without a lack, its base's reports fresh."
  @type readiness :: :ok | {:error, line :: String.t()}
  @type order :: :arm | :disarm | :acknowledge

  @typedoc """
  `told` is the speed that the driver was told last, `measured` what odometry said last; `refused`
  counts speeds that came while it was not armed; `held?`: a person has disarmed.
  """
  @type t :: %__MODULE__{
          policy: policy(),
          state: state(),
          why: String.t() | nil,
          held?: boolean(),
          told: Twist.t(),
          measured: Twist.t(),
          refused: non_neg_integer()
        }

  @dry_run "this is a dry run: the wheels stand"

  @doc "Disarmed, as every start begins."
  @spec new(policy()) :: t()
  def new(:never), do: %__MODULE__{policy: :never, why: @dry_run}
  def new(policy) when policy in [:auto, :manual], do: %__MODULE__{policy: policy}

  @doc """
  Whether the drive is ready now. One that is not any more is disarmed.

      iex> Hal.Device.Arming.new(:auto) |> Hal.Device.Arming.ready(:ok) |> Map.fetch!(:state)
      :armed
      iex> Hal.Device.Arming.new(:manual) |> Hal.Device.Arming.ready(:ok) |> Map.fetch!(:state)
      :disarmed
      iex> Hal.Device.Arming.new(:auto) |> Hal.Device.Arming.ready({:error, "distance is missing"}) |> Map.take([:state, :why])
      %{state: :disarmed, why: "distance is missing"}
      iex> {:ok, armed} = Hal.Device.Arming.order(Hal.Device.Arming.new(:manual), :arm, :ok)
      iex> silent = Hal.Device.Arming.ready(armed, {:error, "its base reports nothing"})
      iex> {silent.state, Hal.Device.Arming.ready(silent, :ok).state}
      {:disarmed, :disarmed}
  """
  @spec ready(t(), readiness()) :: t()
  def ready(%__MODULE__{policy: :never} = arming, _readiness), do: arming

  def ready(%__MODULE__{state: :disarmed, policy: :auto, held?: false} = arming, :ok),
    do: %{arming | state: :armed, why: nil}

  def ready(%__MODULE__{state: :disarmed} = arming, :ok), do: %{arming | why: nil}

  def ready(%__MODULE__{state: state} = arming, {:error, line}) when state in [:disarmed, :armed],
    do: %{arming | state: :disarmed, why: line}

  def ready(%__MODULE__{} = arming, _readiness), do: arming

  @doc """
  What a person orders, and the answer. `readiness` is the driver's now. An order that changes nothing is
  `:ok`; nothing but `:acknowledge` leaves an error.

      iex> fresh = Hal.Device.Arming.new(:manual)
      iex> {:ok, armed} = Hal.Device.Arming.order(fresh, :arm, :ok)
      iex> armed.state
      :armed
      iex> {answer, _still} = Hal.Device.Arming.order(fresh, :arm, {:error, "angle is missing"})
      iex> answer
      {:error, "angle is missing"}
      iex> lost = armed |> Hal.Device.Arming.told(Hal.Twist.new(0.2, 0)) |> Hal.Device.Arming.lost(:unplugged)
      iex> {answer, _still} = Hal.Device.Arming.order(lost, :arm, :ok)
      iex> answer
      {:error, "the line was lost (:unplugged) while the wheels turned; look, and acknowledge first"}
      iex> {:ok, seen} = Hal.Device.Arming.order(lost, :acknowledge, :ok)
      iex> seen.state
      :disarmed
  """
  @spec order(t(), order(), readiness()) :: {:ok | {:error, line :: String.t()}, t()}
  def order(%__MODULE__{policy: :never} = arming, :arm, _readiness),
    do: {{:error, @dry_run}, arming}

  def order(%__MODULE__{state: {:error, reason}} = arming, :arm, _readiness),
    do:
      {{:error,
        "the line was lost (#{inspect(reason, limit: 5, printable_limit: 40)}) while the wheels turned; " <>
          "look, and acknowledge first"}, arming}

  def order(arming, :arm, {:error, line} = error), do: {error, %{disarmed(arming) | why: line}}

  def order(arming, :arm, :ok), do: {:ok, %{arming | state: :armed, why: nil, held?: false}}
  def order(arming, :disarm, _readiness), do: {:ok, %{disarmed(arming) | held?: true}}

  def order(%__MODULE__{state: {:error, _}} = arming, :acknowledge, _readiness),
    do: {:ok, %{arming | state: :disarmed, measured: Twist.zero(), told: Twist.zero()}}

  def order(arming, :acknowledge, _readiness), do: {:ok, arming}

  defp disarmed(%{state: :armed} = arming), do: %{arming | state: :disarmed}
  defp disarmed(arming), do: arming

  @doc "What the driver may be told when this speed is asked for: nothing but a stop, where it is not armed."
  @spec drive(t(), Twist.t()) :: {Twist.t(), t()}
  def drive(%__MODULE__{state: :armed} = arming, twist), do: {twist, arming}

  def drive(arming, twist) do
    refused = if Twist.zero?(twist), do: arming.refused, else: arming.refused + 1
    {Twist.zero(), %{arming | refused: refused}}
  end

  @doc "The driver has taken this speed; what is not a speed it takes for a stop."
  @spec told(t(), Twist.t()) :: t()
  def told(%__MODULE__{} = arming, %Twist{linear: linear, turn: turn} = twist)
      when is_float(linear) and is_float(turn),
      do: %{arming | told: twist}

  def told(arming, _no_speed), do: %{arming | told: Twist.zero()}

  @doc "A reading of the driver's, of which odometry counts."
  @spec measured(t(), Hal.Drive.reading() | term()) :: t()
  def measured(%__MODULE__{} = arming, {:odometry, %Odometry{twist: %Twist{} = twist}}),
    do: %{arming | measured: twist}

  def measured(arming, _reading), do: arming

  @doc """
  The line is lost. Wheels that were told to turn, or still did, may turn on where nobody can stop them.

      iex> armed = Hal.Device.Arming.new(:auto) |> Hal.Device.Arming.ready(:ok) |> Hal.Device.Arming.told(Hal.Twist.new(0.2, 0))
      iex> Hal.Device.Arming.lost(armed, :eio).state
      :disarmed
      iex> Hal.Device.Arming.lost(%{armed | policy: :manual}, :eio).state
      {:error, :eio}
  """
  @spec lost(t(), reason :: term()) :: t()
  def lost(%__MODULE__{state: {:error, _first}} = arming, _reason), do: arming

  def lost(%__MODULE__{} = arming, reason) do
    turned? =
      turns?(arming.told, 0.0, 0.0) or turns?(arming.measured, @standing_linear, @standing_turn)

    state = if arming.policy == :manual and turned?, do: {:error, reason}, else: :disarmed
    why = if arming.policy == :never, do: @dry_run
    %{arming | state: state, why: why, told: Twist.zero(), measured: Twist.zero()}
  end

  defp turns?(%Twist{linear: linear, turn: turn}, most_linear, most_turn),
    do: abs(linear) > most_linear or abs(turn) > most_turn
end
