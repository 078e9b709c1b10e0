defmodule VmTest do
  use ExUnit.Case, async: true
  @moduletag :realtime

  # How a process of the operating system is: running, stopped, or gone.
  defp state(pid) do
    case File.read("/proc/#{pid}/stat") do
      {:ok, stat} -> stat |> String.split(") ") |> List.last() |> String.first()
      {:error, _none} -> "gone"
    end
  end

  defp await(pid, states, deadline \\ System.monotonic_time(:millisecond) + 10_000) do
    cond do
      state(pid) in states -> :ok
      System.monotonic_time(:millisecond) > deadline -> flunk("#{pid} is #{state(pid)}")
      true -> receive(do: (:never -> :ok), after: (10 -> await(pid, states, deadline)))
    end
  end

  test "it has this build's code, its own flags and environment, and applications as configured" do
    vm = Vm.start_one(flags: ["+S", "1:1"], env: [{"COLOUR", "yellow"}])
    assert vm.node == :nonode@nohost
    assert Vm.call(vm, :erlang, :system_info, [:schedulers]) == 1
    assert Vm.call(vm, System, :get_env, ["COLOUR"]) == "yellow"
    :ok = Vm.start_apps(vm, [:logger], logger: [level: :error])
    assert Vm.call(vm, Logger, :level, []) == :error
    assert Vm.call(vm, :code, :which, [Vm]) == :code.which(Vm)

    # Also the protocols as this build consolidated them: what looks for others asks all folders each time.
    assert Protocol.consolidated?(Enumerable)
    assert Vm.call(vm, :code, :which, [Enumerable]) == :code.which(Enumerable)
    assert Vm.call(vm, :os, :getpid, []) == to_charlist(vm.pid)
    assert Vm.stop(vm) == :ok
    assert state(vm.pid) == "gone"
    assert Vm.signal(vm, "KILL") == :ok
  end

  test "all end with the process that started them" do
    me = self()
    {owner, monitor} = spawn_monitor(fn -> send(me, {:vms, Vm.start([[], []])}) end)
    assert_receive {:vms, [_one, _two] = vms}, 60_000
    assert_receive {:DOWN, ^monitor, :process, ^owner, :normal}
    for vm <- vms, do: await(vm.pid, ["gone"])
  end

  if File.exists?("/proc/self/stat") do
    test "a frozen one ends with the VM that started it, which is killed" do
      starter = Vm.start_one()
      {:ok, child} = Vm.call(starter, Agent, :start, [Vm, :start_one, []], 60_000)
      %{pid: pid} = Vm.call(starter, :sys, :get_state, [child])
      Vm.signal(pid, "STOP")
      await(pid, ["T"])
      Vm.signal(starter, "KILL")
      await(pid, ["gone", "Z"])
    end
  end

  test "behind a port it prints to its owner, and its end comes with a status" do
    say = ["-noshell", "-eval", ~s|io:put_chars("ready\\n"), halt(3).|]
    assert {:ok, port, pid} = Vm.open(say, [])
    assert is_integer(pid)
    assert_receive {^port, {:exit_status, 3}}, 60_000
    assert_received {^port, {:data, "ready\n"}}
  end
end
