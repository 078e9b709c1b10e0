defmodule Hal.Device do
  @moduledoc """
  Runs any driver (`Hal.Drive`, `Hal.Ptz`, `Hal.Camera`, `Hal.Lidar`) in a process: it opens the driver after its own start, passes
  its readings on, and reopens it after errors.

  Options:

    * `:kind` - `:drive`, `:ptz`, `:camera` or `:scan`, which is a lidar
    * `:driver` - `{module, options}`
    * `:sinks` - `[{m, f, a}]`; each reading goes to `apply(m, f, a ++ [reading])`. A change of
      health is the reading `{:health, device, {:online | {:offline, reason}, since_ms}}`
    * `:device` - its name in reports of its health, by default its kind
    * `:arm` - for a drive: `:auto` (the default), `:manual` or `:never`, see below
    * `:sonar` - for a drive: whether its base has sonars (default false); if it has, the drive is
      armed only while they report
    * `:was` - `{m, f, a}` that returns the last status of the previous process that the sinks
      know, or `nil`
    * `:disarmed` - for a drive: `{m, f, a}` that returns the last reading `{:disarmed, by_person?}` that the sinks
      know of the previous process, so that only a person arms again what a person has disarmed, or `false`
    * `:about` - a map that is merged into the metadata of its events, such as `%{robot: :mag1}`
    * `:name` - as in `GenServer`
    * `:clock` - `{m, f, a}` that returns integer milliseconds

  ## Online

  An open driver does not make a device online: if a line is silent or noisy, or leads to a base
  that does not answer, the state of the wheels is unknown. A drive is online once its base has
  reported its wheels since the opening, and while these reports keep coming
  (`Hal.Device.Reports`); otherwise it is offline with the reason `:silent`, although its driver
  stays open. A camera, a lidar or a pan-tilt unit is online from its first reading. A camera or a lidar without a
  reading for 10 s, and a pan-tilt unit without one in its first 10 s, is offline (`:mute`) and is
  reopened (`Hal.Device.Liveness`).

  ## Refused

  What the device refuses (`{:refused, request, line}` from its driver) is counted, and an event. A
  device that answers, and obeys nothing, is offline, although its driver stays open
  (`Hal.Device.Obedience`): one that refuses the same request again and again, a head that does
  not turn, wheels that stand while they are told to turn.

  ## When a driver fails

  An error that a driver *returns* is expected: the device reports it, closes the driver, and
  tries again after 100 ms, 200 ms, … up to 5 s. The first reading after an opening resets the
  wait to 100 ms; a driver that opens and then fails without a reading is therefore not reopened
  ten times a second.

  A driver that *raises* crashes the device, and the supervisor restarts the device. Before it
  exits, the device closes the driver, reports that it is offline (`:fell`) and disarmed, and
  waits for 500 ms. A driver that crashes on every message therefore does not use up the
  supervisor's restarts, which would end the robot's other devices too. A device that is killed
  cannot report anything; its successor reports it first (`:was`).

  ## Requests

  A speed for an offline drive is dropped, because a speed is valid only now. The last direction
  and zoom requested of a pan-tilt unit are kept, and sent again each time its driver is opened.

  ## Wheels

  A drive that receives no further speed for 500 ms stops its wheels. This is the second line of
  defence behind the dead man's switch of the gate, in case the gate is gone or stuck.

  The wheels turn only while the drive is armed (`Hal.Device.Arming`): a speed that comes while it
  is not becomes a stop, and is counted. With `arm: :auto` the drive arms whenever its driver is
  open and ready and its base's reports are fresh, unless a person has disarmed it; with `:manual`
  a person arms it after every start, by `arm/1`; with `:never` it stands, as in a dry run. Stale
  reports stop and disarm it. If, with `:manual`, the line was lost while the wheels turned,
  `acknowledge/1` is needed first. The reading `{:arming, %{state: state, why: line or nil}}`
  reports the state.
  """
  alias Hal.Twist
  alias Hal.Device.Arming
  alias Hal.Device.{Server, State}

  # On a busy machine a device is slow, not gone; and the callers wait for half a second at most.
  @call_ms 400
  # It must come to an order to arm so much earlier that its answer is in time.
  @answer_ms 100

  @type kind :: :drive | :ptz | :camera | :scan
  @type status :: {:online | {:offline, reason :: term()}, since_ms :: integer()}

  @doc "Starts the device, which then opens its driver. Wrong options raise `ArgumentError`."
  @spec start_link(keyword()) :: GenServer.on_start()
  def start_link(options) do
    {name, options} = Keyword.split(options, [:name])
    GenServer.start_link(Server, State.new!(options), name)
  end

  @doc "A child specification; a supervisor may have several devices if their names differ."
  @spec child_spec(keyword()) :: Supervisor.child_spec()
  def child_spec(options) do
    id = {__MODULE__, options[:device] || options[:kind]}
    %{id: id, start: {__MODULE__, :start_link, [options]}}
  end

  @doc "Requests a speed of a drive. While it is offline, the request is dropped."
  @spec drive(GenServer.server(), Twist.t()) :: :ok
  def drive(device, %Twist{} = twist), do: GenServer.cast(device, {:drive, twist})

  @doc """
  Lets the wheels turn. The error says why they may not: what is missing, or that nobody has
  acknowledged. Only for a device of this node. If the drive does not answer within 400 ms, that
  is an error, and a device that comes to the request more than 300 ms after it does not arm.
  """
  @spec arm(GenServer.server()) :: :ok | {:error, line :: String.t()}
  def arm(device),
    do: order(device, {:arm, Hal.Clock.now_ms() + @call_ms - @answer_ms})

  @doc """
  Stops the wheels until `arm/1`. The error says that the line was lost, so that they cannot be
  stopped, or that the drive does not answer within 400 ms.
  """
  @spec disarm(GenServer.server()) :: :ok | {:error, line :: String.t()}
  def disarm(device), do: order(device, :disarm)

  @doc """
  The same for callers that must not wait: when it is done, the device applies `then`, an
  `{m, f, a}` or `nil`.
  """
  @spec disarm_later(GenServer.server(), then :: {module(), atom(), list()} | nil) :: :ok
  def disarm_later(device, then \\ nil), do: GenServer.cast(device, {:disarm, then})

  @doc """
  Asks whether what the drive was told before this has a base behind it, on behalf of another process; the caller does
  not wait. The device applies `reply` with the outcome: `:reported` at the base's next report of its wheels, `:silent`
  if none comes within so many ms (5,000 at most), `:closed` when its driver is not open. A device that hangs or is gone
  does not reply.
  """
  @spec confirm(GenServer.server(), within_ms :: 1..5_000, reply :: {module(), atom(), list()}) ::
          :ok
  def confirm(device, within_ms, {_m, _f, _a} = reply) when within_ms in 1..5_000,
    do: GenServer.cast(device, {:confirm, within_ms, reply})

  @doc """
  A person confirms having checked why the line was lost while the wheels turned. The drive may
  then be armed.
  """
  @spec acknowledge(GenServer.server()) :: :ok | {:error, line :: String.t()}
  def acknowledge(device), do: order(device, :acknowledge)

  @doc """
  Gives the device an order on behalf of another process; the caller does not wait. The device
  applies `reply`, an `{m, f, a}`, with the result that `arm/1`, `disarm/1` or `acknowledge/1`
  would have returned as its last argument; a device that hangs or is gone does not reply. An
  order that it comes to at `until_ms` (`System.monotonic_time/1`, ms) or later is not carried
  out.
  """
  @spec order_later(
          GenServer.server(),
          Arming.order(),
          until_ms :: integer(),
          reply :: {module(), atom(), list()}
        ) :: :ok
  def order_later(device, order, until_ms, {_m, _f, _a} = reply)
      when order in [:arm, :disarm, :acknowledge] and is_integer(until_ms),
      do: GenServer.cast(device, {:order, order, until_ms, reply})

  @doc """
  The arming of a drive, with what `Hal.Device.Arming` counts; `nil` for a device that is not a
  drive.
  """
  @spec arming(GenServer.server()) :: Arming.t() | nil
  def arming(device), do: GenServer.call(device, :arming)

  defp order(device, order) do
    GenServer.call(device, order, @call_ms)
  catch
    :exit, {_timeout_or_gone, {GenServer, :call, _call}} -> {:error, "the drive does not answer"}
  end

  @doc "Requests a direction of a pan-tilt unit (radians, left and up positive)."
  @spec look(GenServer.server(), pan :: float(), tilt :: float()) :: :ok
  def look(device, pan, tilt) when is_float(pan) and is_float(tilt),
    do: GenServer.cast(device, {:look, pan, tilt})

  @doc """
  Requests a horizontal field of view (radians) of a pan-tilt unit. A unit that cannot zoom
  ignores it.
  """
  @spec zoom(GenServer.server(), field_of_view :: float()) :: :ok
  def zoom(device, field_of_view) when is_float(field_of_view),
    do: GenServer.cast(device, {:zoom, field_of_view})
end
