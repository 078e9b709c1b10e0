defmodule Agents.ContractNet.AuctionTest do
  use Swarm.Case, async: false
  @moduletag :capture_log
  alias Agents.{ContractNet, Conversation, Envelope, Responder}
  alias Agents.Answerers
  alias Agents.ContractNet.Bidding

  defp bidder(name, cost) do
    options = [service: :tasks, module: Bidding, argument: {Answerers.Carry, cost}]
    child = Supervisor.child_spec({Responder, {name, options}}, restart: :temporary)
    pid = start_supervised!(child, id: name)
    eventually(fn -> pid in Directory.members({:service, :tasks, name}) end)
    {name, :tasks}
  end

  defp auction(task, peers, options \\ []),
    do: ContractNet.auction(task, peers, [from: :base] ++ options)

  test "the cheapest does the task; if nobody can, an error says why" do
    peers = [bidder(:bid_a, 5), bidder(:bid_b, 2), bidder(:bid_c, :infinite)]
    idle = [messages: [], monitored_by: elem(Process.info(self(), :monitored_by), 1)]
    assert auction({:carry, 1}, peers) == {:ok, {:bid_b, :tasks}, {:carried_by, :bid_b}}
    # All of them are free again at once.
    assert {:ok, {:bid_b, :tasks}, _} = auction({:carry, 1}, peers)
    assert auction({:carry, 1}, []) == {:error, :nobody}
    assert auction({:carry, 1}, [{:bid_nobody, :tasks}]) == {:error, :nobody}
    assert auction(:fly, peers, bid_ms: 20, rounds: 2) == {:error, :no_bids}
    assert auction(:raise, peers, bid_ms: 20, rounds: 1) == {:error, :no_bids}

    assert auction({:carry, :fail}, peers, bid_ms: 100) in [
             {:error, :given_up},
             {:error, :no_bids}
           ]

    for {options, peers} <- [
          {[], peers},
          {:junk, peers},
          {[from: "base"], peers},
          {[from: :base, bid_ms: 0], peers},
          {[from: :base, rounds: 5_000_000_000], peers},
          {[from: :base, silence_ms: 1.0e308], peers},
          {[from: :base, speed: 1], peers},
          {[from: :base], :bid_a},
          {[from: :base], [:bid_a | :bid_b]}
        ] do
      assert %ArgumentError{message: line} =
               catch_error(ContractNet.auction({:carry, 1}, peers, options))

      refute line =~ "\n"
    end

    # Nothing is left of what was started.
    eventually(fn -> Process.info(self(), [:messages, :monitored_by]) == idle end)
  end

  test "a robot does one task at a time" do
    [peer] = [bidder(:bid_one, 1)]
    test = self()
    first = Task.async(fn -> auction({:carry, {:tell, test}}, [peer]) end)
    assert_receive {:working, :bid_one, worker}
    assert auction({:carry, 1}, [peer], wait_ms: 100) == {:error, :busy}
    send(worker, :go_on)
    assert {:ok, ^peer, _} = Task.await(first)
    assert {:ok, ^peer, _} = auction({:carry, 1}, [peer])
  end

  test "twenty auctions at once are all done within 5 s, and both bidders are used" do
    peers = [bidder(:bid_many1, 1), bidder(:bid_many2, 2)]
    test = self()
    begun_ms = System.monotonic_time(:millisecond)

    auctions = for _ <- 1..20, do: Task.async(fn -> auction({:carry, {:tell, test}}, peers) end)

    # While one works, the other is used.
    assert_receive {:working, first, worker}
    assert_receive {:working, second, other} when second != first
    for pid <- [worker, other], do: send(pid, :go_on)

    for _ <- 3..20 do
      assert_receive {:working, _robot, worker}
      send(worker, :go_on)
    end

    assert Enum.all?(Task.await_many(auctions), &match?({:ok, _, {:carried_by, _}}, &1))
    assert System.monotonic_time(:millisecond) - begun_ms < 5_000
  end

  test "a winner that dies or falls silent loses the task to the next" do
    [dying, silent, last] = peers = for n <- 1..3, do: bidder(:"bid_lose#{n}", n)
    test = self()

    auction =
      Task.async(fn -> auction({:carry, {:tell, test}}, peers, silence_ms: 300, rounds: 9) end)

    assert_receive {:working, :bid_lose1, first}
    monitor = Process.monitor(first)
    Process.exit(Names.whereis(elem(dying, 0), {:service, :tasks}), :kill)
    # Its work ends with the auction.
    assert_receive {:DOWN, ^monitor, _, _, _}

    assert_receive {:working, :bid_lose2, second}
    monitor = Process.monitor(second)
    # It was silent for too long, so it is told to stop.
    assert_receive {:DOWN, ^monitor, _, _, :killed}
    assert_receive {:working, :bid_lose3, third}
    send(third, :go_on)
    assert Task.await(auction) == {:ok, last, {:carried_by, :bid_lose3}}
    assert {:ok, ^silent, _} = auction({:carry, 1}, [silent])
  end

  test "a bidder refuses junk, which changes nothing" do
    peer = bidder(:bid_junk, 1)

    for {performative, content} <- [
          cfp: :junk,
          cfp: {1, :task},
          cfp: {:x, {:carry, 1}, 500},
          cfp: {1, {:carry, 1}, :soon},
          accept: :junk,
          accept: 7,
          inform: 1
        ] do
      asked = Envelope.new(performative, :stranger, content)
      assert {:ok, %{performative: :refuse}} = Conversation.request(peer, asked)
    end

    for performative <- [:reject, :cancel],
        do: Conversation.tell(peer, Envelope.new(performative, :stranger, :junk))

    send(Names.whereis(:bid_junk, {:service, :tasks}), :junk)
    assert {:ok, ^peer, _} = auction({:carry, 1}, [peer])
  end
end
