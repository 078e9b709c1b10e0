defmodule Hal.RFlex.LineTest do
  @moduledoc "A device with the driver of real bases on lines with nobody, or nobody of sense, at the other end."
  use ExUnit.Case, async: true
  import Hal.Lines
  alias Hal.{Device, RFlexBase, Serial, Twist}
  @moduletag :realtime

  @conversions [distance: 31_387.0, angle: 4654.2, range: 1474.0]
  @on {:reports, 100_000, 3}

  setup do
    Process.flag(:trap_exit, true)
    link = Path.join(folder(), "line")
    far = far!(link)
    {:ok, link: link, far: far}
  end

  defp device(link, options) do
    defaults = [port: link, conversions: @conversions, ir_banks: [0]]
    driver = {Hal.RFlex.Driver, Keyword.merge(defaults, options)}
    sinks = [{__MODULE__, :tell, [self()]}]
    device = [kind: :drive, driver: driver, sinks: sinks, arm: :manual, sonar: true]
    start_supervised!({Device, device})
  end

  @doc false
  def tell(test, reading), do: send(test, {:reading, reading})

  # For so long: asks for a speed as a gate does, answers what `says` makes of each command, and gives all commands.
  defp play(t, ms, says) do
    play_until(t, System.monotonic_time(:millisecond) + ms, says)
  end

  defp play_until(t, until_ms, says) do
    receive do
      message ->
        case Serial.handle(t.far, message) do
          {:data, bytes} ->
            {commands, rest} = RFlexBase.commands(t.rest <> bytes)
            for command <- commands, bytes = says.(command), do: Serial.write(t.far, bytes)
            play_until(%{t | rest: rest, heard: t.heard ++ commands}, until_ms, says)

          _other ->
            play_until(note(t, message), until_ms, says)
        end
    after
      20 ->
        if t.drives?, do: Device.drive(t.device, Twist.new(0.3, 0.2))
        with bytes when is_binary(bytes) <- says.(:now), do: Serial.write(t.far, bytes)

        if System.monotonic_time(:millisecond) < until_ms,
          do: play_until(t, until_ms, says),
          else: t
    end
  end

  # Until it is so, in steps of 20 ms: a busy machine takes its time.
  defp till(t, says, so?, until_ms \\ now_ms() + 10_000) do
    cond do
      so?.(t) -> t
      now_ms() > until_ms -> flunk("it did not come to pass: #{inspect({t.health, t.arming})}")
      true -> t |> play(20, says) |> till(says, so?, until_ms)
    end
  end

  defp now_ms, do: System.monotonic_time(:millisecond)

  defp note(t, {:reading, {:health, :drive, {health, _since}}}),
    do: %{t | health: t.health ++ [health]}

  defp note(t, {:reading, {:arming, %{state: state}}}), do: %{t | arming: t.arming ++ [state]}
  defp note(t, _other), do: t

  defp begin(link, far, options \\ []) do
    device = device(link, options)
    %{device: device, far: far, rest: <<>>, heard: [], health: [], arming: [], drives?: true}
  end

  defp moves(t),
    do: for({what, speed, _} <- t.heard, what in [:move, :turn], speed != 0, do: speed)

  defp nobody(link, far, says) do
    t = begin(link, far) |> play(700, says)
    assert {:error, line} = Device.arm(t.device)
    assert line =~ "wheels"
    t = till(t, says, &({:offline, :silent} in &1.health))
    # Longer than the driver itself waits, which then begins anew.
    t = play(t, 700, says)
    assert {:error, _line} = Device.arm(t.device)
    assert :online not in t.health
    assert :armed not in t.arming
    assert moves(t) == []
    t
  end

  test "a silent line is not online and not armed", %{link: link, far: far} do
    nobody(link, far, fn _ -> nil end)
  end

  test "noise neither, as of a line of another speed", %{link: link, far: far} do
    :rand.seed(:exsss, {4, 5, 6})
    nobody(link, far, fn what -> if what == :now, do: :rand.bytes(200) end)
  end

  test "a base that says all but where its wheels are neither", %{link: link, far: far} do
    all = for id <- Enum.to_list(0..7) ++ Enum.to_list(16..23), do: {id, 1474}

    t =
      nobody(link, far, fn
        :status -> RFlexBase.status(2450, 0)
        :now -> RFlexBase.sonar(all) <> RFlexBase.input(0x40, 0)
        _other -> nil
      end)

    # It is asked for them all the while.
    again? = fn t -> Enum.count(t.heard, &(&1 == @on)) >= 2 end
    till(t, fn _ -> nil end, again?)
  end

  test "a base that reports is online, is armed, and stopped and disarmed when its reports end",
       %{
         link: link,
         far: far
       } do
    all = for id <- Enum.to_list(0..7) ++ Enum.to_list(16..23), do: {id, 1474}
    counter = :counters.new(1, [])

    reports = fn
      :now ->
        :counters.add(counter, 1, 20)
        RFlexBase.wheels(:counters.get(counter, 1), 100, 100) <> RFlexBase.sonar(all)

      _other ->
        nil
    end

    t = begin(link, far) |> till(reports, &(&1.health != []))
    t = play(t, 200, reports)
    assert t.health == [:online]
    assert moves(t) == []
    assert Device.arm(t.device) == :ok
    t = till(t, reports, &(moves(&1) != []))
    # It goes on with its battery only.
    battery = fn what -> if what == :status, do: RFlexBase.status(2450, 0) end
    off = {{:offline, :silent}, :disarmed}
    t = till(%{t | heard: []}, battery, &({List.last(&1.health), List.last(&1.arming)} == off))
    assert {:error, line} = Device.arm(t.device)
    assert line =~ "wheels"

    # Long after the watchdog of a gate that drives on, nothing but stops. What was on the line before is read late on a
    # busy machine.
    t = play(t, 300, fn _ -> nil end)

    stopped =
      Enum.drop_while(t.heard, &(not match?({what, 0, _} when what in [:move, :turn], &1)))

    assert [_stop | _] = stopped
    assert moves(%{t | heard: stopped}) == []
    t = till(%{t | heard: []}, reports, &(List.last(&1.health) == :online))
    assert moves(play(t, 200, reports)) == []
    assert Device.arm(t.device) == :ok
  end

  test "a speed that is not renewed is over after half a second", %{link: link, far: far} do
    all = for id <- Enum.to_list(0..7) ++ Enum.to_list(16..23), do: {id, 1474}
    counter = :counters.new(1, [])

    reports = fn what ->
      if what == :now do
        :counters.add(counter, 1, 20)
        RFlexBase.wheels(:counters.get(counter, 1), 100, 100) <> RFlexBase.sonar(all)
      end
    end

    t = begin(link, far) |> armed(now_ms() + 5_000, reports)
    t = till(t, reports, &(moves(&1) != []))

    started_ms = now_ms()
    t = stand(%{t | heard: [], drives?: false}, started_ms + 5_000, reports)
    # The last speed was asked for at most so long before.
    assert now_ms() - started_ms >= 400
    assert moves(play(%{t | heard: []}, 300, reports)) == []
    assert List.last(t.arming) == :armed
  end

  defp armed(t, deadline_ms, says) do
    t = play(t, 100, says)

    case Device.arm(t.device) do
      :ok ->
        t

      {:error, line} ->
        if now_ms() > deadline_ms, do: flunk(line), else: armed(t, deadline_ms, says)
    end
  end

  # Until the last word to the wheels is a stop.
  defp stand(t, deadline_ms, says) do
    said = for {what, speed, _} <- t.heard, what in [:move, :turn], do: speed

    cond do
      Enum.take(said, -2) == [0, 0] -> t
      now_ms() > deadline_ms -> flunk("it goes on: #{inspect(said)}")
      true -> t |> play(20, says) |> stand(deadline_ms, says)
    end
  end

  test "without its conversions a base that answers is online, and says what it lacks", %{
    link: link,
    far: far
  } do
    t = begin(link, far, conversions: [range: 1474.0])
    wheels = fn what -> if what == :now, do: RFlexBase.wheels(1, 1, 1) end
    t = till(t, wheels, &(&1.health != []))
    assert t.health == [:online]
    assert {:error, line} = Device.arm(t.device)
    assert line =~ "distance"
  end
end
