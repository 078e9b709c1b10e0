defmodule Hal.Serial.DeviceTest do
  use ExUnit.Case, async: true
  import Hal.Lines
  alias Hal.{Device, Serial, Twist}
  @moduletag :realtime

  @stop "\eSTOP\r"

  setup do
    Process.flag(:trap_exit, true)
    link = Path.join(folder(), "line")
    options = [port: link, last_words: @stop, keep_alive_ms: 60_000]

    settings = [
      kind: :drive,
      driver: {Hal.SerialDrive, options},
      sinks: [{Kernel, :send, [self()]}]
    ]

    {:ok, link: link, settings: settings}
  end

  defp plug_in(link) do
    far = far!(link)
    forget()
    reports(far)
  end

  # What is said before the line is opened, nobody hears.
  defp reports(far, left \\ 1_000) do
    :ok = Serial.write(far, <<12>>)

    receive do
      {:health, :drive, {:online, _}} -> far
    after
      20 -> if left == 0, do: flunk("it is not online"), else: reports(far, left - 1)
    end
  end

  defp forget do
    receive do
      {:health, :drive, _} -> forget()
    after
      0 -> :ok
    end
  end

  test "comes back by itself, however it went", %{link: link, settings: settings} do
    device = start_supervised!({Device, settings})
    assert_receive {:health, :drive, {{:offline, :enoent}, _}}

    for {signal, at_far_end} <- [KILL: {:exit, 137}, TERM: :terminated, KILL: {:exit, 137}] do
      far = plug_in(link)
      Device.drive(device, Twist.new(0.25, 0.0))
      assert read(far, 5) == "0.25\r"
      :ok = Serial.write(far, <<24>>)
      assert_receive {:power, 24.0}
      kill(signal, os_pid(far))
      assert_receive {:health, :drive, {{:offline, :unplugged}, _}}
      # The stop may have come before it: the device's own, when no further speed was asked for.
      assert last(far) == {:error, at_far_end}
      :ok = Serial.close(far)
      File.rm(link)
    end

    # Nor does it fall when the line's program is shot from under it.
    far = plug_in(link)
    {:links, links} = Process.info(device, :links)
    [port] = Enum.filter(links, &is_port/1)
    {:os_pid, program} = Port.info(port, :os_pid)
    kill(:KILL, program)
    assert_receive {:health, :drive, {{:offline, {:exit, 137}}, _}}
    reports(far)

    :ok = stop_supervised({Device, :drive})
    read_until(far, @stop)
  end

  defp last(line) do
    case next(line) do
      {:data, _} -> last(line)
      error -> error
    end
  end

  test "waits for a line that another one has", %{link: link, settings: settings} do
    far = far!(link)
    {:ok, other} = Serial.open(port: link)
    start_supervised!({Device, settings})
    assert_receive {:health, :drive, {{:offline, :ebusy}, _}}
    :ok = Serial.close(other)
    reports(far)
  end
end
