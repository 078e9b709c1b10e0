defmodule Swarm.BlackboardTest do
  use Swarm.Case, async: true
  alias Swarm.{Blackboard, Ether}

  # Boards of nodes that are processes here; robot x1 is on board x1.
  defp boards(count, options \\ []) do
    names = for n <- 1..count, do: :"bb#{System.unique_integer([:positive])}_#{n}"
    air = start_supervised!({Ether, names}, id: names)
    for name <- names, do: board(name, air, options)
    {names, air}
  end

  defp board(name, air, options \\ []) do
    options =
      Keyword.merge(
        [
          name: name,
          transport: {Ether, :cast, [air, name, Blackboard]},
          nodes: {Ether, :others, [air, name]},
          repair_ms: :never
        ],
        options
      )

    start_supervised!(%{id: name, start: {Blackboard, :start_link, [options]}})
    :ok = Blackboard.enter(name, name, 1)
    name
  end

  test "a robot's row is there at once, also on the other nodes, with its age" do
    {[a, b, c], air} = boards(3)
    since_ms = System.monotonic_time(:millisecond)
    assert Blackboard.put(a, a, :door, %{open: true}) == :ok
    assert {:ok, %{open: true}, age} = Blackboard.get(a, a, :door, :infinity)
    assert age <= System.monotonic_time(:millisecond) - since_ms

    for other <- [b, c],
        do:
          eventually(fn ->
            match?({:ok, %{open: true}, _}, Blackboard.get(other, a, :door, 2_000))
          end)

    eventually(fn -> Blackboard.get(b, a, :door, 20) == :error end)
    assert %{door: {%{open: true}, _age}} = Blackboard.rows(c, a)
    assert Blackboard.robots(c) == [a]
    assert Ether.get(air).largest <= 1_200
  end

  test "a writer that is not a robot is refused at once" do
    {[a], _air} = boards(1)
    assert {:error, line} = Blackboard.put(a, "mag1", :door, 1)

    assert line ==
             ~s("mag1" is not a robot of this node; each robot writes its own rows, on its node)
  end

  test "losses are repaired, also through third parties" do
    {[a, b, c], air} = boards(3)
    Ether.change(air, cut: [{a, c}], loss: 0.4, doubled: 0.3)
    for n <- 1..20, do: :ok = Blackboard.put(a, a, {:item, n}, n)
    :ok = Blackboard.put(c, c, :here, true)

    eventually(fn ->
      for board <- [a, b, c], do: Blackboard.repair(board)
      map_size(Blackboard.rows(c, a)) == 20 and Blackboard.get(a, c, :here, :infinity) != :error
    end)

    assert Ether.get(air).largest <= 1_200
  end

  test "for thirty robots a digest is one datagram, many rows are few, and a large row is sent alone" do
    {[a, b], air} = boards(2)

    for n <- 1..30,
        robot = :"bbmany#{n}",
        do:
          (
            :ok = Blackboard.enter(a, robot, 1)
            :ok = Blackboard.put(a, robot, :x, n)
          )

    eventually(fn -> length(Blackboard.robots(b)) == 30 end)
    sent = Ether.get(air).sent
    Blackboard.repair(a)
    Blackboard.info(a)
    assert Ether.get(air).sent == sent + 1
    assert Ether.get(air).largest <= 1_200

    big = :crypto.strong_rand_bytes(50_000)
    assert Blackboard.put(a, a, :map, big) == :ok
    eventually(fn -> match?({:ok, ^big, _}, Blackboard.get(b, a, :map, :infinity)) end)
    assert {:error, line} = Blackboard.put(a, a, :map, :binary.copy("x", 60_000))
    assert line =~ ":map" and line =~ "59000"
    refute line =~ "\n"
  end

  test "only a robot of this node writes its rows, by keys that are names" do
    {[a, b], _air} = boards(2)
    assert {:error, line} = Blackboard.put(a, b, :x, 1)
    assert line =~ "is not a robot of this node"
    assert {:error, line} = Blackboard.put(a, a, "x", 1)
    assert line =~ "is not a key"
    assert {:error, line} = Blackboard.put(:no_board_here, a, :x, 1)
    assert line =~ "does not answer"
    assert Blackboard.get(:no_board_here, a, :x, 1) == :error
    assert Blackboard.rows(:no_board_here, a) == %{}
    for n <- 1..32, do: assert(Blackboard.put(a, a, {:k, n}, n) == :ok)
    assert {:error, line} = Blackboard.put(a, a, {:k, 33}, 1)
    assert line =~ "32"
  end

  test "a robot's entry ends with the process that entered it, and its rows grow old" do
    {[a, b], _air} = boards(2)
    parent = self()

    owner =
      spawn_link(fn ->
        :ok = Blackboard.enter(a, :bbended, 1)
        send(parent, :entered)
        receive(do: (:end -> :ok))
      end)

    assert_receive :entered
    assert Blackboard.put(a, :bbended, :x, 1) == :ok
    send(owner, :end)
    eventually(fn -> match?({:error, _}, Blackboard.put(a, :bbended, :x, 2)) end)
    # Another node may have the robot now.
    :ok = Blackboard.enter(b, :bbended, 2)
    assert Blackboard.put(b, :bbended, :x, 3) == :ok
    eventually(fn -> match?({:ok, 3, _}, Blackboard.get(a, :bbended, :x, :infinity)) end)
  end

  test "another robot of the same name is reported once, and its rows are not accepted" do
    {[a, b], _air} = boards(2)
    me = self()

    :ok =
      Hal.Event.attach(
        {a, :rival},
        [:swarm, :blackboard, :rival],
        fn _, _, about, _ -> send(me, {:rival, about}) end,
        nil
      )

    on_exit(fn -> Hal.Event.detach({a, :rival}) end)
    :ok = Blackboard.enter(a, :bbtwin, 1)
    :ok = Blackboard.put(a, :bbtwin, :x, :first)
    :ok = Blackboard.enter(b, :bbtwin, 2)
    for n <- 1..5, do: :ok = Blackboard.put(b, :bbtwin, :x, n)
    assert_receive {:rival, %{robot: :bbtwin, incarnation: 2, node: ^b}}
    Blackboard.info(a)
    refute_received {:rival, %{incarnation: 2, robot: :bbtwin}}
    assert {:ok, :first, _} = Blackboard.get(a, :bbtwin, :x, :infinity)
    # The one that gives way hears the other.
    :ok = Blackboard.leave(a, :bbtwin)
    :ok = Blackboard.put(b, :bbtwin, :x, :second)
    eventually(fn -> match?({:ok, :second, _}, Blackboard.get(a, :bbtwin, :x, :infinity)) end)
  end

  test "a board that crashed gets everything back from the others, including its own robots' rows" do
    {[a, b], air} = boards(2)
    for n <- 1..5, do: :ok = Blackboard.put(a, a, {:k, n}, n)
    :ok = Blackboard.put(b, b, :x, 1)
    eventually(fn -> map_size(Blackboard.rows(b, a)) == 5 end)
    :ok = stop_supervised(a)
    board(a, air)
    :ok = Blackboard.put(a, a, {:k, 1}, :new)

    eventually(fn ->
      Blackboard.repair(b)
      map_size(Blackboard.rows(a, a)) == 5
    end)

    eventually(fn ->
      Blackboard.repair(a)
      match?({:ok, :new, _}, Blackboard.get(b, a, {:k, 1}, :infinity))
    end)

    assert {:ok, 1, _} = Blackboard.get(a, b, :x, :infinity)
  end

  test "whatever arrives, nothing crashes, nothing grows, and it is counted" do
    {[a], _air} = boards(1, limits: [robots: 3])
    deep = Enum.reduce(1..10_000, [], fn _, deep -> {deep} end)

    junk = [
      nil,
      :x,
      1.5,
      "t",
      [1 | 2],
      %{a: 1},
      deep,
      {:rows, deep},
      {:want, [1 | 2]},
      {:digest, "", nil, [deep]}
    ]

    for term <- junk, do: Blackboard.hear(a, :other, term)

    for n <- 1..200,
        robot = "bbflood#{n}",
        _ = String.to_atom(robot),
        do: Blackboard.hear(a, :other, {:rows, [{robot, 1, 1, 1, 1, "junk"}]})

    GenServer.cast(a, :junk)
    send(Process.whereis(a), :junk)
    assert %{robots: 3, rows: 3, dropped: dropped} = Blackboard.info(a)
    assert dropped >= 11 + 197
    # Bytes without meaning are stored and passed on, but not shown to anybody.
    assert Blackboard.rows(a, :bbflood1) == %{}
  end

  test "a board repairs by itself from time to time" do
    {[a, b], air} = boards(2, repair_ms: 20)
    Ether.change(air, loss: 1.0)
    :ok = Blackboard.put(a, a, :x, 1)
    Blackboard.info(a)
    Ether.change(air, loss: 0.0)
    eventually(fn -> match?({:ok, 1, _}, Blackboard.get(b, a, :x, :infinity)) end)
  end
end
