defmodule Swarm.Blackboard.HintsTest do
  use Swarm.Case, async: true
  alias Swarm.{Blackboard, Ether}
  alias Swarm.Blackboard.{AntiEntropy, Codec, Hints, Rows, State}

  # As another node sends it.
  defp entry(id, count, writer, payload, age_ms \\ 0),
    do: {Rows.bucket(id), id, Rows.hint_stamp(count, writer, payload), age_ms, payload}

  defp entries(count, ids) do
    for _ <- 1..count do
      entry(
        Enum.random(1..ids),
        Enum.random(1..20),
        Enum.random(["mag1", "min1"]),
        Enum.random(["", "a", "b"])
      )
    end
  end

  # Encoded in datagrams.
  defp merge(state, entries, now_ms \\ 0) do
    Enum.reduce(Codec.tell(entries), state, fn term, state ->
      {{:rows, rows}, _dropped} = Codec.read(term)
      state |> State.merge(rows, now_ms) |> elem(0)
    end)
  end

  defp all(state, now_ms \\ 0),
    do: for({owner, _} <- Rows.owners(state), row <- Rows.rows(state, owner, now_ms), do: row)

  defp put(state, writer, id, payload) do
    {:ok, state} = State.put_hint(state, writer, id, payload, 0)
    state
  end

  defp get(state, id) do
    case Rows.held(state, Rows.bucket(id), id) do
      {:ok, {{_count, {writer, _}}, payload, _}} when payload != "" -> {:ok, payload, writer}
      _none -> :error
    end
  end

  test "in any order, with duplicates and in halves, all get the same map, even full ones" do
    for n <- 1..300 do
      new = State.new(hints: if(rem(n, 2) == 0, do: 256, else: 5))
      entries = entries(40, 12)
      once = merge(new, entries)
      assert merge(new, Enum.shuffle(entries ++ Enum.take(entries, 10))) == once
      {left, right} = Enum.split(entries, 17)
      assert merge(merge(new, left), all(merge(new, right))) == once
      assert merge(merge(new, right), all(merge(new, left))) == once
      assert {^once, []} = State.merge(once, all(once), 0)
      assert map_size(once.hints) <= new.limits.hints
    end
  end

  test "after three messages two nodes have the same hints" do
    for _ <- 1..100 do
      [a, b] = for _ <- 1..2, do: merge(State.new(), entries(30, 40))
      [digest] = Codec.digest(AntiEntropy.digest(a))
      {{:digest, first, until, digest}, 0} = Codec.read(digest)
      stamps = AntiEntropy.stamps(b, AntiEntropy.differing(b, digest, first, until))
      have = for term <- Codec.have(stamps), {{:have, have}, 0} = Codec.read(term), do: have
      {lacked, wanted} = AntiEntropy.diff(a, Enum.concat(have), 0)
      told = for {owner, id} <- wanted, row <- Rows.rows(b, owner, id, 0), do: row
      {a, b} = {merge(a, told), merge(b, lacked)}
      assert all(a) == all(b)
      assert AntiEntropy.differing(a, AntiEntropy.digest(b)) == []
    end
  end

  test "a later writer wins, by what it has seen; a deleted hint does not come back" do
    a = State.new() |> put("mag1", 1, "first")
    b = State.new() |> merge(all(a)) |> put("mag0", 1, "second")
    assert {:ok, "second", "mag0"} = a |> merge(all(b)) |> get(1)
    deleted = put(b, "mag1", 1, "")
    assert deleted |> merge(all(a)) |> merge(all(b)) |> get(1) == :error
    assert {^deleted, []} = State.forget(deleted, 599_999)
    assert {%{hints: none}, [{1, 1}]} = State.forget(deleted, 600_000)
    assert none == %{}
  end

  test "of two concurrent writers the higher name wins, on both nodes" do
    [a, b] = for writer <- ["mag2", "mag1"], do: put(State.new(), writer, 1, "by " <> writer)
    assert {:ok, "by mag2", "mag2"} = a |> merge(all(b)) |> get(1)
    assert {:ok, "by mag2", "mag2"} = b |> merge(all(a)) |> get(1)
  end

  test "hints never expire, but deletions do, even if nodes pass them round" do
    month = 30 * 24 * 3_600_000
    state = State.new() |> put("mag1", 1, "kept")
    assert {^state, []} = State.forget(state, month)
    assert {:ok, "kept", "mag1"} = State.new() |> merge(all(state, month), month) |> get(1)

    # Each forgets, and hears the other before the other forgets, too.
    gone = State.new() |> put("mag1", 1, "")

    {a, b} =
      Enum.reduce(590..610, {gone, gone}, fn second, {a, b} ->
        {a, _} = State.forget(a, second * 1_000)
        a = merge(a, all(b, second * 1_000), second * 1_000)
        {b, _} = State.forget(b, second * 1_000 + 500)
        {a, merge(b, all(a, second * 1_000 + 500), second * 1_000 + 500)}
      end)

    assert a.hints == %{} and b.hints == %{}
  end

  test "no invented count keeps others from writing" do
    powers = for n <- [20, 31, 32, 41, 53, 62, 63, 64, 40_000], do: Bitwise.bsl(1, n)

    for n <- [500_000_000 | powers], d <- [-1, 0, 1], id <- [1, 2] do
      start = State.new() |> put("mag1", 1, "first")
      [a, b] = for _ <- 1..2, do: merge(start, [entry(id, n + d, "zz", "absurd")])
      a = put(a, "mag1", 1, "second")
      assert {:ok, "second", "mag1"} = get(a, 1)
      assert {:ok, "second", "mag1"} = b |> merge(all(a)) |> get(1)
      assert {:ok, "second", "mag1"} = State.new() |> merge(all(a)) |> get(1)
    end
  end

  test "invented counts, one after the other, do not reach the end of the range" do
    {state, refused} =
      Enum.reduce(1..20_000, {State.new(), 0}, fn n, {state, refused} ->
        now_ms = div(n, 2)
        count = state.clock + 1_000_000_000_000
        row = entry(1, min(count, 6_000_000_000_000_000_000), "zz", "absurd")
        {state, notes} = State.merge(state, [row], now_ms)
        {state, refused + length(notes)}
      end)

    assert refused == 20_000
    assert state.clock == 0

    # At most a million a second.
    pushed =
      Enum.reduce(
        1..5_000,
        State.new(),
        &merge(&2, [entry(1, &2.clock + 900_000, "zz", "x")], &1)
      )

    assert pushed.clock in 1_000_000..6_000_000
    assert {:ok, "mine", "mag1"} = pushed |> put("mag1", 1, "mine") |> get(1)
  end

  test "a board that comes to a fleet with many millions of hints gets them step by step" do
    rows = [entry(1, 10_500_000, "mag1", "old"), entry(2, 10_500_001, "mag1", "new")]

    state =
      Enum.reduce(0..11, State.new(), fn second, state -> merge(state, rows, 1_000 * second) end)

    assert {:ok, "old", "mag1"} = get(state, 1)
    assert {:ok, "new", "mag1"} = get(state, 2)
    assert state.clock == 10_500_001
  end

  defp boards(count) do
    names = for n <- 1..count, do: :"hints#{System.unique_integer([:positive])}_#{n}"
    air = start_supervised!({Ether, names}, id: names)

    for name <- names do
      options = [
        name: name,
        transport: {Ether, :cast, [air, name, Blackboard]},
        nodes: {Ether, :others, [air, name]},
        repair_ms: :never,
        limits: [hints: 40]
      ]

      start_supervised!(%{id: name, start: {Blackboard, :start_link, [options]}})
    end

    {names, air}
  end

  test "hints are everywhere at once, or, after losses, by way of others" do
    {[a, b, c], air} = boards(3)
    assert Hints.put(a, :mag1, :door, {:open, 1.5}) == :ok
    eventually(fn -> Hints.get(c, :door) == {:ok, {:open, 1.5}, :mag1} end)
    Ether.change(air, cut: [{a, c}], loss: 0.3, doubled: 0.3)
    for n <- 1..30, do: :ok = Hints.put(a, :mag1, {:searched, n}, n)
    :ok = Hints.delete(c, :mag3, :door)

    eventually(fn ->
      for board <- [a, b, c], do: Blackboard.repair(board)
      all = Hints.all(a)
      map_size(all) == 30 and Hints.all(b) == all and Hints.all(c) == all
    end)

    assert Hints.get(a, :door) == :error
    assert Ether.get(air).largest <= 1_200
  end

  test "hints and rows do not displace each other" do
    {[a, b], _air} = boards(2)
    :ok = Blackboard.enter(a, a, 1)
    for n <- 1..32, do: :ok = Blackboard.put(a, a, {:k, n}, n)
    for n <- 1..50, do: :ok = Hints.put(a, a, {:k, n}, {:hint, n})
    # The newest stay.
    newest = Map.new(11..50, &{{:k, &1}, {{:hint, &1}, a}})
    eventually(fn -> Hints.all(b) == newest and map_size(Blackboard.rows(b, a)) == 32 end)
    assert Blackboard.robots(b) == [a]
    assert %{robots: 1, rows: 32, hints: 40} = Blackboard.info(b)
  end

  test "whatever arrives or is written, nothing crashes, nothing grows" do
    {[a], _air} = boards(1)
    {bucket, id, {n, {writer, check}}, age_ms, payload} = entry(1, 1, "mag1", "x")
    good = {<<bucket>>, id, n, {writer, check}, age_ms, payload}
    big = :binary.copy("x", 1_001)
    {_, _, {_, check_of_big}, _, _} = entry(1, 1, "mag1", big)

    # Each entry is a single piece of nonsense.
    wrong = [
      {0, <<2>>},
      {0, <<16>>},
      {0, 1},
      {1, 2},
      {1, -1},
      {2, 0},
      {2, 6_000_000_000_000_000_001},
      {2, 5_000_000_000_000_000_000},
      {3, 1},
      {3, {"min1", check + 1}},
      {3, {:mag1, check}},
      {3, {"", check}},
      {3, {"mag1"}},
      {4, -1},
      {5, :x},
      {5, "y"}
    ]

    junk =
      for({at, term} <- wrong, do: {:rows, [put_elem(good, at, term)]}) ++
        [
          {:rows, [good |> put_elem(5, big) |> put_elem(3, check_of_big)]},
          {:have, [{<<1>>, [:x]}]},
          {:have, [{<<1>>, [{2, 1, {"mag1", 1}}]}]},
          {:have, [{<<16>>, []}]},
          {:want, [{<<1>>, -1}]},
          {:digest, "", nil, [{<<1>>, :x}]}
        ]

    for term <- junk, do: Blackboard.hear(a, :other, term)
    assert Blackboard.info(a) == %{robots: 0, rows: 0, hints: 0, dropped: length(junk)}

    for n <- 1..200, term <- Codec.tell([entry(n, n, "mag1", "no term")]) do
      Blackboard.hear(a, :other, term)
    end

    assert %{hints: 40, dropped: dropped} = Blackboard.info(a)
    assert dropped == length(junk)
    assert Hints.all(a) == %{}
    assert {:error, line} = Hints.put(a, :mag1, :big, :binary.copy("x", 2_000))
    assert line =~ "1000"
    assert {:error, _} = Hints.put(a, "mag1", :x, 1)
    assert {:error, _} = Hints.put(a, :mag1, "x", 1)
    assert {:error, _} = Hints.put(:no_board_here, :mag1, :x, 1)
    assert Hints.get(:no_board_here, :x) == :error
  end
end
