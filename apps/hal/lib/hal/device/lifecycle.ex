defmodule Hal.Device.Lifecycle do
  @moduledoc false
  # Describes what a device does with its driver: opens it, reopens it after a failure, judges its signs of
  # life, arms and drives the wheels. Runs in the device's process.
  alias Hal.Twist
  alias Hal.Device.Arming
  alias Hal.Device.{Confirmation, Liveness, Obedience, Publisher, State}

  @retry_ms 100
  @longest_retry_ms 5_000
  # So much later than it was due, this process has been asleep, as when its machine was frozen.
  @asleep_ms 100
  # Time for what was sent meanwhile, and is old, and for the first new report.
  @patience_ms 250

  @doc """
  Opens the driver; after an error it schedules another attempt, by a message `{:open, ref}`.
  """
  @spec open(State.t()) :: State.t()
  def open(s) do
    case s.driver.init(s.options) do
      {:ok, inner} ->
        signs = Liveness.new(s.kind, s.sonar?, State.now(s))
        s = %{s | inner: {:open, inner}, signs: signs, obedience: Obedience.opened(s.obedience)}
        %{s | due_ms: nil, patient_ms: nil} |> judge() |> listen()

      {:error, reason} ->
        s |> Publisher.health({:offline, reason}) |> Publisher.arming() |> retry()
    end
  end

  @doc "Closes a driver that failed, reports the failure, and schedules the reopening."
  @spec fail(State.t(), reason :: term(), inner :: term()) :: State.t()
  def fail(s, reason, inner) do
    s.driver.terminate(inner)
    s = Publisher.health(%{unguard(s) | inner: :closed}, {:offline, reason})
    s = if s.arming, do: become(s, Arming.lost(s.arming, reason)), else: s
    s |> Confirmation.closed() |> retry()
  end

  defp retry(s) do
    ref = make_ref()
    wait_ms = s.retry_ms || @retry_ms
    Process.send_after(self(), {:open, ref}, wait_ms)
    %{s | retry: ref, retry_ms: min(2 * wait_ms, @longest_retry_ms)}
  end

  @doc "Takes the result of a call to the driver: its new state, or an error."
  @spec done(State.t(), {:ok, term()} | {:error, term(), term()}) :: State.t()
  def done(s, {:ok, inner}), do: %{s | inner: {:open, inner}}
  def done(s, {:error, reason, inner}), do: fail(s, reason, inner)

  @doc """
  Takes what readings say of the device itself: what it refuses or has done, and what is odd about
  it; returns the others. Refusals and oddities are published.
  """
  @spec remarks(State.t(), [term()]) :: {[term()], State.t()}
  def remarks(%{inner: {:open, inner}} = s, readings) do
    {odd, readings} = Enum.split_with(readings, &match?({:odd, line} when is_binary(line), &1))
    s = Enum.reduce(odd, s, fn {:odd, line}, s -> Publisher.odd(s, line) end)

    {readings, told, obedience} =
      Obedience.heard(s.obedience, readings, reach(s, inner), State.now(s))

    s = %{s | obedience: obedience}
    for request <- told, do: Publisher.refusal(s, request, obedience.refusals[request])
    {readings, s}
  end

  defp reach(%{kind: :ptz, driver: driver}, inner),
    do: if(function_exported?(driver, :reach, 1), do: driver.reach(inner))

  defp reach(_s, _inner), do: nil

  @doc """
  Takes readings: updates the signs of life and the measured speed, and resets the wait after the
  next failure to the shortest one.
  """
  @spec measured(State.t(), [term(), ...]) :: State.t()
  def measured(s, readings) do
    arming = s.arming && Enum.reduce(readings, s.arming, &Arming.measured(&2, &1))
    signs = Liveness.heard(s.signs, readings, State.now(s))
    %{s | arming: arming, signs: signs, retry_ms: nil}
  end

  @doc """
  Judges whether the device is online, and whether a drive's wheels may turn. Wheels that may no
  longer turn are stopped before anything is published. A process that was asleep itself cannot say that
  its device was silent: it then listens for a moment before it judges.
  """
  @spec judge(State.t()) :: State.t()
  def judge(%{inner: {:open, _}} = s) do
    now_ms = Hal.Clock.now_ms()

    cond do
      s.due_ms != nil and now_ms - s.due_ms > @asleep_ms ->
        listen(%{s | patient_ms: now_ms + @patience_ms})

      s.patient_ms != nil and now_ms < s.patient_ms ->
        s

      true ->
        judged(%{s | patient_ms: nil})
    end
  end

  def judge(s), do: s

  defp judged(%{inner: {:open, inner}} = s) do
    case {Liveness.judge(s.signs, State.now(s)), s.kind} do
      {:online, _kind} -> s |> Publisher.health(obeys(s)) |> stood() |> ready()
      {:waiting, _kind} -> ready(s)
      {{:offline, :silent}, :drive} -> s |> ready() |> silent()
      {{:offline, reason}, _kind} -> fail(s, reason, inner)
    end
  end

  defp obeys(s) do
    case Obedience.judge(s.obedience, s.kind) do
      :ok -> :online
      {:error, fault} -> {:offline, fault}
    end
  end

  # Releasing the emergency button of a base must not set it going.
  defp stood(%{kind: :drive, obedience: %{late?: true}} = s),
    do: become(s, Arming.stood(s.arming))

  defp stood(s), do: s

  # The stop may have failed, and closed the driver.
  defp silent(%{inner: {:open, _}} = s), do: Publisher.health(s, {:offline, :silent})
  defp silent(s), do: s

  # A driver may become ready while it is open, or report that something else is missing.
  defp ready(%{kind: :drive} = s), do: become(s, Arming.ready(s.arming, readiness(s)))
  defp ready(s), do: s

  @doc """
  Schedules the next judgement by a message `{:listen, ref}`, because silence causes no message.
  """
  @spec listen(State.t()) :: State.t()
  def listen(%{inner: {:open, _}} = s) do
    ref = make_ref()
    at_ms = State.now(s)
    now_ms = Hal.Clock.now_ms()
    wait_ms = Liveness.next_ms(s.signs, at_ms) - at_ms
    wait_ms = if s.patient_ms, do: max(s.patient_ms - now_ms, 1), else: wait_ms
    Process.send_after(self(), {:listen, ref}, wait_ms)
    %{s | listening: ref, due_ms: now_ms + wait_ms}
  end

  def listen(s), do: s

  @doc "Carries out a person's order for the wheels, and answers it."
  @spec order(State.t(), Arming.order()) :: {:ok | {:error, line :: String.t()}, State.t()}
  def order(s, order) do
    by_person? = s.arming.by_person?
    {answer, arming} = Arming.order(s.arming, order, readiness(s))
    s = become(s, arming)

    if arming.by_person? != by_person?,
      do: Publisher.hand_on(s, {:disarmed, arming.by_person?})

    {carried_out(order, answer, s), s}
  end

  # The stop that is part of disarming may itself find that the line is lost.
  defp carried_out(:disarm, :ok, %{inner: :closed, arming: %{state: {:error, reason}}} = s),
    do: {:error, "the line was lost (#{Publisher.words(s, reason)}) while the wheels turned"}

  defp carried_out(_order, answer, _s), do: answer

  # What a person can repair is reported before what may resolve itself.
  defp readiness(%{inner: {:open, inner}} = s) do
    driver = if function_exported?(s.driver, :ready, 1), do: s.driver.ready(inner), else: :ok
    with :ok <- driver, do: Liveness.ready(s.signs, State.now(s))
  end

  defp readiness(%{health: {{:offline, reason}, _since}} = s),
    do: {:error, "the drive is offline (#{Publisher.words(s, reason)})"}

  defp readiness(_not_opened_yet), do: {:error, "the drive is not open yet"}

  # Wheels that may no longer turn are stopped before anything is published.
  defp become(%{arming: before} = s, arming) do
    s = %{s | arming: arming}
    stop? = before.state == :armed and arming.state != :armed and s.inner != :closed
    Publisher.arming(if stop?, do: drive_on(s, Twist.zero()), else: s)
  end

  @doc """
  Takes a requested speed, and gives the driver that speed or, unless the drive is armed, a stop.
  """
  @spec drive(State.t(), Twist.t()) :: State.t()
  def drive(s, twist) do
    {allowed, arming} = Arming.drive(s.arming, twist)
    if arming.refused > s.arming.refused, do: Publisher.refused(s, arming)
    drive_on(%{s | arming: arming}, allowed)
  end

  @doc "Gives the driver a speed, and restarts the watchdog."
  @spec drive_on(State.t(), Twist.t()) :: State.t()
  def drive_on(%{inner: {:open, inner}} = s, twist) do
    s = guard(s, twist)

    case s.driver.drive(twist, inner) do
      {:ok, inner} ->
        obedience = Obedience.told(s.obedience, twist)
        %{s | inner: {:open, inner}, arming: Arming.told(s.arming, twist), obedience: obedience}

      {:error, reason, inner} ->
        fail(s, reason, inner)
    end
  end

  # Stops wheels that have received no further speed for 500 ms: the second line of defence behind the gate. Its message
  # `{:watchdog, ref}` counts only while `ref` is the one in the state.

  @watchdog_ms 500

  # Restarts the watchdog for a speed that is given now; a stop only ends it.
  defp guard(s, twist) do
    s = unguard(s)

    if Twist.zero?(twist) do
      s
    else
      ref = make_ref()
      %{s | watchdog: {Process.send_after(self(), {:watchdog, ref}, @watchdog_ms), ref}}
    end
  end

  # Ends the watchdog.
  defp unguard(%{watchdog: nil} = s), do: s

  defp unguard(%{watchdog: {timer, _ref}} = s) do
    Process.cancel_timer(timer)
    %{s | watchdog: nil}
  end
end
