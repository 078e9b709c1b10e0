defmodule Hal.Serial.FrozenTest do
  @moduledoc "Only the port program is frozen, not the VM that speaks to it."
  use ExUnit.Case, async: true
  import Hal.Lines
  alias Hal.{Device, RFlexBase, Serial, Twist}
  @moduletag :realtime

  @stop "\eSTOP\r"

  setup do
    Process.flag(:trap_exit, true)
    link = Path.join(folder(), "line")
    far = far!(link)
    {:ok, link: link, far: far}
  end

  # As an owner that lives, every 20 ms, until somebody says that nobody listens.
  defp until_frozen(near, left \\ 1_000) do
    case Serial.keep_alive(near) do
      {:error, :frozen} ->
        :ok

      :ok when left > 0 ->
        receive(do: (:never -> :ok), after: (20 -> until_frozen(near, left - 1)))
    end
  end

  defp freeze(program) do
    # Whatever becomes of the test, nobody is left behind frozen.
    on_exit(fn -> System.cmd("kill", ["-CONT", "#{program}"], stderr_to_stdout: true) end)
    kill(:STOP, program)
    eventually(fn -> frozen?(program) end)
  end

  defp frozen?(program), do: File.read!("/proc/#{program}/stat") =~ ") T "

  test "its owner notices after half a second; thawed it says the last words and nothing old", %{
    link: link,
    far: far
  } do
    {:ok, near} = Serial.open(port: link, last_words: @stop)
    program = os_pid(near)
    freeze(program)
    since_ms = System.monotonic_time(:millisecond)
    for _ <- 1..10, do: :ok = Serial.write(near, "old speed\r")
    :ok = until_frozen(near)
    assert System.monotonic_time(:millisecond) - since_ms >= 500
    # Nobody waits for the answer of one who is frozen.
    :ok = Serial.close(near)
    assert frozen?(program)
    kill(:CONT, program)
    assert read(far, byte_size(@stop)) == @stop
    eventually(fn -> not File.exists?("/proc/#{program}") end)
    {:ok, again} = Serial.open(port: link)
    refute_more(far, again, "nothing old")
  end

  test "an owner that goes on learns after the thaw that the line is lost; nothing of its own is written",
       %{
         link: link,
         far: far
       } do
    {:ok, near} = Serial.open(port: link, last_words: @stop)
    freeze(os_pid(near))
    for _ <- 1..10, do: :ok = Serial.write(near, "old speed\r")
    :ok = until_frozen(near)
    :ok = Serial.write(near, "new speed\r")
    kill(:CONT, os_pid(near))
    assert read(far, byte_size(@stop)) == @stop
    assert next(near) == {:error, :last_words}
    :ok = Serial.close(near)
    assert read(far, byte_size(@stop)) == @stop
    {:ok, again} = Serial.open(port: link)
    refute_more(far, again, "nothing else")
  end

  test "the clock of the stamps is the port program's" do
    assert :erlang.system_info(:os_monotonic_time_source)[:clock_id] == :CLOCK_MONOTONIC
  end

  test "of a base in motion: offline, lost in motion, and after the thaw the brake and no speed",
       %{
         link: link,
         far: far
       } do
    conversions = [distance: 31_387.0, angle: 4654.2]
    bare = [sonar_banks: [0], ir_banks: [0]]
    driver = {Hal.RFlex.Driver, [port: link, conversions: conversions] ++ bare}
    sinks = [{Kernel, :send, [self()]}]
    device = start_supervised!({Device, kind: :drive, driver: driver, sinks: sinks, arm: :manual})
    reporting(device, far, fn _ -> Device.arm(device) == :ok end)
    reporting(device, far, fn heard -> moves(heard) != [] end)

    program = program(device)
    freeze(program)
    # What it had said before is read here and now.
    reporting(device, far, fn _ -> Device.arming(device).state == {:error, :frozen} end)
    assert frozen?(program)
    assert_received {:health, :drive, {{:offline, :frozen}, _}}
    assert {:error, line} = Device.arm(device)
    assert line =~ "acknowledge"

    # What was said last is old by then.
    receive(do: (:never -> :ok), after: (300 -> :ok))
    # It may be online again as soon as it goes on.
    forget()
    kill(:CONT, program)
    eventually(fn -> not File.exists?("/proc/#{program}") end)
    heard = reporting(device, far, fn _ -> program(device) not in [nil, program] end)
    assert :brake in heard
    assert moves(heard) == []
    reporting(device, far, fn _ -> online?() end)
    assert {:error, _line} = Device.arm(device)
  end

  # Of the line that it has open now.
  defp program(device) do
    {:links, links} = Process.info(device, :links)

    with [port | _] <- Enum.filter(links, &is_port/1),
         {:os_pid, pid} <- Port.info(port, :os_pid),
         do: pid,
         else: (_closed -> nil)
  end

  # Drives and reports as a gate and a base do, until it is so; the commands that came.
  defp reporting(device, far, done?, bytes \\ <<>>, n \\ 1) do
    Device.drive(device, Twist.new(0.3, 0.0))
    # Its clock and its way go on, whoever listens.
    {at_ms, _since_last} = :erlang.statistics(:wall_clock)
    :ok = Serial.write(far, RFlexBase.wheels(at_ms, 3 * at_ms, 0, {3000, 0}))
    bytes = bytes <> more(far, System.monotonic_time(:millisecond) + 50)

    {heard, _rest} = RFlexBase.commands(bytes)

    cond do
      done?.(heard) -> heard
      n == 300 -> flunk("it did not come to it: #{inspect(Device.arming(device))}")
      true -> reporting(device, far, done?, bytes, n + 1)
    end
  end

  defp moves(heard), do: for({:move, speed, _} <- heard, speed != 0, do: speed)

  # Without a look at what the device tells.
  defp more(%{line: %{port: port}} = far, until_ms, bytes \\ <<>>) do
    receive do
      {^port, _} = message ->
        case Serial.handle(far, message) do
          {:data, some} -> more(far, until_ms, bytes <> some)
          :unknown -> more(far, until_ms, bytes)
        end
    after
      max(until_ms - System.monotonic_time(:millisecond), 0) -> bytes
    end
  end

  defp online? do
    receive do
      {:health, :drive, {:online, _}} -> true
    after
      0 -> false
    end
  end

  defp forget do
    receive do
      {:health, :drive, _} -> forget()
    after
      0 -> :ok
    end
  end
end
