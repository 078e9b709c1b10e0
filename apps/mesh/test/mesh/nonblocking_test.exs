defmodule Mesh.NonblockingTest do
  use ExUnit.Case, async: true
  alias Mesh.{Nonblocking, SafeTable}
  doctest SafeTable

  @tag :capture_log
  test "a call to a process that is not there, or that ends over it, is one line" do
    assert Nonblocking.call(:nobody_has_this_name, :x, "the box") ==
             {:error, "the box does not answer"}

    {:ok, agent} = Agent.start(fn -> 1 end)
    monitor = Process.monitor(agent)
    # An agent that is asked what agents are not asked falls.
    assert Nonblocking.call(agent, :x, "the box") == {:error, "the box does not answer"}
    # On a busy machine it falls when the call has been given up.
    assert_receive {:DOWN, ^monitor, :process, ^agent, _reason}
    refute Process.alive?(agent)
  end

  test "a table is read as long as it is there" do
    table = :ets.new(:"post_test_#{System.unique_integer([:positive])}", [:named_table])
    :ets.insert(table, {:a, 1})
    assert SafeTable.lookup(table, :a) == [{:a, 1}]
    assert SafeTable.lookup(table, :b) == []
    assert SafeTable.select(table, [{{:"$1", 1}, [], [:"$1"]}]) == [:a]
    :ets.delete(table)
    assert SafeTable.lookup(table, :a) == []
    assert SafeTable.select(table, [{{:"$1", 1}, [], [:"$1"]}]) == []
  end
end
