defmodule Hal.Device.State do
  @moduledoc """
  Holds the state of a device's process: its options, the open driver, and what was last published. These modules work
  on it:

  | module | what it does |
  |---|---|
  | `Hal.Device.Server` | the process: receives messages and decides the order of the work; requests to a camera or a pan-tilt unit |
  | `Hal.Device.Lifecycle` | opens and closes the driver, judges it, drives the wheels, stops those that receive no further speed |
  | `Hal.Device.Publisher` | reports changes to sinks and events |
  | `Hal.Device.Liveness`, `Hal.Device.Obedience`, `Hal.Device.Arming` | pure: whether it shows signs of life; whether it does what it is told; whether wheels may turn |
  """
  alias Hal.Device.Arming
  alias Hal.Device.{Liveness, Obedience}
  alias Hal.Options

  @enforce_keys [:kind, :device, :driver, :options, :sinks, :clock]
  defstruct @enforce_keys ++
              [
                inner: :closed,
                health: nil,
                retry_ms: nil,
                retry: nil,
                watchdog: nil,
                arming: nil,
                armed_as: nil,
                was: nil,
                disarmed: nil,
                requests: %{},
                about: %{},
                sonar?: false,
                signs: nil,
                obedience: Obedience.new(),
                odd: nil,
                listening: nil,
                due_ms: nil,
                patient_ms: nil,
                confirmations: %{}
              ]

  @typedoc """
  `inner` is the driver's own state; `health` and `armed_as` are what was last published;
  `retry_ms` is the wait after the next failure; `retry`, `watchdog` and `listening` identify the
  timers that still count. `due_ms` is when it is to judge next, and until `patient_ms` silence does
  not count, because it has been asleep itself (`System.monotonic_time/1`, ms). `confirmations` are the timers and replies of
  callers that wait for a report.
  """
  @type t :: %__MODULE__{
          kind: Hal.Device.kind(),
          device: atom(),
          driver: module(),
          options: keyword(),
          sinks: [{module(), atom(), list()}],
          clock: {module(), atom(), list()},
          inner: :closed | {:open, term()},
          health: Hal.Device.status() | nil,
          retry_ms: pos_integer() | nil,
          retry: reference() | nil,
          watchdog: {reference(), reference()} | nil,
          arming: Arming.t() | nil,
          armed_as: {Arming.state(), String.t() | nil} | nil,
          was: {module(), atom(), list()} | nil,
          disarmed: {module(), atom(), list()} | nil,
          requests: %{atom() => list()},
          about: map(),
          sonar?: boolean(),
          signs: Liveness.t() | nil,
          obedience: Obedience.t(),
          odd: String.t() | nil,
          listening: reference() | nil,
          due_ms: integer() | nil,
          patient_ms: integer() | nil,
          confirmations: %{reference() => {reference(), Hal.Device.Confirmation.reply()}}
        }

  @doc """
  The state of a device that is not open yet, from its options (`Hal.Device`). Wrong options raise
  `ArgumentError`.
  """
  @spec new!(keyword()) :: t()
  def new!(options), do: struct!(__MODULE__, check!(options))

  @doc "The time by the device's clock, in milliseconds."
  @spec now(t()) :: integer()
  def now(%__MODULE__{clock: {m, f, a}}), do: apply(m, f, a)

  # Checks the options of `Hal.Device`, where they are listed. Pure.

  @table [
    kind: [{:one_of, [:drive, :ptz, :camera, :scan]}, required: true],
    driver: [:driver, required: true],
    device: [{:check, &is_atom/1, "a name"}, default: nil],
    arm: [{:one_of, [:auto, :manual, :never]}, default: :auto],
    sonar: [:boolean, default: false],
    was: [:mfa, default: nil],
    disarmed: [:mfa, default: nil],
    about: [{:check, &is_map/1, "a map"}, default: %{}],
    sinks: [{:list, :mfa}, default: []],
    clock: [:mfa, default: {System, :monotonic_time, [:millisecond]}]
  ]

  # The fields of a device's state; an `ArgumentError` names the option, its value and what is
  # allowed.
  defp check!(options) do
    options = Options.check!(options, @table, "device")
    {driver, driver_options} = options[:driver]

    Keyword.take(options, [:kind, :was, :disarmed, :about, :sinks, :clock]) ++
      [
        device: options[:device] || options[:kind],
        driver: driver,
        options: driver_options,
        arming: if(options[:kind] == :drive, do: Arming.new(options[:arm])),
        sonar?: options[:sonar]
      ]
  end
end
