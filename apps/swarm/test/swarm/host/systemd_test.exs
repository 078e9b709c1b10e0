defmodule Swarm.Host.SystemdTest do
  use ExUnit.Case, async: true
  alias Swarm.Host.Systemd

  doctest Systemd

  # The same as systemd's: a datagram socket. Its path must be short.
  setup do
    path = Path.join(System.tmp_dir!(), "n#{System.pid()}-#{System.unique_integer([:positive])}")
    {:ok, socket} = :gen_udp.open(0, [:local, :binary, ifaddr: {:local, path}])
    on_exit(fn -> File.rm(path) end)
    %{path: path, socket: socket}
  end

  defp start(path, pulse) do
    pulses = start_supervised!({Agent, fn -> pulse end})

    options = [
      socket: path,
      robot: :mag1,
      period_ms: 10,
      pulse: fn :mag1 -> Agent.get(pulses, & &1) end
    ]

    start_supervised!(%{id: Systemd, start: {Systemd, :start_link, [options]}})
    pulses
  end

  defp said(socket) do
    assert_receive {:udp, ^socket, _address, _port, text}
    String.split(text, "\n", trim: true)
  end

  defp await(socket, lines), do: if(said(socket) != lines, do: await(socket, lines), else: :ok)

  test "it is ready once, then alive as long as the robot is well", %{path: path, socket: socket} do
    pulses = start(path, {true, "mag1 is disarmed"})
    assert said(socket) == ["READY=1", "WATCHDOG=1", "STATUS=mag1 is disarmed"]
    assert said(socket) == ["WATCHDOG=1", "STATUS=mag1 is disarmed"]

    Agent.update(pulses, fn _ -> {false, "mag1: its gate\nis gone"} end)
    await(socket, ["STATUS=mag1: its gate is gone"])
    # There is no sign of life from then on.
    for _ <- 1..5, do: assert(said(socket) == ["STATUS=mag1: its gate is gone"])

    Agent.update(pulses, fn _ -> {true, "mag1 is armed"} end)
    await(socket, ["WATCHDOG=1", "STATUS=mag1 is armed"])
  end

  test "a robot that does not exist yet is not ready", %{path: path, socket: socket} do
    pulses = start(path, {false, "mag1 is not there"})
    assert said(socket) == ["STATUS=mag1 is not there"]
    Agent.update(pulses, fn _ -> {true, "mag1 is disarmed"} end)
    await(socket, ["READY=1", "WATCHDOG=1", "STATUS=mag1 is disarmed"])
  end

  test "a supervisor that is gone for a while is notified again", %{path: path, socket: socket} do
    start(path, {true, "mag1 is disarmed"})
    assert ["READY=1" | _] = said(socket)
    :gen_udp.close(socket)
    File.rm!(path)
    {:ok, socket} = :gen_udp.open(0, [:local, :binary, ifaddr: {:local, path}])
    assert said(socket) == ["WATCHDOG=1", "STATUS=mag1 is disarmed"]
  end

  test "an abstract socket works, too" do
    name = "convoy-#{System.unique_integer([:positive])}-#{System.pid()}"
    {:ok, socket} = :gen_udp.open(0, [:local, :binary, ifaddr: {:local, <<0>> <> name}])
    start("@" <> name, {true, "mag1 is disarmed"})
    assert ["READY=1" | _] = said(socket)
  end

  test "the watchdog of another process is not ours" do
    environment = %{"NOTIFY_SOCKET" => "/n", "WATCHDOG_USEC" => "400000", "WATCHDOG_PID" => "8"}
    assert Systemd.from_env(environment, nil, "7")[:period_ms] == 1_000
    assert Systemd.from_env(environment, nil, "8")[:period_ms] == 100
    for wrong <- ["", "-1", "x", "0"], do: assert(period(wrong) == 1_000)
    assert period("1") == 10
    assert period("999999999999") == 1_000
  end

  defp period(usec) do
    Systemd.from_env(%{"NOTIFY_SOCKET" => "/n", "WATCHDOG_USEC" => usec}, nil, "7")[:period_ms]
  end
end
