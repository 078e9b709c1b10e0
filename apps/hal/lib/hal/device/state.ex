defmodule Hal.Device.State do
  @moduledoc """
  The state of a device's process: its options, what it has opened, and what it has published. Its
  parts work on it:

  | module | what it does |
  |---|---|
  | `Hal.Device.Server` | the process: what comes in, in which order |
  | `Hal.Device.Lifecycle` | opens and closes the driver, judges it, drives the wheels |
  | `Hal.Device.Wishes` | what is wished of a camera, or of a pan-tilt unit |
  | `Hal.Device.Watchdog` | stops wheels that nobody asks anything of |
  | `Hal.Device.Publisher` | tells sinks and events of changes |
  | `Hal.Device.Liveness`, `Hal.Device.Arming` | pure: whether it gives signs of life; whether wheels may turn |
  """
  alias Hal.Device.Arming
  alias Hal.Device.{Liveness, Options}

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
                wishes: %{},
                about: %{},
                sonar?: false,
                signs: nil,
                listening: nil
              ]

  @typedoc """
  `inner` is the driver's own state; `health` and `armed_as` what was told last; `retry_ms` how long to wait after the
  next failure, and `retry`, `watchdog`, `listening` the timers that still count.
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
          wishes: %{atom() => list()},
          about: map(),
          sonar?: boolean(),
          signs: Liveness.t() | nil,
          listening: reference() | nil
        }

  @doc "Of a device that is not open yet, by its options (`Hal.Device`); `ArgumentError` for wrong ones."
  @spec new!(keyword()) :: t()
  def new!(options), do: struct!(__MODULE__, Options.check!(options))

  @doc "The time by its clock, in milliseconds."
  @spec now(t()) :: integer()
  def now(%__MODULE__{clock: {m, f, a}}), do: apply(m, f, a)
end
