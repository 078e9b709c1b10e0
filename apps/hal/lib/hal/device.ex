defmodule Hal.Device do
  @moduledoc """
  The process that runs any driver (`Hal.Drive`, `Hal.Ptz`, `Hal.Camera`): it opens the driver
  after its own start, passes readings on, and reopens the driver after errors.

  Options:

    * `:kind` - `:drive`, `:ptz` or `:camera`
    * `:driver` - `{module, options}`
    * `:sinks` - `[{m, f, a}]`; each reading goes to `apply(m, f, a ++ [reading])`. A change of
      health is the reading `{:health, device, {:online | {:offline, reason}, since_ms}}`
    * `:device` - what it is called in its health, by default its kind
    * `:arm` - of a drive: `:auto` (the default), `:manual` or `:never`, see below
    * `:sonar` - of a drive: whether its base has sonars (default false), without which it is not armed
    * `:was` - `{m, f, a}` that gives the last status of the previous process that its sinks know,
      or `nil`
    * `:about` - a map that its events have beside their own, such as `%{robot: :mag1}`
    * `:name` - as in `GenServer`
    * `:clock` - `{m, f, a}` giving integer milliseconds

  ## Online

  An open driver does not make a device online: if a line is silent, full of noise, or leads to a
  base that never answers, nobody knows where the wheels are. A drive is online once its base has
  reported its wheels since the opening, and as long as it does (`Hal.Device.Reports`); otherwise
  it is offline with the reason `:silent`, although its driver is open and keeps asking. A camera
  is online once it has given a picture, a pan-tilt unit once it has reported where it looks; one
  that gives nothing for 10 s is offline (`:mute`) and is reopened (`Hal.Device.Liveness`).

  ## When a driver fails

  An error that a driver *returns* is expected: the device reports it, closes the driver, and
  tries again after 100 ms, 200 ms, … up to 5 s. The first reading after an opening resets the
  wait to 100 ms, so that a driver that opens and then fails is not reopened ten times a second.

  A driver that *raises* crashes the device, which its supervisor restarts. Before it exits, the
  device closes the driver, reports that it is offline (`:fell`) and disarmed, and waits for 500
  ms, so that a driver that crashes on every message cannot use up the supervisor's restarts, and
  with them the robot's other devices. A device that is killed cannot report anything; its
  successor does so first (`:was`).

  ## Wishes

  A speed for an offline drive is lost, because a speed is valid only now. The last direction for
  a pan-tilt unit is kept, and sent once the unit is online (again).

  ## Wheels

  A drive that receives no speed for 500 ms stops its wheels. This is the second line of defence
  behind the dead man's switch of the gate, in case the gate is gone or stuck.

  The wheels turn only while the drive is armed (`Hal.Device.Arming`): an earlier speed becomes a
  stop, and is counted. With `arm: :auto` the drive arms whenever its driver is open and ready and
  its base's reports are fresh; with `:manual` a person arms it after every start, by `arm/1`;
  with `:never` it stands, as in a dry run. Stale reports stop and disarm it. If the line was lost
  while the wheels turned, `acknowledge/1` is needed first. The reading `{:arming, %{state: state,
  why: line or nil}}` gives the state.
  """
  alias Hal.Twist
  alias Hal.Device.Arming
  alias Hal.Device.{Server, State}

  # On a busy machine a device is slow, not gone; and whoever asks has half a second.
  @call_ms 400

  @type kind :: :drive | :ptz | :camera
  @type status :: {:online | {:offline, reason :: term()}, since_ms :: integer()}

  @doc "Starts the device; it opens its driver afterwards. Wrong options raise `ArgumentError`."
  @spec start_link(keyword()) :: GenServer.on_start()
  def start_link(options) do
    {name, options} = Keyword.split(options, [:name])
    GenServer.start_link(Server, State.new!(options), name)
  end

  @doc "A child of a supervisor; several devices may have the same one."
  @spec child_spec(keyword()) :: Supervisor.child_spec()
  def child_spec(options) do
    id = {__MODULE__, options[:device] || options[:kind]}
    %{id: id, start: {__MODULE__, :start_link, [options]}}
  end

  @doc "Asks a drive for a speed. While it is offline, this is lost."
  @spec drive(GenServer.server(), Twist.t()) :: :ok
  def drive(device, %Twist{} = twist), do: GenServer.cast(device, {:drive, twist})

  @doc """
  Lets the wheels turn. The line says why it does not: what is missing, or that nobody has acknowledged. A
  device of this node only. Where it says that the drive does not answer, it is not armed later either.
  """
  @spec arm(GenServer.server()) :: :ok | {:error, line :: String.t()}
  def arm(device), do: order(device, {:arm, System.monotonic_time(:millisecond) + @call_ms})

  @doc "Stops the wheels, until `arm/1`. The line says that its own line is lost, so that nobody can."
  @spec disarm(GenServer.server()) :: :ok | {:error, line :: String.t()}
  def disarm(device), do: order(device, :disarm)

  @doc """
  The same for those who must not wait: once it is done, the device applies `then`, an `{m, f, a}`, if there is one.
  """
  @spec disarm_later(GenServer.server(), then :: {module(), atom(), list()} | nil) :: :ok
  def disarm_later(device, then \\ nil), do: GenServer.cast(device, {:disarm, then})

  @doc "A person has looked why the line was lost while the wheels turned; then it may be armed."
  @spec acknowledge(GenServer.server()) :: :ok | {:error, line :: String.t()}
  def acknowledge(device), do: order(device, :acknowledge)

  @doc """
  Hands an order to the device for somebody else; the caller does not wait. The device applies `reply`, an `{m, f, a}`, with
  what `arm/1`, `disarm/1` or `acknowledge/1` would have returned as its last argument; never, where it hangs or is gone. An
  order that it comes to at `until_ms` (`System.monotonic_time/1`, ms) or later is not carried out.
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

  @doc "How the drive is armed, with all that `Hal.Device.Arming` counts; `nil` for a device that is not a drive."
  @spec arming(GenServer.server()) :: Arming.t() | nil
  def arming(device), do: GenServer.call(device, :arming)

  defp order(device, order) do
    GenServer.call(device, order, @call_ms)
  catch
    :exit, {_timeout_or_gone, {GenServer, :call, _call}} -> {:error, "the drive does not answer"}
  end

  @doc "Asks a pan-tilt unit to look there (radians, left and up positive)."
  @spec look(GenServer.server(), pan :: float(), tilt :: float()) :: :ok
  def look(device, pan, tilt) when is_float(pan) and is_float(tilt),
    do: GenServer.cast(device, {:look, pan, tilt})

  @doc "Asks a pan-tilt unit to zoom to a horizontal field of view (radians). One that cannot does nothing."
  @spec zoom(GenServer.server(), field_of_view :: float()) :: :ok
  def zoom(device, field_of_view) when is_float(field_of_view),
    do: GenServer.cast(device, {:zoom, field_of_view})
end
