defmodule Agents.ContractNet.MachinesTest do
  use ExUnit.Case, async: true
  doctest Agents.ContractNet.Cost
  alias Agents.ContractNet.{Bidder, Cost, Manager}

  defp start(peers, options \\ []), do: Manager.start(:task, peers, options, 0)

  # Runs letters through a manager: {peer, performative, content, at_ms}.
  defp heard(manager, letters) do
    Enum.reduce(letters, {manager, []}, fn {peer, what, content, at}, {m, _sent} ->
      Manager.hear(m, peer, what, content, at)
    end)
  end

  test "a cost is the weighted sum of time, energy and the rest" do
    assert Cost.of(path: 6, speed: 0.5) == 12.0
    assert Cost.of([path: 6, speed: 0.5, energy: 10, other: 3], energy: 0.5, other: 2) == 23.0
    assert Cost.of([path: 0, speed: 0, other: 1], other: 1) == 1

    for bad <- [[path: 1], [path: 1, speed: nil], [path: 1, speed: 1, energy: :infinite]],
        do: assert(Cost.of(bad) == :infinite)

    assert_raise ArgumentError, fn -> Cost.of(way: 1) end
  end

  test "all are asked; the lowest cost wins, among equals the first name; the others are told" do
    {m, letters} = start([:b, :a, :c])
    assert letters == for(p <- [:a, :b, :c], do: {p, :cfp, {1, :task, 500}})

    {m, []} = heard(m, [{:c, :propose, {1, 5}, 10}, {:b, :propose, {1, 5.0}, 20}])
    {m, letters} = Manager.hear(m, :a, :refuse, {1, :busy}, 30)
    assert letters == [{:b, :accept, 1}, {:c, :reject, 1}]
    {m, []} = heard(m, [{:b, :agree, 1, 40}, {:b, :inform, {1, :progress, :half}, 4_000}])
    assert {^m, []} = Manager.tick(m, 8_000)
    {m, []} = Manager.hear(m, :b, :inform, {1, :done, :result}, 8_500)
    assert m.outcome == {:ok, :b, :result}
    assert {^m, []} = Manager.tick(m, 99_999)
  end

  test "nobody waits for silent peers; a late bid, or one of another round, is rejected" do
    {m, _} = start([:a, :b])
    {m, []} = Manager.hear(m, :b, :propose, {1, 9}, 10)
    assert {^m, []} = Manager.tick(m, 499)
    {m, [{:b, :accept, 1}]} = Manager.tick(m, 500)
    assert {^m, [{:a, :reject, 1}]} = Manager.hear(m, :a, :propose, {1, 1}, 510)
    {m, [{:b, :cancel, 1}, {:a, :cfp, {2, :task, 500}}]} = Manager.tick(m, 5_500)
    assert {^m, [{:a, :reject, 1}]} = Manager.hear(m, :a, :propose, {1, 1}, 5_510)
    # A cost that is not a number is not a bid.
    assert {^m, [{:a, :reject, 2}]} = Manager.hear(m, :a, :propose, {2, :cheap}, 5_510)
  end

  test "a task without bids is announced again, then given up; without peers it is over at once" do
    {m, _} = start([:a], rounds: 2)
    {m, []} = Manager.hear(m, :a, :refuse, {1, :infeasible}, 10)
    {m, [{:a, :cfp, {2, :task, 500}}]} = Manager.tick(m, 500)
    {m, []} = Manager.tick(m, 1_000)
    assert m.outcome == {:error, :no_bids}
    assert {%{outcome: {:error, :nobody}}, []} = start([])
    {m, _} = start([:a])
    assert {%{outcome: {:error, :nobody}}, []} = Manager.gone(m, :a, 5)

    assert_raise ArgumentError, ~r/rounds: expected .*, got 0/, fn -> start([:a], rounds: 0) end
    assert_raise ArgumentError, fn -> start([:a], speed: 1) end
  end

  # Refuses whenever it is asked; returns the times of the announcements, and the outcome.
  defp refuse(salt, why, options) do
    {m, _} = Manager.start(:task, [:a], options, 0, salt)
    refuse(m, why, 0, [0])
  end

  defp refuse(%{outcome: nil} = m, why, at_ms, times) do
    {m, []} = Manager.hear(m, :a, :refuse, {m.round, why}, at_ms + 1)

    case Manager.tick(m, m.due_ms) do
      {m, [{:a, :cfp, _}]} -> refuse(m, why, m.due_ms - m.bid_ms, [m.due_ms - m.bid_ms | times])
      {m, []} -> {Enum.reverse(times), m.outcome}
    end
  end

  defp refuse(m, _why, _at_ms, times), do: {Enum.reverse(times), m.outcome}

  test "busy peers are asked again for 5 s, after pauses that differ and grow; then that is the error" do
    for why <- [:busy, :locked] do
      {times, outcome} = refuse(:one, why, [])
      assert outcome == {:error, :busy}
      pauses = Enum.zip_with(tl(times), times, &(&1 - &2))
      assert Enum.all?(pauses, &(&1 in 10..401))
      assert hd(pauses) <= 51
      assert List.last(times) in 4_500..5_000
    end

    firsts = for salt <- 1..20, {[0, first | _], _} = refuse(salt, :locked, []), do: first
    assert length(Enum.uniq(firsts)) >= 10
    assert {_, {:error, :no_bids}} = refuse(:one, :infeasible, [])
    assert {[0, 500, 1000], _} = refuse(:one, :infeasible, [])
    assert {times, {:error, :busy}} = refuse(:one, :busy, wait_ms: 100)
    assert List.last(times) <= 100
  end

  test "a peer that is busy is not waited for where another bids; one that cannot does not end the wait" do
    {m, _} = start([:a, :b])

    assert {_, [{:b, :accept, 1}]} =
             heard(m, [{:a, :refuse, {1, :busy}, 1}, {:b, :propose, {1, 9}, 2}])

    {m, []} = heard(m, [{:a, :refuse, {1, :busy}, 1}, {:b, :refuse, {1, :infeasible}, 2}])
    assert m.phase == :pausing
    # What comes meanwhile is too late, and whoever is gone is not asked again.
    assert {^m, [{:b, :reject, 1}]} = Manager.hear(m, :b, :propose, {1, 1}, 3)
    {m, []} = Manager.gone(m, :b, 4)
    assert {m, [{:a, :cfp, {2, :task, 500}}]} = Manager.tick(m, m.due_ms)
    assert {%{outcome: {:error, :nobody}}, []} = Manager.gone(m, :a, 900)
  end

  test "if the winner is gone, fails, or is no longer bound, the others are asked again" do
    {m, _} = start([:a, :b])
    {m, _} = heard(m, [{:a, :propose, {1, 1}, 1}, {:b, :propose, {1, 2}, 1}])
    again = [{:b, :cfp, {2, :task, 500}}]
    assert {_, ^again} = Manager.gone(m, :a, 2)
    assert {_, ^again} = Manager.hear(m, :a, :failure, {1, :stuck}, 2)
    assert {_, ^again} = Manager.hear(m, :a, :failure, :error, 2)

    assert {_, [{:a, :cfp, {2, _, _}}, {:b, :cfp, {2, _, _}}]} =
             Manager.hear(m, :a, :refuse, {1, :not_bound}, 2)

    # A manager that loses its winner while it waits for others decides among those left.
    {m, _} = start([:a, :b])
    {m, []} = Manager.hear(m, :b, :propose, {1, 2}, 1)
    assert {_, [{:b, :accept, 1}]} = Manager.gone(m, :a, 2)
  end

  test "a winner that was given up is told to stop, unless it has done the task" do
    {m, _} = start([:a, :b])
    {m, _} = heard(m, [{:a, :propose, {1, 1}, 1}, {:b, :propose, {1, 2}, 1}])
    {m, _} = Manager.tick(m, 5_001)
    {m, [{:b, :accept, 2}]} = Manager.hear(m, :b, :propose, {2, 2}, 5_010)
    assert {^m, [{:a, :cancel, 1}]} = Manager.hear(m, :a, :inform, {1, :progress, 1}, 5_020)
    {m, [{:b, :cancel, 2}]} = Manager.hear(m, :a, :inform, {1, :done, :late}, 5_030)
    assert m.outcome == {:ok, :a, :late}
    assert {^m, [{:b, :cancel, 2}]} = Manager.hear(m, :b, :inform, {2, :progress, 1}, 5_040)
  end

  test "a peer that never won cannot have done the task" do
    {m, _} = start([:a, :b])
    assert {^m, []} = Manager.hear(m, :a, :inform, {1, :done, :lie}, 5)
  end

  test "a bid binds until it is decided, or its time is over" do
    free = %Bidder{}
    {locked, {:propose, 3}} = Bidder.announced(free, :k1, :task, 3, 500, 0)
    assert {^locked, {:refuse, :locked}} = Bidder.announced(locked, :k2, :task, 3, 500, 1_000)
    assert {^locked, {:propose, 3}} = Bidder.announced(locked, :k1, :task, 4, 500, 10)
    assert {_, {:propose, 3}} = Bidder.announced(locked, :k2, :task, 3, 500, 1_001)
    assert {_, :refuse} = Bidder.accepted(locked, :k1, 1_001)
    assert {_, :refuse} = Bidder.accepted(locked, :k2, 10)
    assert Bidder.rejected(locked, :k1) == free
    assert Bidder.rejected(locked, :k2) == locked
    assert {^free, :nothing} = Bidder.cancelled(locked, :k1)
    assert {^free, {:refuse, :infeasible}} = Bidder.announced(free, :k1, :task, :infinite, 500, 0)

    {working, {:start, :task}} = Bidder.accepted(locked, :k1, 700)
    assert {^working, :working} = Bidder.accepted(working, :k1, 99_000)
    assert {^working, {:refuse, :busy}} = Bidder.announced(working, :k2, :task, 3, 500, 99_000)
    # Whoever cannot do it need not be asked again.
    assert {^working, {:refuse, :infeasible}} =
             Bidder.announced(working, :k2, :task, :infinite, 500, 99_000)

    assert {^working, :nothing} = Bidder.cancelled(working, :k2)
    assert {^free, :stop} = Bidder.cancelled(working, :k1)
    assert Bidder.finished(working) == free

    # This holds however long a manager says that it will take.
    {locked, _} = Bidder.announced(free, :k1, :task, 3, 9_999_999, 0)
    assert {_, {:propose, 1}} = Bidder.announced(locked, :k2, :task, 1, 500, 10_501)
  end

  # Two managers and four robots; letters arrive in any order, late, twice, or never, and robots
  # die. No robot ever works for two, and every manager comes to an end.
  test "whatever the network does, robots do one task at a time, and managers end" do
    for _ <- 1..300 do
      world = %{at: 0, air: [], bidders: Map.new(1..4, &{&1, %Bidder{}}), managers: %{}, dead: []}

      world =
        for id <- [:x, :y], reduce: world do
          world ->
            {m, letters} = Manager.start(id, [1, 2, 3, 4], [bid_ms: 50, silence_ms: 200], 0)
            %{world | managers: Map.put(world.managers, id, m)} |> send_to_robots(id, letters)
        end

      world = Enum.reduce_while(1..5_000, world, fn _, world -> step(world) end)
      for {_id, m} <- world.managers, do: assert(m.outcome != nil)
    end
  end

  defp step(world) do
    if Enum.all?(world.managers, fn {_id, m} -> m.outcome end),
      do: {:halt, world},
      else: {:cont, step(:rand.uniform(10), world)}
  end

  defp step(1, world), do: pass(world)
  defp step(2, %{air: [_ | air]} = world), do: %{world | air: air}
  defp step(3, %{dead: dead} = world) when length(dead) < 3 and world.at > 400, do: die(world)

  defp step(n, world) when n in 4..6 do
    for {robot, %{job: job}} <- world.bidders,
        job != nil,
        robot not in world.dead,
        reduce: world do
      world ->
        {id, round} = job.key
        # Each works at its own pace; a done task ends it.
        if :rand.uniform(6) == 1 do
          world = put_in(world.bidders[robot], Bidder.finished(world.bidders[robot]))
          fly(world, {:manager, id, robot, :inform, {round, :done, robot}})
        else
          fly(world, {:manager, id, robot, :inform, {round, :progress, 1}})
        end
    end
  end

  defp step(_n, %{air: []} = world), do: pass(world)

  defp step(n, world) do
    letter = Enum.random(world.air)
    world = if n == 10, do: world, else: %{world | air: List.delete(world.air, letter)}
    deliver(letter, world)
  end

  defp pass(world) do
    world = %{world | at: world.at + 10}

    for {id, m} <- world.managers, reduce: world do
      world ->
        {m, letters} = Manager.tick(m, world.at)
        %{world | managers: Map.put(world.managers, id, m)} |> send_to_robots(id, letters)
    end
  end

  defp die(world) do
    robot = Enum.random(1..4)
    world = %{world | dead: Enum.uniq([robot | world.dead])}

    for {id, m} <- world.managers, reduce: world do
      world ->
        {m, letters} = Manager.gone(m, robot, world.at)
        %{world | managers: Map.put(world.managers, id, m)} |> send_to_robots(id, letters)
    end
  end

  defp send_to_robots(world, id, letters),
    do: Enum.reduce(letters, world, fn {robot, p, c}, w -> fly(w, {:robot, robot, id, p, c}) end)

  defp fly(world, letter), do: %{world | air: Enum.take([letter | world.air], 60)}

  defp deliver({:manager, id, robot, performative, content}, world) do
    {m, letters} = Manager.hear(world.managers[id], robot, performative, content, world.at)
    %{world | managers: Map.put(world.managers, id, m)} |> send_to_robots(id, letters)
  end

  defp deliver({:robot, robot, id, performative, content}, world) do
    if robot in world.dead, do: world, else: robot(performative, content, robot, id, world)
  end

  defp robot(:cfp, {round, task, left}, robot, id, world) do
    key = {id, round}
    {b, {p, c}} = Bidder.announced(world.bidders[robot], key, task, robot, left, world.at)
    fly(put_in(world.bidders[robot], b), {:manager, id, robot, p, {round, c}})
  end

  defp robot(:accept, round, robot, id, world) do
    before = world.bidders[robot]
    {b, answer} = Bidder.accepted(before, {id, round}, world.at)
    # It never drops one task for another.
    assert before.job in [nil, b.job]

    reply = if answer == :refuse, do: {:refuse, {round, :not_bound}}, else: {:agree, round}

    fly(put_in(world.bidders[robot], b), {:manager, id, robot, elem(reply, 0), elem(reply, 1)})
  end

  defp robot(:reject, round, robot, id, world),
    do: update_in(world.bidders[robot], &Bidder.rejected(&1, {id, round}))

  defp robot(:cancel, round, robot, id, world),
    do: update_in(world.bidders[robot], &elem(Bidder.cancelled(&1, {id, round}), 0))
end
