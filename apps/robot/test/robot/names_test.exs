defmodule Robot.NamesTest do
  use Robot.Case, async: false

  # A process that has this role until it is killed.
  defp holder(robot, role, value \\ nil) do
    test = self()

    pid =
      spawn(fn ->
        send(test, {self(), Names.register(robot, role, value)})
        receive(do: (:never -> :ok))
      end)

    assert_receive {^pid, answer}, 10_000
    {pid, answer}
  end

  test "a role has one process, with the value that it gave, until it ends" do
    {first, :ok} = holder(:names1, :board, :first)
    assert Names.lookup(:names1, :board) == {first, :first}
    assert {_second, {:error, {:already_registered, ^first}}} = holder(:names1, :board)
    assert Names.robots() -- [:names1] == Names.robots()

    # A successor need not wait until the registry knows.
    Process.exit(first, :kill)
    ref = Process.monitor(first)
    assert_receive {:DOWN, ^ref, :process, _pid, _reason}, 10_000
    {third, :ok} = holder(:names1, :board, :third)
    assert Names.lookup(:names1, :board) == {third, :third}
    assert {{:names1, :board}, third} in Names.all()
  end

  test "it is a name for processes" do
    name = Names.via(:names2, :robot)
    assert Names.whereis(:names2, :robot) == nil
    assert {:noproc, _call} = catch_exit(GenServer.call(name, :hello))
    assert GenServer.cast(name, :hello) == :ok

    {:ok, named} = Agent.start_link(fn -> 8 end, name: name)
    assert Agent.start_link(fn -> 9 end, name: name) == {:error, {:already_started, named}}
    assert Agent.get(name, & &1) == 8
    assert :names2 in Names.robots()
    assert named in Names.all(:robot)
    :ok = Agent.stop(named)
    assert Names.whereis(:names2, :robot) == nil
  end
end
