defmodule Swarm.Blackboard.StigmergyTest do
  use Swarm.Case, async: true
  alias Swarm.Ether
  alias Swarm.Blackboard.{Hints, Stigmergy}
  doctest Swarm.Blackboard.Stigmergy

  defp entries(count, ids) do
    for _ <- 1..count do
      {Enum.random(1..ids), Enum.random(1..20), Enum.random(["mag1", "min1"]),
       Enum.random(["", "a", "b"])}
    end
  end

  defp merge(hints, entries), do: hints |> Stigmergy.merge(entries, 0) |> elem(0)
  defp all(hints), do: Stigmergy.entries(hints, Map.keys(hints.entries))

  test "in any order, doubled and in halves: all come to the same map, full ones too" do
    for n <- 1..300 do
      new = Stigmergy.new(if rem(n, 2) == 0, do: 256, else: 5)
      entries = entries(40, 12)
      once = merge(new, entries)
      assert merge(new, Enum.shuffle(entries ++ Enum.take(entries, 10))) == once
      {left, right} = Enum.split(entries, 17)
      assert merge(merge(new, left), all(merge(new, right))) == once
      assert merge(merge(new, right), all(merge(new, left))) == once
      assert {^once, []} = Stigmergy.merge(once, all(once), 0)
      assert map_size(once.entries) <= new.most
    end
  end

  test "after three messages two have the same" do
    for _ <- 1..100 do
      [a, b] = for _ <- 1..2, do: merge(Stigmergy.new(), entries(30, 40))

      {a, b} =
        Enum.reduce(Stigmergy.differing(b, Stigmergy.digest(a)), {a, b}, fn {bucket, stamps},
                                                                            {a, b} ->
          {lacked, wanted} = Stigmergy.diff(a, bucket, stamps)
          {merge(a, Stigmergy.entries(b, wanted)), merge(b, lacked)}
        end)

      assert all(a) == all(b)
      assert Stigmergy.differing(a, Stigmergy.digest(b)) == []
    end
  end

  test "who writes later wins, by what it has seen; a deleted hint does not come back" do
    a = Stigmergy.new() |> Stigmergy.put("mag1", 1, "first", 0)
    b = Stigmergy.new() |> merge(all(a)) |> Stigmergy.put("mag0", 1, "second", 0)
    assert {:ok, "second", "mag0"} = a |> merge(all(b)) |> Stigmergy.get(1)
    deleted = Stigmergy.put(b, "mag1", 1, "", 0)
    assert deleted |> merge(all(a)) |> merge(all(b)) |> Stigmergy.get(1) == :error
    assert {^deleted, []} = Stigmergy.forget(deleted, 599_999)
    assert {%{entries: none}, [1]} = Stigmergy.forget(deleted, 600_000)
    assert none == %{}
  end

  test "no count that somebody invents keeps others from writing" do
    powers = for n <- [20, 31, 32, 41, 53, 62, 63, 64, 40_000], do: Bitwise.bsl(1, n)

    for n <- [500_000_000 | powers], d <- [-1, 0, 1], id <- [1, 2] do
      absurd = {id, n + d, "zz", "absurd"}
      start = Stigmergy.new() |> Stigmergy.put("mag1", 1, "first", 0)

      [a, b] =
        for _ <- 1..2,
            do: if(Stigmergy.entry?(absurd, 1_000), do: merge(start, [absurd]), else: start)

      a = Stigmergy.put(a, "mag1", 1, "second", 0)
      assert {:ok, "second", "mag1"} = Stigmergy.get(a, 1)
      assert {:ok, "second", "mag1"} = b |> merge(all(a)) |> Stigmergy.get(1)
      assert {:ok, "second", "mag1"} = Stigmergy.new() |> merge(all(a)) |> Stigmergy.get(1)
    end
  end

  test "neighbours are those in range, in the order of their names" do
    poses = %{mag2: Pose.new(0, 2), mag1: Pose.new(1, 0), min1: Pose.new(4, 0)}
    near = Stigmergy.near(poses, Pose.new(0, 0), 3)
    assert [:mag1, :mag2] = Keyword.keys(near)
    assert_in_delta near[:mag2].bearing, :math.pi() / 2, 0.001
    assert Stigmergy.near(poses, nil, 3) == []
    assert Stigmergy.reduce([], 7, fn _, _, _ -> 8 end) == 7
  end

  defp hints(count) do
    names = for n <- 1..count, do: :"hints#{System.unique_integer([:positive])}_#{n}"
    air = start_supervised!({Ether, names}, id: names)

    for name <- names do
      options = [
        name: name,
        transport: {Ether, :cast, [air, name, Hints]},
        nodes: {Ether, :others, [air, name]},
        repair_ms: :never,
        most: 40
      ]

      start_supervised!(%{id: name, start: {Hints, :start_link, [options]}})
    end

    {names, air}
  end

  test "hints are everywhere at once, and after losses, by way of others" do
    {[a, b, c], air} = hints(3)
    assert Hints.put(a, :mag1, :door, {:open, 1.5}) == :ok
    eventually(fn -> Hints.get(c, :door) == {:ok, {:open, 1.5}, :mag1} end)
    Ether.change(air, cut: [{a, c}], loss: 0.3, doubled: 0.3)
    for n <- 1..30, do: :ok = Hints.put(a, :mag1, {:searched, n}, n)
    :ok = Hints.delete(c, :mag3, :door)

    eventually(fn ->
      for hints <- [a, b, c], do: Hints.repair(hints)
      all = Hints.all(a)
      map_size(all) == 30 and Hints.all(b) == all and Hints.all(c) == all
    end)

    assert Hints.get(a, :door) == :error
    assert Ether.get(air).largest <= 1_200
  end

  test "whatever arrives or is written: nothing falls, nothing grows" do
    {[a], _air} = hints(1)

    junk = [
      nil,
      1,
      "x",
      {:hints, [1 | 2]},
      {:hints, [:x]},
      {:digest, 1},
      {:have, 99, []},
      {:have, 1, [:x]},
      {:want, %{}},
      {:hints, [{1, 1, "mag1", :binary.copy("x", 1_001)}]}
    ]

    for term <- junk, do: Hints.hear(a, :other, term)
    for n <- 1..200, do: Hints.hear(a, :other, {:hints, [{n, n, "mag1", "no term"}]})
    assert Hints.info(a) == %{entries: 40, dropped: length(junk)}
    assert Hints.all(a) == %{}
    assert {:error, line} = Hints.put(a, :mag1, :big, :binary.copy("x", 2_000))
    assert line =~ "1000"
    assert {:error, _} = Hints.put(a, "mag1", :x, 1)
    assert {:error, _} = Hints.put(a, :mag1, "x", 1)
    assert {:error, _} = Hints.put(:no_hints_here, :mag1, :x, 1)
    assert Hints.get(:no_hints_here, :x) == :error
  end
end
