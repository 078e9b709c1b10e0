defmodule Swarm.Order.FreshnessTest do
  use Swarm.Case, async: false
  @moduletag :capture_log
  alias Swarm.Order.Freshness

  defp say(id, role, request) do
    ref = :erlang.alias([:reply])
    message = Tuple.insert_at(request, tuple_size(request), ref)
    GenServer.cast(Names.whereis(id, role), message)
    receive(do: ({^ref, answer} -> answer))
  end

  defp order(id, role, request, stamp) do
    ref = :erlang.alias([:reply])
    GenServer.cast(Names.whereis(id, role), {:command, request, ref, stamp})
    receive(do: ({^ref, answer} -> answer))
  end

  # What an order carries that was given so long ago.
  defp ago({life, at_us}, ms), do: {life, at_us - 1_000 * ms}

  test "an order is obeyed for half a second after it was given" do
    id = robot(:stamp_old, comms: [boot: 7])
    assert {7, at_us} = stamp = say(id, :comms, {:stamp})
    assert order(id, :comms, {:goto, 1.0, 1.0, nil}, stamp) == :ok
    assert {:error, line} = order(id, :comms, {:goto, 2.0, 1.0, nil}, ago(stamp, 20_000))

    assert line =~
             ~r/^stamp_old got this command too late, 20.\d s old; at most 0.5 s are allowed; repeat it$/

    far = at_us + 60_000_000

    for stamp <- [{6, at_us}, {7, far}, :junk, {7, self()}, "text", {7, 1.5}, {:asked, :now}] do
      assert {:error, line} = order(id, :comms, {:goto, 2.0, 1.0, nil}, stamp)
      assert line =~ "stamp_old got this command too late"
    end

    assert %{rejected: %{too_old: 8}} = Swarm.status(id)
    # At any age.
    assert order(id, :comms, :stop, ago(stamp, 20_000)) == :ok
    assert order(id, :estop, :stop, ago(stamp, 20_000)) == :ok
    assert {:ok, _} = order(id, :comms, :ping, ago(stamp, 20_000))
    assert order(id, :comms, {:goto, 2.0, 1.0, nil}, say(id, :comms, {:stamp})) == :ok
  end

  test "an order that was given before a stop and arrives after it moves nothing" do
    id = robot(:stamp_stop, comms: [boot: 7])

    for stop <- [:stop, :disarm] do
      before = say(id, :comms, {:stamp})
      assert order(id, :estop, stop, nil) == :ok
      assert {:error, line} = order(id, :comms, {:goto, 1.0, 1.0, nil}, before)
      assert line == "stamp_stop was stopped after this command was sent; repeat it"
      assert {:ok, %{state: :idle}, _at_ms} = Board.fetch(Board.find!(id), :mission, :infinity)
    end

    assert order(id, :comms, :arm, say(id, :comms, {:stamp})) == :ok
    assert order(id, :comms, {:goto, 1.0, 1.0, nil}, say(id, :comms, {:stamp})) == :ok
  end

  test "a reset does not release a robot that was stopped after it was given" do
    id = robot(:stamp_reset)
    [to_estop, to_comms] = for role <- [:estop, :comms], do: say(id, role, {:stamp})
    assert order(id, :estop, :estop, nil) == :ok
    # A relayed reset arrives at the comms process.
    for {role, stamp} <- [estop: to_estop, comms: to_comms] do
      assert {:error, line} = order(id, role, :reset, stamp)
      assert line == "stamp_reset was stopped after this command was sent; repeat it"
    end

    for {role, stamp} <- [estop: to_estop, comms: to_comms] do
      assert {:error, "stamp_reset got this command too late" <> _} =
               order(id, role, :reset, ago(stamp, 5_000))
    end

    assert Board.latched?(Board.find!(id))
    assert order(id, :comms, :reset, say(id, :comms, {:stamp})) == :ok
    refute Board.latched?(Board.find!(id))
    assert order(id, :estop, :estop, nil) == :ok
    assert order(id, :estop, :reset, say(id, :estop, {:stamp})) == :ok
    assert %{rejected: %{too_old: 4}} = Swarm.status(id)
  end

  test "an order after a stop is not refused because a stamp was slow" do
    # Stopped at 0, ordered at 1 ms, the stamp made at 41 ms; its way back took 30 ms.
    {:ok, order} = Freshness.given(Freshness.stamp(7, 41_000), 70_000)
    assert {:ok, _given} = Freshness.check(7, order, 90_000, 0)
    # The way there took as long: nobody knows which came first.
    {:ok, order} = Freshness.given(Freshness.stamp(7, 41_000), 100_000)
    assert Freshness.check(7, order, 90_000, 0) == {:error, :stopped}

    for junk <- [nil, {7, 1.0}, {:a, 1}, {7, 1, 1}],
        do: assert(Freshness.given(junk, 0) == :error)
  end

  test "only an order from another node, or one that says when it was given, can be too old" do
    assert Freshness.judge(1, :start, nil, true, 5, nil) == {:error, :unknown}
    assert Freshness.judge(1, :start, {:asked, 4}, true, 5, nil) == {:ok, 4}
    assert Freshness.judge(1, :start, nil, false, 5, nil) == {:error, :unknown}
    assert Freshness.judge(1, :start, {:asked, 4}, false, 5, nil) == {:error, :unknown}
    assert Freshness.judge(1, :start, {1, 4}, true, 5, nil) == {:ok, 4}
    assert Freshness.judge(1, :stop, {1, 4}, false, 5, nil) == {:ok, 5}
    assert Freshness.judge(1, {:estop, {:a, 1, 1}}, nil, false, 5, nil) == {:ok, 5}
  end

  test "no number in an order changes what becomes of the next one" do
    last = 0xFFFFFFFFFFFFFFFF

    for life <- [1, 0, last], at_us <- [6, last, -last, 10_000_000_000] do
      assert Freshness.judge(1, :start, {life, at_us}, false, 5, nil) != {:ok, at_us}
      assert Freshness.judge(1, :stop, {life, at_us}, false, 5, nil) == {:ok, 5}
      assert Freshness.judge(1, :start, {1, 4}, false, 5, nil) == {:ok, 4}
    end
  end

  test "of two robots with one name that hear each other, the later gives way, and can still be stopped" do
    id = robot(:stamp_twin, comms: [boot: 1_000])
    :ok = listen(id, [:swarm, :comms, :duplicate_id])
    comms = Names.whereis(id, :comms)
    assert Comms.rival(id, {1, node()}) == :ok
    assert Comms.rival(id, {1_001, :twin@far}) == :ok
    assert {:ok, _} = Swarm.ask(id, :ping)
    assert Directory.members({:robot, id}) == [comms]

    assert Comms.rival(id, {999, :twin@far}) == :ok
    assert_receive {[:swarm, :comms, :duplicate_id], %{other: :twin@far}}
    eventually(fn -> Directory.members({:robot, id}) == [] end)
    eventually(fn -> Directory.members({:estop, id}) == [] end)
    assert {:ok, %{state: :idle}, _} = Board.fetch(Board.find!(id), :mission, :infinity)
    Swarm.estop()
    eventually(fn -> Board.latched?(Board.find!(id)) end)
    :ok = Gate.reset(id)
    Swarm.reset()

    # The next comms process claims the name again, and so does the e-stop process.
    kill(id, :comms)
    eventually(fn -> Directory.members({:estop, id}) == [Names.whereis(id, :estop)] end)
  end
end
