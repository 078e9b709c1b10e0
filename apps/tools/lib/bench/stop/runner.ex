defmodule Bench.Stop.Runner do
  @moduledoc false
  # Carries out the cases of `Bench.Stop`: an emulated base with a wire tap at one end of a
  # pseudo-terminal, a robot in a VM of its own at the other. Times are microseconds from before the
  # cause is triggered, so that they include the path to it; for a crash they count from the crash
  # itself, and for a bumper from the base's report of it.
  alias Bench.Stop
  alias Bench.Stop.{Robot, WireTap}
  alias Sim.Emulator

  @full 0.5
  # The speed that the base is told then, in its own units.
  @fast 15_000
  @patience_ms 5_000
  @look_ms 300
  @rest_ms 1_000
  @call_ms 30_000
  # In which it reaches full speed.
  @roll_ms 5_000

  @typedoc """
  The results of one case: times to the stop (`nil` if none came), how often the robot rolled
  again by itself within 0.3 s, and, for a pulled line, after what time the driver knew of it.
  """
  @type result :: %{
          case: Stop.case(),
          times: [number() | nil],
          rolled: non_neg_integer(),
          known: [number()]
        }

  @doc "Measures each case so many times; `note` is called with the progress."
  @spec run([Stop.case()], pos_integer(), Path.t(), (String.t() -> term())) :: [result()]
  def run(cases, count, folder, note) do
    link = Path.join(folder, "base")
    tap = {WireTap, to: self(), kind: :magellan}
    {:ok, emulator} = Emulator.start_link(core: tap, link: link)
    free = List.duplicate(5.1, 16)
    :ok = Emulator.change(emulator, :feel, [{:sonar, free}, Hal.Clock.now_ms()])
    s = %{emulator: emulator, link: link, vm: nil}

    {results, s} =
      Enum.map_reduce(cases, s, fn case, s ->
        {trials, s} =
          Enum.map_reduce(1..count, s, fn n, s ->
            note.("#{case.says}, #{n} of #{count}")
            {stop, s} = trial(case.name, s |> robot() |> rolling())
            {stop, s}
          end)

        times = Enum.map(trials, & &1.took_us)
        rolled = Enum.count(trials, & &1.rolled?)
        known = for %{known_us: us} <- trials, do: us
        {%{case: case, times: times, rolled: rolled, known: known}, s}
      end)

    _gone = halt(s)
    GenServer.stop(emulator)
    results
  end

  defp robot(%{vm: nil} = s) do
    s = %{s | vm: Vm.start_one(flags: ["+S", "1:1", "+sbwt", "none"])}
    :ok = call(s, Robot, :main, [s.link])
    s
  end

  defp robot(s), do: s

  defp halt(%{vm: nil} = s), do: s

  defp halt(%{vm: vm} = s) do
    :ok = Vm.stop(vm)
    %{s | vm: nil}
  end

  defp call(s, m, f, a), do: Vm.call(s.vm, m, f, a, @call_ms)

  # Waits for full speed, and for a time that is not in step with the ticks.
  defp rolling(s) do
    roll(s, Hal.Clock.now_ms() + @call_ms)

    receive do
    after
      :rand.uniform(200) -> s
    end
  end

  # A robot that got no processor for half a second has heard nothing of its base meanwhile, and has
  # disarmed it; only an order arms it again.
  defp roll(s, until_ms) do
    :ok = call(s, Robot, :arm, [])
    :ok = call(s, Robot, :roll, [@full])

    cond do
      speed(&(&1 >= @fast), @roll_ms) -> :ok
      Hal.Clock.now_ms() < until_ms -> roll(s, until_ms)
      true -> exit(:does_not_roll)
    end
  end

  defp trial(:crash, s) do
    stop = stop(fn -> call(s, Robot, :crash, []) end)
    # A robot whose processes crash four times in 5 s is given up.
    speed(fn _any -> false end, @rest_ms)
    {stop, s}
  end

  defp trial(:frozen, s) do
    stop = stop(fn -> timed(fn -> call(s, Robot, :freeze, [true]) end) end)
    :ok = call(s, Robot, :freeze, [false])
    {stop, s}
  end

  defp trial(:kill, s) do
    fire = signaller(s.vm.pid, "KILL")
    stop = stop(fn -> timed(fire) end)
    {stop, halt(s)}
  end

  defp trial(:freeze, s) do
    fire = signaller(s.vm.pid, "STOP")
    stop = stop(fn -> timed(fire) end)
    Vm.signal(s.vm, "CONT")
    :ok = call(s, Robot, :thawed, [])
    {stop, s}
  end

  defp trial(:estop, s) do
    stop = stop(fn -> timed(fn -> call(s, Swarm, :estop, []) end) end)
    :ok = call(s, Swarm, :reset, [])
    {stop, s}
  end

  # A robot that is touched moves away, so it is right that it rolls backwards then.
  defp trial(:bumper, s) do
    stop =
      stop(fn ->
        :ok = touch(s, [0])
        reported()
      end)

    touch(s, [])
    {%{stop | rolled?: false}, s}
  end

  defp trial(:pull, s) do
    forget()
    pulled_us = WireTap.now_us()
    :ok = Emulator.unplug(s.emulator)
    known_us = call(s, Robot, :offline, [pulled_us]) - pulled_us
    stop = stop(fn -> timed(fn -> Emulator.plug(s.emulator) end) end)
    # Its wheels were turning when the line was lost: only a person makes them turn again.
    {:error, _reason} = call(s, Robot, :arming, [])
    :ok = call(s, Robot, :acknowledge, [])
    :ok = call(s, Robot, :arm, [])
    {Map.put(stop, :known_us, known_us), s}
  end

  # A shell that waits before it sends the signal: starting one takes long on a busy machine, and
  # is not part of a stop.
  defp signaller(pid, signal) do
    script = "echo ready; read go; kill -#{signal} #{pid}"
    options = [:binary, :exit_status, args: ["-c", script]]
    port = Port.open({:spawn_executable, "/bin/sh"}, options)
    receive do: ({^port, {:data, _ready}} -> :ok)

    fn ->
      Port.command(port, "go\n")
      receive do: ({^port, {:exit_status, 0}} -> :ok)
    end
  end

  defp touch(s, pressed) do
    at_ms = Hal.Clock.now_ms()
    :ok = Emulator.change(s.emulator, :feel, [{:bumpers, pressed}, at_ms])
  end

  defp reported do
    receive do
      {:wire, {:input, _address, low}, at_us} when low != 0 -> at_us
    after
      @patience_ms -> exit(:no_report)
    end
  end

  defp timed(cause) do
    at_us = WireTap.now_us()
    _done = cause.()
    at_us
  end

  # The cause says when the time starts.
  defp stop(cause) do
    forget()
    since_us = cause.()

    case zero(since_us, %{}) do
      nil -> %{took_us: nil, rolled?: false}
      at_us -> %{took_us: at_us - since_us, rolled?: speed(&(&1 != 0), @look_ms) != nil}
    end
  end

  # Both axes were told to stop, one after the other.
  defp zero(_since_us, %{0 => 0, 1 => 0, :at => at_us}), do: at_us

  defp zero(since_us, told) do
    receive do
      {:wire, {:speed, _axis, _counts}, at_us} when at_us < since_us ->
        zero(since_us, told)

      {:wire, {:speed, axis, counts}, at_us} ->
        zero(since_us, Map.merge(told, %{axis => counts, :at => at_us}))
    after
      @patience_ms -> nil
    end
  end

  # When the wheels were told such a speed, if within this time.
  defp speed(such?, ms), do: speed_until(such?, Hal.Clock.now_ms() + ms)

  defp speed_until(such?, until_ms) do
    receive do
      {:wire, {:speed, 0, counts}, at_us} ->
        if such?.(counts), do: at_us, else: speed_until(such?, until_ms)

      {:wire, _other, _at_us} ->
        speed_until(such?, until_ms)
    after
      max(until_ms - Hal.Clock.now_ms(), 0) -> nil
    end
  end

  defp forget do
    receive do
      {:wire, _event, _at_us} -> forget()
    after
      0 -> :ok
    end
  end
end
