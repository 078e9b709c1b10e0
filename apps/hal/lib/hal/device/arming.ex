defmodule Hal.Device.Arming do
  @moduledoc """
  Decides whether the wheels may turn. Pure; `Hal.Device` calls it, because it owns the hardware.

  | state | the wheels | until |
  |---|---|---|
  | `:disarmed` | receive only stops | a person arms, or, with `:auto`, the drive is ready |
  | `:armed` | may turn | a person disarms, the drive is no longer ready, the line is lost, or, with `:manual`, they stand for 3 s although they were told to turn |
  | `{:error, reason}` | receive only stops | a person acknowledges that the line was lost while they turned |

  With the policy `:manual` (real robots) only a person arms: after each start, each loss of the
  line, and each time that the drive was not ready. With `:auto` (simulated robots) the drive arms
  by itself, and a loss of the line is not an error; after a person has disarmed it, only a person
  arms it again. With `:never` it cannot be armed: a dry run.

  A drive is ready while its line is open, its driver says so (`c:Hal.Drive.ready/1`) and its
  base's reports are fresh (`Hal.Device.Reports`). `why` says what is missing, or is `nil`.
  """
  alias Hal.{Odometry, Twist}

  # Below these speeds (m/s, rad/s) odometry counts as standing.
  @standing_linear 0.01
  @standing_turn 0.02

  defstruct policy: :auto,
            state: :disarmed,
            why: nil,
            by_person?: false,
            told: %Twist{linear: 0.0, turn: 0.0},
            measured: %Twist{linear: 0.0, turn: 0.0},
            refused: 0

  @type policy :: :auto | :manual | :never
  @type state :: :disarmed | :armed | {:error, reason :: term()}
  @typedoc "Whether the drive is ready; the error says what is missing."
  @type readiness :: :ok | {:error, line :: String.t()}
  @type order :: :arm | :disarm | :acknowledge

  @typedoc """
  `told` is the last speed that was given to the driver, `measured` the last one that odometry
  reported; `refused` counts the speeds other than zero that came while the drive was not armed;
  `by_person?` is true after a person has disarmed it.
  """
  @type t :: %__MODULE__{
          policy: policy(),
          state: state(),
          why: String.t() | nil,
          by_person?: boolean(),
          told: Twist.t(),
          measured: Twist.t(),
          refused: non_neg_integer()
        }

  @dry_run "this is a dry run: the wheels stand"

  @doc "A disarmed drive, as after every start."
  @spec new(policy()) :: t()
  def new(:never), do: %__MODULE__{policy: :never, why: @dry_run}
  def new(policy) when policy in [:auto, :manual], do: %__MODULE__{policy: policy}

  @doc "A fresh one of a drive that a person has disarmed before: only a person arms it."
  @spec keep_disarmed(t()) :: t()
  def keep_disarmed(%__MODULE__{} = arming), do: %{arming | by_person?: true}

  @doc """
  Takes whether the drive is ready now. An armed drive that is not ready is disarmed; a ready one
  with `:auto` is armed, unless a person has disarmed it.

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

  def ready(%__MODULE__{state: :disarmed, policy: :auto, by_person?: false} = arming, :ok),
    do: %{arming | state: :armed, why: nil}

  def ready(%__MODULE__{state: :disarmed} = arming, :ok), do: %{arming | why: nil}

  def ready(%__MODULE__{state: state} = arming, {:error, line}) when state in [:disarmed, :armed],
    do: %{arming | state: :disarmed, why: line}

  def ready(%__MODULE__{} = arming, _readiness), do: arming

  @doc """
  Records that the wheels stand although they were told to turn, as with the power of the motors cut by an emergency button
  (`Hal.Device.Obedience`).

      iex> for policy <- [:auto, :manual], do: Hal.Device.Arming.stood(%Hal.Device.Arming{policy: policy, state: :armed}).state
      [:armed, :disarmed]
  """
  @spec stood(t()) :: t()
  def stood(%__MODULE__{policy: :manual} = arming), do: disarmed(arming)
  def stood(%__MODULE__{} = arming), do: arming

  @doc """
  Carries out a person's order, and gives the answer to it. `readiness` is that of the drive now.
  An order that has nothing to change is `:ok`; only `:acknowledge` leaves the error state.

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

  def order(arming, :arm, :ok), do: {:ok, %{arming | state: :armed, why: nil, by_person?: false}}
  def order(arming, :disarm, _readiness), do: {:ok, %{disarmed(arming) | by_person?: true}}

  def order(%__MODULE__{state: {:error, _}} = arming, :acknowledge, _readiness),
    do: {:ok, %{arming | state: :disarmed, measured: Twist.zero(), told: Twist.zero()}}

  def order(arming, :acknowledge, _readiness), do: {:ok, arming}

  defp disarmed(%{state: :armed} = arming), do: %{arming | state: :disarmed}
  defp disarmed(arming), do: arming

  @doc """
  The speed that the driver may be given when this one is requested: only a stop, unless the drive
  is armed.
  """
  @spec drive(t(), Twist.t()) :: {Twist.t(), t()}
  def drive(%__MODULE__{state: :armed} = arming, twist), do: {twist, arming}

  def drive(arming, twist) do
    refused = if Twist.zero?(twist), do: arming.refused, else: arming.refused + 1
    {Twist.zero(), %{arming | refused: refused}}
  end

  @doc """
  Records that the driver has accepted this speed. A value that is not a speed counts as a stop,
  as it does in the driver.
  """
  @spec told(t(), Twist.t()) :: t()
  def told(%__MODULE__{} = arming, %Twist{linear: linear, turn: turn} = twist)
      when is_float(linear) and is_float(turn),
      do: %{arming | told: twist}

  def told(arming, _no_speed), do: %{arming | told: Twist.zero()}

  @doc "Takes a reading of the driver; only odometry matters."
  @spec measured(t(), Hal.Drive.reading() | term()) :: t()
  def measured(%__MODULE__{} = arming, {:odometry, %Odometry{twist: %Twist{} = twist}}),
    do: %{arming | measured: twist}

  def measured(arming, _reading), do: arming

  @doc """
  Records that the line was lost. Wheels that had been given a speed other than zero, or were
  still moving, may go on turning with no way to stop them; with `:manual` that is an error.

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
