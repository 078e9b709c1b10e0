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

  describe "a fleet" do
    alias Vm.Fleet

    defp about(name, main), do: %{name: name, vm: [], main: main}

    test "starts nodes beside each other, asks them, and tells what the last words of one were" do
      fleet = Fleet.new(tell: self(), mark: "test-#{System.pid()}")
      say = ["said\n"]
      main = &Vm.call(&1, :os, :getpid, [])
      ^fleet = Fleet.start(fleet, for(name <- [:one, :two], do: about(name, main)))
      assert %{one: one, two: two} = Fleet.await(fleet)
      assert to_string(one) == Fleet.vm(fleet, :one).pid
      assert_receive {Fleet, :two, {:up, %Vm{}, ^two}, _at_us}

      assert Fleet.call(fleet, :two, System, :get_env, ["VM_FLEET"]) ==
               "test-#{System.pid()}.two.1"

      Fleet.call(fleet, :one, :io, :put_chars, [String.duplicate("x", 9_000) <> "\n"])
      Fleet.call(fleet, :one, :io, :put_chars, say)
      Fleet.kill(fleet, :one)
      assert_receive {Fleet, :one, {:down, "said", 1}, _at_us}, 60_000
      assert Fleet.vm(fleet, :one) == nil
      Fleet.kill(fleet, :two)
      assert_receive {Fleet, :two, {:down, "none", 1}, _at_us}, 60_000

      # What has ended stays so until it is started again, with what it is to do then.
      :ok = Fleet.revive(fleet, :one, fn _vm -> :again end)
      assert Fleet.await(fleet, [:one]) == %{one: :again}
      %{pid: pid} = Fleet.vm(fleet, :one)
      assert Fleet.stop(fleet) == :ok
      assert state(pid) == "gone"
    end

    test "starts a node again for ever, if it is to, and tells of a start that failed" do
      fleet =
        Fleet.start(Fleet.new(tell: self(), again_ms: 100), [about(:one, fn _vm -> :ok end)])

      assert_receive {Fleet, :one, {:up, first, :ok}, _at_us}, 60_000
      Vm.signal(first, "KILL")
      assert_receive {Fleet, :one, {:down, "none", 1}, _at_us}, 60_000
      assert_receive {Fleet, :one, {:up, second, :ok}, _at_us}, 60_000
      assert second.pid != first.pid
      :ok = Fleet.revive(fleet, :one, fn vm -> Vm.call(vm, :erlang, :exit, [:broken]) end)
      assert_receive {Fleet, :one, {:failed, reason}, _at_us}, 60_000
      assert inspect(reason) =~ "broken"
      assert {:error, ^reason} = Fleet.outcome(fleet, :one)
      Fleet.start(fleet, [%{about(:two, fn _vm -> :ok end) | vm: [through: ["false"]]}])
      assert {:error, {:no_vm, _reason}} = Fleet.outcome(fleet, :two)
      for _ <- 1..2, do: assert_receive({Fleet, :two, {:failed, {:no_vm, _}}, _at_us}, 60_000)
      Fleet.stop(fleet)
    end

    test "ends with the process that made it, however that ends" do
      me = self()

      {_owner, monitor} =
        spawn_monitor(fn ->
          fleet = Fleet.start(Fleet.new(), [about(:one, fn _vm -> :ok end)])
          %{one: :ok} = Fleet.await(fleet)
          send(me, {:pid, Fleet.vm(fleet, :one).pid})
        end)

      assert_receive {:pid, pid}, 60_000
      assert_receive {:DOWN, ^monitor, :process, _owner, :normal}
      await(pid, ["gone"])
    end

    if File.exists?("/proc/self/stat") do
      test "freezes all of a node, lets it go on, and ends one that is frozen" do
        fleet = Fleet.start(Fleet.new(), [about(:one, fn _vm -> :ok end)])
        assert Fleet.await(fleet) == %{one: :ok}
        %{pid: pid} = Fleet.vm(fleet, :one)
        Fleet.freeze(fleet, :one)
        assert state(pid) == "T"
        Fleet.thaw(fleet, :one)
        assert is_list(Fleet.call(fleet, :one, :erlang, :processes, [], 60_000))
        Fleet.freeze(fleet, :one)
        assert Fleet.stop(fleet) == :ok
        assert state(pid) == "gone"
      end
    end
  end
end
