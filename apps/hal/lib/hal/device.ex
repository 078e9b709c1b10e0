defmodule Hal.Device do
  @moduledoc """
  The one process round any driver (`Hal.Drive`, `Hal.Ptz`, `Hal.Camera`): it opens the driver
  after its own start, hands readings on, and opens again what went wrong.

  Options:

    * `:kind` - `:drive`, `:ptz` or `:camera`
    * `:driver` - `{module, options}`
    * `:sinks` - `[{m, f, a}]`; each reading goes to `apply(m, f, a ++ [reading])`. A change of
      health is the reading `{:health, device, {:online | {:offline, reason}, since_ms}}`
    * `:device` - what it is called in its health, by default its kind
    * `:arm` - of a drive: `:auto` (the default), `:manual` or `:never`, see below
    * `:sonar` - of a drive: whether its base has sonars (default false), without which it is not armed
    * `:was` - `{m, f, a}` that gives the status which its sinks know of the process before it, or `nil`
    * `:about` - a map that its events have beside their own, such as `%{robot: :mag1}`
    * `:name` - as in `GenServer`
    * `:clock` - `{m, f, a}` giving integer milliseconds

  ## Online

  That its driver has opened it makes no device online: of a line that is silent, full of noise, or leads to a base
  that hears and never answers, nobody knows where the wheels are. A drive is online once its base has
  reported its wheels since then, and as long as it does (`Hal.Reports`); it is offline then
  with the reason `:silent`, though its driver is open and goes on asking. A camera is online once it has given a
  picture, a pan-tilt unit once it has said where it looks; one that gives nothing for 10 s is offline (`:mute`) and
  opened again (`Hal.Device.Signs`).

  ## When a driver fails

  An error that a driver *returns* is expected: the device says so, closes the driver, and tries
  again after 100 ms, 200 ms, … up to 5 s. The first reading after an opening brings the wait back
  to 100 ms, so that a driver that opens well and then fails is not reopened ten times a second.

  A driver that *raises* takes the device down, which its supervisor restarts. It closes the
  driver, says that it is offline (`:fell`) and disarmed, and rests for 500 ms before it goes, so that a driver
  which falls over every message cannot use up the supervisor's restarts, and with them the robot's other devices.
  A device that is killed can say nothing; the one that follows says it first (`:was`).

  ## Wishes

  Wheels that are offline do not hear what is asked of them: a speed is for now. A pan-tilt unit
  is asked where to look; once it is (again) online, its device tells it the last of that.

  ## Wheels

  A drive that hears no speed for 500 ms stops its wheels. This is the second line behind the
  dead man's switch of whoever drives, for the case that this one is gone or stuck.

  They turn only while the drive is armed (`Hal.Arming`): what is asked for before is a stop, and
  counted. With `arm: :auto` the drive arms whenever its driver is open and ready and its base's reports are
  fresh; with `:manual` a person does, after every start, by `arm/1`; with `:never` it stands, as in a dry run.
  Reports that grow old stop and disarm it. If the line is lost while they turn, `acknowledge/1`
  comes first. How it stands is the reading `{:arming, %{state: state, why: line or nil}}`.
  """
  use GenServer
  alias Hal.{Arming, Event, Twist}
  alias Hal.Device.{Options, Signs, Words}

  @retry_ms 100
  @longest_retry_ms 5_000
  @watchdog_ms 500
  @rest_ms 500
  # On a busy machine a device is slow, not gone; and whoever asks has half a second.
  @call_ms 400

  @enforce_keys [:kind, :device, :driver, :options, :sinks, :clock]
  defstruct @enforce_keys ++
              [
                inner: :closed,
                health: nil,
                retry_ms: @retry_ms,
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

  @type kind :: :drive | :ptz | :camera
  @type status :: {:online | {:offline, reason :: term()}, since_ms :: integer()}

  @doc "Starts the device; it opens its driver afterwards. Wrong options raise `ArgumentError`."
  @spec start_link(keyword()) :: GenServer.on_start()
  def start_link(options) do
    {name, options} = Keyword.split(options, [:name])
    GenServer.start_link(__MODULE__, new!(options), name)
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

  @doc "How the drive is armed, with all that `Hal.Arming` counts; `nil` for what is no drive."
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

  @impl GenServer
  def init(device) do
    # So that `terminate/2` runs, and stops the wheels, when the supervisor ends us.
    Process.flag(:trap_exit, true)
    {:ok, succeed(device), {:continue, :open}}
  end

  @impl GenServer
  def handle_continue(:open, s), do: {:noreply, open(s)}

  @impl GenServer
  def handle_call(:arming, _from, s), do: {:reply, s.arming, s}

  # Whoever asked has been told by now that nothing came of it, and may stand before the robot.
  def handle_call({:arm, until_ms}, from, s) do
    if System.monotonic_time(:millisecond) < until_ms,
      do: handle_call(:arm, from, s),
      else: {:reply, {:error, "the drive answers too late"}, s}
  end

  def handle_call(order, _from, %{kind: :drive} = s)
      when order in [:arm, :disarm, :acknowledge] do
    {answer, arming} = Arming.order(s.arming, order, readiness(s))
    s = become(s, arming)
    {:reply, carried_out(order, answer, s), s}
  end

  def handle_call(order, _from, s) when order in [:arm, :disarm, :acknowledge],
    do: {:reply, {:error, "a #{s.kind} has no wheels that could be armed"}, s}

  @impl GenServer
  def handle_cast({:drive, twist}, %{kind: :drive, inner: {:open, _}} = s) do
    {allowed, arming} = Arming.drive(s.arming, twist)
    if arming.refused > s.arming.refused, do: tell_refused(s, arming)
    {:noreply, drive_on(%{s | arming: arming}, allowed)}
  end

  def handle_cast({:disarm, then}, %{kind: :drive} = s) do
    {:ok, arming} = Arming.order(s.arming, :disarm, readiness(s))
    s = become(s, arming)
    with {m, f, a} <- then, do: apply(m, f, a)
    {:noreply, s}
  end

  def handle_cast({:look, pan, tilt}, %{kind: :ptz} = s),
    do: {:noreply, wish(s, :look, [pan, tilt])}

  def handle_cast({:zoom, angle}, %{kind: :ptz} = s), do: {:noreply, wish(s, :zoom, [angle])}

  def handle_cast(_command, s), do: {:noreply, s}

  @impl GenServer
  def handle_info({:open, ref}, %{retry: ref} = s), do: {:noreply, open(%{s | retry: nil})}
  def handle_info({:open, _old}, s), do: {:noreply, s}

  def handle_info({:watchdog, ref}, %{watchdog: {_timer, ref}, inner: {:open, _}} = s) do
    Event.execute([:hal, :device, :watchdog], %{at_ms: now(s)}, about(s))
    {:noreply, drive_on(s, Twist.zero())}
  end

  def handle_info({:watchdog, _old}, s), do: {:noreply, s}

  def handle_info({:listen, ref}, %{listening: ref, inner: {:open, _}} = s),
    do: {:noreply, s |> judge() |> listen()}

  def handle_info({:listen, _old}, s), do: {:noreply, s}

  def handle_info(message, %{inner: {:open, inner}} = s) do
    case s.driver.handle_message(message, inner) do
      {:ok, [], inner} ->
        {:noreply, judge(%{s | inner: {:open, inner}})}

      {:ok, readings, inner} ->
        for reading <- readings, do: hand_on(s, reading)
        s = %{s | inner: {:open, inner}, retry_ms: @retry_ms}
        {:noreply, s |> measured(readings) |> judge() |> ask()}

      {:error, reason, inner} ->
        {:noreply, fail(s, reason, inner)}
    end
  end

  # What a driver that is closed by now had asked for.
  def handle_info(_late, s), do: {:noreply, s}

  @impl GenServer
  def terminate(reason, s) do
    with {:open, inner} <- s.inner, do: s.driver.terminate(inner)

    case reason do
      :normal ->
        :ok

      :shutdown ->
        :ok

      {:shutdown, _} ->
        :ok

      _crash ->
        fallen(%{s | inner: :closed})
        rest()
    end
  end

  # What the sinks know of the process before us, which may have been killed.
  defp succeed(%{was: nil} = s), do: s

  defp succeed(%{was: {m, f, a}} = s) do
    case apply(m, f, a) do
      {:online, _since_ms} = health -> fallen(%{s | health: health})
      health -> %{s | health: health}
    end
  end

  # The wheels were stopped, by the driver's last act or by the end of its line.
  defp fallen(s) do
    s = report(s, {:offline, :fell})
    line = words(s, :fell)
    if s.arming, do: tell_arming(%{s | arming: Arming.ready(s.arming, {:error, line})}), else: s
  end

  # A shutdown asked for meanwhile is not kept waiting.
  defp rest do
    receive do
      {:EXIT, _parent, :shutdown} -> :ok
    after
      @rest_ms -> :ok
    end
  end

  defp open(s) do
    case s.driver.init(s.options) do
      {:ok, inner} ->
        signs = Signs.new(s.kind, s.sonar?, now(s))
        %{s | inner: {:open, inner}, signs: signs} |> judge() |> listen() |> ask() |> remind()

      {:error, reason} ->
        s |> report({:offline, reason}) |> tell_arming() |> retry()
    end
  end

  defp drive_on(%{inner: {:open, inner}} = s, twist) do
    s = guard(s, twist)

    case s.driver.drive(twist, inner) do
      {:ok, inner} -> %{s | inner: {:open, inner}, arming: Arming.told(s.arming, twist)}
      {:error, reason, inner} -> fail(s, reason, inner)
    end
  end

  # Whether anything is there, and a drive's wheels may turn. Those that may no longer are stopped before
  # anybody is told.
  defp judge(%{inner: {:open, _}} = s) do
    case {Signs.judge(s.signs, now(s)), s.kind} do
      {:online, _kind} -> s |> report(:online) |> ready()
      {:waiting, _kind} -> ready(s)
      {{:offline, :silent}, :drive} -> s |> ready() |> silent()
      {{:offline, reason}, _kind} -> mute(s, reason)
    end
  end

  defp judge(s), do: s

  defp mute(%{inner: {:open, inner}} = s, reason), do: fail(s, reason, inner)

  # Its last stop may have failed.
  defp silent(%{inner: {:open, _}} = s), do: report(s, {:offline, :silent})
  defp silent(s), do: s

  # Silence sends no message.
  defp listen(%{inner: {:open, _}} = s) do
    ref = make_ref()
    at_ms = now(s)
    Process.send_after(self(), {:listen, ref}, Signs.next_ms(s.signs, at_ms) - at_ms)
    %{s | listening: ref}
  end

  defp listen(s), do: s

  # A driver may become ready while it is open, or tell another thing that is missing.
  defp ready(%{kind: :drive} = s), do: become(s, Arming.ready(s.arming, readiness(s)))
  defp ready(s), do: s

  # What a person can mend comes before what may come by itself.
  defp readiness(%{inner: {:open, inner}} = s) do
    driver = if function_exported?(s.driver, :ready, 1), do: s.driver.ready(inner), else: :ok
    with :ok <- driver, do: Signs.ready(s.signs, now(s))
  end

  defp readiness(%{health: {{:offline, reason}, _since}} = s),
    do: {:error, "the drive is offline (#{words(s, reason)})"}

  defp readiness(_not_opened_yet), do: {:error, "the drive is not open yet"}

  defp measured(s, readings) do
    arming = s.arming && Enum.reduce(readings, s.arming, &Arming.measured(&2, &1))
    %{s | arming: arming, signs: Signs.heard(s.signs, readings, now(s))}
  end

  # The stop that a disarming begins with may itself be what finds the line lost.
  defp carried_out(:disarm, :ok, %{inner: :closed, arming: %{state: {:error, reason}}} = s),
    do: {:error, "the line was lost (#{words(s, reason)}) while the wheels turned"}

  defp carried_out(_order, answer, _s), do: answer

  # Wheels that may no longer turn stop before anybody is told.
  defp become(%{arming: before} = s, arming) do
    s = %{s | arming: arming}
    stop? = before.state == :armed and arming.state != :armed and s.inner != :closed
    tell_arming(if stop?, do: drive_on(s, Twist.zero()), else: s)
  end

  defp tell_arming(%{arming: %{state: state, why: why}, armed_as: {state, why}} = s), do: s
  defp tell_arming(%{kind: kind} = s) when kind != :drive, do: s

  defp tell_arming(%{arming: %{state: state, why: why}} = s) do
    reading = %{state: state, why: why}
    {was, _why} = s.armed_as || {:disarmed, nil}
    about = s |> about() |> Map.merge(reading) |> Map.merge(%{was: was, line: lost(s, state)})
    Event.execute([:hal, :device, :arming], %{at_ms: now(s)}, about)
    hand_on(s, {:arming, reading})
    %{s | armed_as: {state, why}}
  end

  defp lost(s, {:error, reason}), do: words(s, reason)
  defp lost(_s, _not_lost), do: nil

  defp tell_refused(s, %{refused: refused}) do
    measured = %{at_ms: now(s), refused: refused}
    Event.execute([:hal, :device, :refused], measured, about(s))
  end

  defp done(s, {:ok, inner}), do: %{s | inner: {:open, inner}}
  defp done(s, {:error, reason, inner}), do: fail(s, reason, inner)

  defp fail(s, reason, inner) do
    s.driver.terminate(inner)
    s = report(%{unguard(s) | inner: :closed}, {:offline, reason})
    retry(if s.arming, do: become(s, Arming.lost(s.arming, reason)), else: s)
  end

  defp retry(s) do
    ref = make_ref()
    Process.send_after(self(), {:open, ref}, s.retry_ms)
    %{s | retry: ref, retry_ms: min(2 * s.retry_ms, @longest_retry_ms)}
  end

  # A camera gives its next picture only once the last one was handed on.
  defp ask(%{kind: :camera, inner: {:open, inner}} = s), do: done(s, s.driver.next(inner))
  defp ask(s), do: s

  defp wish(s, callback, arguments),
    do: carry_out(%{s | wishes: Map.put(s.wishes, callback, arguments)}, callback)

  # Where a pan-tilt unit was to look before it failed, or while nobody was there.
  defp remind(s), do: s.wishes |> Map.keys() |> Enum.reduce(s, &carry_out(&2, &1))

  defp carry_out(%{inner: {:open, inner}} = s, callback) do
    arguments = s.wishes[callback] ++ [inner]

    if function_exported?(s.driver, callback, length(arguments)),
      do: done(s, apply(s.driver, callback, arguments)),
      else: s
  end

  defp carry_out(s, _callback), do: s

  defp guard(s, twist) do
    s = unguard(s)

    if Twist.zero?(twist) do
      s
    else
      ref = make_ref()
      %{s | watchdog: {Process.send_after(self(), {:watchdog, ref}, @watchdog_ms), ref}}
    end
  end

  defp unguard(%{watchdog: nil} = s), do: s

  defp unguard(%{watchdog: {timer, _ref}} = s) do
    Process.cancel_timer(timer)
    %{s | watchdog: nil}
  end

  defp report(%{health: {condition, _since}} = s, condition), do: s

  defp report(s, condition) do
    at_ms = now(s)
    health = {condition, since(s.health, condition, at_ms)}
    hand_on(s, {:health, s.device, health})

    case condition do
      :online ->
        about = Map.put(about(s), :again?, s.health != nil)
        Event.execute([:hal, :device, :online], %{at_ms: at_ms}, about)

      {:offline, reason} ->
        about = s |> about() |> Map.merge(%{reason: reason, line: words(s, reason)})
        Event.execute([:hal, :device, :offline], %{at_ms: at_ms}, about)
    end

    %{s | health: health}
  end

  # Another reason to be offline is no new beginning.
  defp since({{:offline, _}, since_ms}, {:offline, _}, _at_ms), do: since_ms
  defp since(_before, _condition, at_ms), do: at_ms

  defp hand_on(s, reading), do: for({m, f, a} <- s.sinks, do: apply(m, f, a ++ [reading]))

  defp about(s), do: Map.merge(s.about, %{device: s.device, driver: s.driver})

  defp words(s, reason), do: Words.offline({s.driver, s.options}, reason)

  defp now(%{clock: {m, f, a}}), do: apply(m, f, a)

  defp new!(options), do: struct!(__MODULE__, Options.check!(options))
end
