defmodule Swarm.Commands.FreshnessTest do
  use Swarm.Case, async: false
  @moduletag :capture_log
  alias Swarm.Commands.Freshness

  # A robot whose time and ticks are the test's.
  defp timed(id, options \\ []) do
    clock = :counters.new(1, [])
    options = Keyword.merge([clock: {:counters, :get, [clock, 1]}, pace: :manual], options)
    {robot(id, options), clock}
  end

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

  test "a command is obeyed for 2 s after the heartbeat that it names" do
    {id, clock} = timed(:stamp_old, link: [boot: 7])
    assert {7, n} = stamp = say(id, :comms, {:stamp})
    assert say(id, :comms, {:stamp}) == stamp
    :counters.put(clock, 1, 2_000)
    assert order(id, :comms, {:goto, 1.0, 1.0, nil}, stamp) == :ok
    :counters.put(clock, 1, 20_000)
    assert {:error, line} = order(id, :comms, {:goto, 2.0, 1.0, nil}, stamp)

    assert line ==
             "stamp_old got this too late, 20.0 s old; at most 2 s are allowed, say it again"

    for stamp <- [{6, n}, {7, n + 1}, {7, -1}, :junk, {7, self()}, "text", {7, 1.5}] do
      assert {:error, line} = order(id, :comms, {:goto, 2.0, 1.0, nil}, stamp)
      assert line =~ "stamp_old got this too late"
    end

    assert %{rejected: %{too_old: 8}} = Swarm.status(id)
    # At any age.
    assert order(id, :comms, :stop, stamp) == :ok
    assert order(id, :estop, :stop, stamp) == :ok
    assert {:ok, _} = order(id, :comms, :ping, stamp)
    assert order(id, :comms, {:goto, 2.0, 1.0, nil}, say(id, :comms, {:stamp})) == :ok
  end

  test "a reset that comes late does not release what was stopped meanwhile" do
    {id, clock} = timed(:stamp_reset)
    stamp = say(id, :estop, {:stamp})
    :counters.put(clock, 1, 5_000)
    assert order(id, :estop, :estop, nil) == :ok
    assert {:error, "stamp_reset got this too late" <> _} = order(id, :estop, :reset, stamp)
    assert Board.latched?(Board.find!(id))
    # It comes to the link where it was relayed.
    assert {:error, _} = order(id, :comms, :reset, stamp)
    assert order(id, :comms, :reset, say(id, :comms, {:stamp})) == :ok
    refute Board.latched?(Board.find!(id))
    assert %{rejected: %{too_old: 2}} = Swarm.status(id)
  end

  test "heartbeats are remembered, 32 of them, and those who ask push none out" do
    sent = Enum.reduce(1..40, Freshness.new(1), &Freshness.sent(&2, &1, 100 * &1))
    assert Freshness.check(sent, {1, 40}, 4_000) == :ok
    assert Freshness.check(sent, {1, 9}, 4_000) == {:error, 3_100}
    assert Freshness.check(sent, {1, 8}, 4_000) == {:error, :unknown}

    {_stamp, asked} =
      Enum.reduce(1..100, {nil, sent}, fn _, {_, s} -> Freshness.issue(s, 4_100) end)

    assert asked == sent
  end

  test "only what comes from another node, or says how old it is, can be too old" do
    sent = Freshness.new(1)
    assert Freshness.judge(sent, :start, make_ref(), nil, 0) == :ok
    assert Freshness.judge(sent, :start, make_ref(), {1, 1}, 0) == {:error, :unknown}
    assert Freshness.judge(sent, :stop, make_ref(), {1, 1}, 0) == :ok
    assert Freshness.judge(sent, {:estop, {:a, 1, 1}}, make_ref(), {1, 1}, 0) == :ok
  end

  test "of two of one name heard by radio the later one gives way, and can still be stopped" do
    id = robot(:stamp_twin, link: [boot: 1_000])
    :ok = listen(id, [:swarm, :comms, :duplicate_id])
    link = Names.whereis(id, :comms)
    assert Comms.rival(id, {1, node()}) == :ok
    assert Comms.rival(id, {1_001, :twin@far}) == :ok
    assert {:ok, _} = Swarm.ask(id, :ping)
    assert Directory.members({:robot, id}) == [link]

    assert Comms.rival(id, {999, :twin@far}) == :ok
    assert_receive {[:swarm, :comms, :duplicate_id], %{other: :twin@far}}
    assert Directory.members({:robot, id}) == []
    eventually(fn -> Directory.members({:estop, id}) == [] end)
    assert {:ok, %{state: :idle}, _} = Board.fetch(Board.find!(id), :mission, :infinity)
    Swarm.estop()
    eventually(fn -> Board.latched?(Board.find!(id)) end)
    :ok = Gate.reset(id)
    Swarm.reset()

    # The next link claims the name again, and the brake with it.
    kill(id, :comms)
    eventually(fn -> Directory.members({:estop, id}) == [Names.whereis(id, :estop)] end)
  end
end
