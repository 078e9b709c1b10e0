defmodule Hal.Device.Server do
  @moduledoc false
  # Runs the process of a device (`Hal.Device`): it receives messages and decides the order of the work,
  # which `Hal.Device.Lifecycle` does.
  use GenServer
  alias Hal.Device.Arming
  alias Hal.Device.{Confirmation, Lifecycle, Obedience, Publisher, State}
  alias Hal.Twist

  @rest_ms 500

  @impl GenServer
  def init(%State{} = s) do
    # So that `terminate/2` runs, and stops the wheels, when the supervisor stops this process.
    Process.flag(:trap_exit, true)

    # Its signs of life must not wait behind others: a line that misses them for 0.2 s is lost. Pictures are not its business.
    if s.kind != :camera, do: Process.flag(:priority, :high)
    {:ok, s |> keep_disarmed() |> succeed(), {:continue, :open}}
  end

  defp keep_disarmed(%{disarmed: {m, f, a}, arming: %Arming{} = arming} = s),
    do: if(apply(m, f, a), do: %{s | arming: Arming.keep_disarmed(arming)}, else: s)

  defp keep_disarmed(s), do: s

  # The last status that the sinks know of the previous process, which may have been killed: whatever
  # it was, its wheels are disarmed now.
  defp succeed(%{was: nil} = s), do: s

  defp succeed(%{was: {m, f, a}} = s) do
    case apply(m, f, a) do
      {:online, _since_ms} = health -> Publisher.fallen(%{s | health: health})
      nil -> s
      health -> Publisher.arming(%{s | health: health})
    end
  end

  @impl GenServer
  def handle_continue(:open, s), do: {:noreply, open(s)}

  defp open(s), do: s |> Lifecycle.open() |> ask() |> remind()

  @impl GenServer
  def handle_call(:arming, _from, s), do: {:reply, s.arming, s}

  def handle_call({:arm, until_ms}, _from, s) do
    {answer, s} = order(s, :arm, until_ms)
    {:reply, answer, s}
  end

  def handle_call(order, _from, s) when order in [:disarm, :acknowledge] do
    {answer, s} = order(s, order)
    {:reply, answer, s}
  end

  @impl GenServer
  def handle_cast({:drive, %Twist{} = twist}, %{kind: :drive} = s) do
    # A speed is valid only now.
    if s.inner == :closed, do: {:noreply, s}, else: {:noreply, Lifecycle.drive(s, twist)}
  end

  def handle_cast({:disarm, then}, %{kind: :drive} = s) do
    {_answer, s} = Lifecycle.order(s, :disarm)
    with {m, f, a} <- then, do: apply(m, f, a)
    {:noreply, s}
  end

  def handle_cast({:order, order, until_ms, {m, f, a}}, s) do
    {answer, s} = order(s, order, until_ms)
    apply(m, f, a ++ [answer])
    {:noreply, s}
  end

  def handle_cast({:confirm, within_ms, reply}, %{kind: :drive} = s),
    do: {:noreply, Confirmation.ask(s, within_ms, reply)}

  def handle_cast({:look, pan, tilt}, %{kind: :ptz} = s),
    do: {:noreply, keep(s, :look, [pan, tilt])}

  def handle_cast({:zoom, angle}, %{kind: :ptz} = s),
    do: {:noreply, keep(s, :zoom, [angle])}

  @impl GenServer
  def handle_info({:open, ref}, %{retry: ref} = s), do: {:noreply, open(%{s | retry: nil})}
  def handle_info({:open, _old}, s), do: {:noreply, s}

  def handle_info({:watchdog, ref}, %{watchdog: {_timer, ref}, inner: {:open, _}} = s) do
    Publisher.watchdog(s)
    {:noreply, Lifecycle.drive_on(s, Twist.zero())}
  end

  def handle_info({:watchdog, _old}, s), do: {:noreply, s}

  def handle_info({:unconfirmed, ref}, s), do: {:noreply, Confirmation.late(s, ref)}

  def handle_info({:listen, ref}, %{listening: ref, inner: {:open, _}} = s),
    do: {:noreply, s |> Lifecycle.judge() |> Lifecycle.listen()}

  def handle_info({:listen, _old}, s), do: {:noreply, s}

  def handle_info(message, %{inner: {:open, inner}} = s) do
    case s.driver.handle_message(message, inner) do
      {:ok, readings, inner} ->
        {readings, s} = Lifecycle.remarks(%{s | inner: {:open, inner}}, readings)
        {:noreply, take(s, readings)}

      {:error, reason, inner} ->
        {:noreply, Lifecycle.fail(s, reason, inner)}
    end
  end

  # For a driver that is closed by now.
  def handle_info(_late, s), do: {:noreply, s}

  defp take(s, []), do: Lifecycle.judge(s)

  defp take(s, readings) do
    for reading <- readings, do: Publisher.hand_on(s, reading)

    s
    |> Confirmation.heard(readings)
    |> Lifecycle.measured(readings)
    |> Lifecycle.judge()
    |> ask()
  end

  # The caller has been told by then that nothing was done, and may stand in front of the
  # robot.
  defp order(s, order, until_ms) do
    if Hal.Clock.now_ms() < until_ms,
      do: order(s, order),
      else: {{:error, "the drive answers too late"}, s}
  end

  defp order(%{kind: :drive} = s, order), do: Lifecycle.order(s, order)
  defp order(s, _order), do: {{:error, "a #{s.kind} has no wheels that could be armed"}, s}

  @impl GenServer
  def terminate(reason, s) do
    with {:open, inner} <- s.inner, do: s.driver.terminate(inner)

    unless asked?(reason) do
      Publisher.fallen(%{s | inner: :closed})
      rest()
    end
  end

  defp asked?(reason) when reason in [:normal, :shutdown], do: true
  defp asked?({:shutdown, _why}), do: true
  defp asked?(_crash), do: false

  # A shutdown requested meanwhile is not delayed.
  defp rest do
    receive do
      {:EXIT, _parent, :shutdown} -> :ok
    after
      @rest_ms -> :ok
    end
  end

  # Gives a driver the requests other than speeds: the direction and zoom of a pan-tilt unit, and a
  # camera's next picture. The last direction and zoom are kept, and repeated to a reopened driver.

  # Keeps a request, and passes it to the driver if that is open and has this callback.
  defp keep(s, callback, arguments),
    do: carry_out(%{s | requests: Map.put(s.requests, callback, arguments)}, callback)

  # Repeats the kept requests to a driver that has just been opened.
  defp remind(s), do: s.requests |> Map.keys() |> Enum.reduce(s, &carry_out(&2, &1))

  # Asks a camera for its next picture; called once the last one has been passed on.
  defp ask(%{kind: :camera, inner: {:open, inner}} = s),
    do: Lifecycle.done(s, s.driver.next(inner))

  defp ask(s), do: s

  defp carry_out(%{inner: {:open, inner}} = s, callback) do
    arguments = s.requests[callback] ++ [inner]

    if function_exported?(s.driver, callback, length(arguments)),
      do: s |> told(callback) |> Lifecycle.done(apply(s.driver, callback, arguments)),
      else: s
  end

  defp carry_out(s, _callback), do: s

  defp told(%{requests: %{look: [pan, tilt]}} = s, :look),
    do: %{s | obedience: Obedience.told(s.obedience, {pan, tilt})}

  defp told(s, _callback), do: s
end
