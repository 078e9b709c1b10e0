defmodule Swarm.Blackboard.StateTest do
  use ExUnit.Case, async: true
  alias Swarm.Blackboard
  alias Swarm.Blackboard.AntiEntropy
  doctest Swarm.Blackboard.Rows
  doctest Swarm.Blackboard.State
  doctest Swarm.Blackboard.AntiEntropy
  doctest Swarm.Blackboard.Codec

  @robots [:mag1, :mag2, :min1]

  defp entered(robots, boot \\ 1, limits \\ []) do
    Enum.reduce(robots, Blackboard.State.new(limits), fn robot, rows ->
      {rows, []} = Blackboard.State.enter(rows, robot, boot, 0)
      rows
    end)
  end

  defp put!(rows, robot, key, value, now_ms) do
    {:ok, rows} = Blackboard.State.put(rows, robot, key, value, now_ms)
    rows
  end

  defp all(rows, now_ms),
    do:
      for(
        robot <- Map.keys(rows.robots),
        row <- Blackboard.Rows.rows(rows, robot, now_ms),
        do: row
      )

  defp merge(rows, incoming, now_ms),
    do: rows |> Blackboard.State.merge(incoming, now_ms) |> elem(0)

  defp get(rows, robot, key, now_ms) do
    with {:ok, {_stamp, value, at_ms}} <- Blackboard.Rows.held(rows, robot, key),
         do: {:ok, value, now_ms - at_ms}
  end

  # Rows as their writers made them, each with its age when it was sent.
  defp history do
    for n <- 1..40, robot = Enum.random(@robots), uniq: true do
      {robot, Enum.random([:a, :b, :c]), {Enum.random(1..3), n}, Enum.random(0..50), n}
    end
  end

  test "whatever is lost once, duplicated and shuffled, all get the same rows" do
    for _ <- 1..300 do
      history = history()
      once = merge(Blackboard.State.new(), history, 1_000)

      twice =
        merge(
          Blackboard.State.new(),
          Enum.shuffle(history ++ Enum.take_random(history, 20)),
          1_000
        )

      assert twice == once

      # Halves that met other halves first.
      {left, right} = Enum.split(Enum.shuffle(history), 20)
      a = merge(Blackboard.State.new(), left, 1_000)
      b = merge(Blackboard.State.new(), right, 1_000)
      assert merge(a, all(b, 1_000), 1_000) == once
      assert merge(b, all(a, 1_000), 1_000) == once
      assert merge(once, all(once, 1_000), 1_000) == once
      assert {^once, []} = Blackboard.State.merge(once, all(once, 1_000), 1_000)
    end
  end

  # What a board accepts of the rows that another sends it.
  defp heard(rows, sent, now_ms) do
    Enum.reduce(Blackboard.Codec.tell(sent), rows, fn term, rows ->
      {{:rows, incoming}, _dropped} = Blackboard.Codec.read(term)
      merge(rows, incoming, now_ms)
    end)
  end

  test "no invented number keeps a robot from being read for longer than some seconds" do
    numbers =
      for n <- [10, 31, 32, 41, 52, 53, 61, 62, 63, 64, 40_000],
          d <- [-1, 0, 1],
          do: Bitwise.bsl(1, n) + d

    # The ends of the ranges on the wire.
    incarnations =
      for n <- [6_000_000_000_000_000_000, 9_000_000_000_000_000_000], d <- [-1, 0, 1], do: n + d

    numbers = [999_999_999_999_999, 1_000_000_000_000_000 | numbers]

    for incarnation <- [1 | incarnations] ++ numbers, sequence <- [1 | numbers] do
      absurd = [{:mag1, 7, {incarnation, sequence}, 0, "absurd"}]
      owner = [:mag1] |> entered() |> put!(:mag1, 7, "mine", 0)
      other = Blackboard.State.new() |> heard(all(owner, 0), 0) |> heard(absurd, 0)
      # Its robot gets it back through the other board, which repairs once a second.
      {owner, other} =
        Enum.reduce(1..8, {owner, other}, fn second, {owner, other} ->
          now_ms = 1_000 * second
          owner = owner |> heard(all(other, now_ms), now_ms) |> put!(:mag1, 8, second, now_ms)
          {owner, heard(other, all(owner, now_ms), now_ms)}
        end)

      assert {:ok, "mine", _} = get(owner, :mag1, 7, 9_000)
      assert {:ok, "mine", _} = get(other, :mag1, 7, 9_000)
      owner = put!(owner, :mag1, 7, "later", 9_000)

      assert {:ok, "later", _} = other |> heard(all(owner, 9_000), 9_000) |> get(:mag1, 7, 9_000)

      # So does a board that comes later.
      assert {:ok, "later", _} =
               Blackboard.State.new()
               |> heard(all(owner, 9_000), 9_000)
               |> get(:mag1, 7, 9_000)
    end
  end

  test "no thousand invented sequences, one after the other, end a robot's rows" do
    owner = [:mag1] |> entered() |> put!(:mag1, 7, "mine", 0)

    {owner, other} =
      Enum.reduce(1..1_200, {owner, Blackboard.State.new()}, fn n, {owner, other} ->
        {_incarnation, count} = owner.own.mag1 |> elem(1)
        sequence = min(count + 1_000_000_000_000, 1_000_000_000_000_000)
        {{life, _}, _, _} = Blackboard.Rows.latest(owner, :mag1)
        absurd = [{:mag1, 7, {life, sequence}, 0, "absurd"}]
        now_ms = 100 * n
        owner = owner |> heard(absurd, now_ms) |> put!(:mag1, 7, n, now_ms)
        {owner, other |> heard(absurd, now_ms) |> heard(all(owner, now_ms), now_ms)}
      end)

    owner = put!(owner, :mag1, 7, "later", 130_000)
    other = heard(other, all(owner, 130_000), 130_000)
    assert {:ok, "later", _} = get(other, :mag1, 7, 130_000)
  end

  test "an incarnation that nobody can outbid lasts only as long as nobody knows the robot" do
    last = 9_000_000_000_000_000_000
    absurd = [{:mag1, 7, {last, 1}, 0, "absurd"}]
    other = heard(Blackboard.State.new(), absurd, 0)
    # Its robot comes later, to this board or to another one.
    {own, [_rival]} = Blackboard.State.enter(other, :mag1, 5, 1_000)
    assert [{:mag1, 7, {5, 1}, 0, "mine"}] = own |> put!(:mag1, 7, "mine", 0) |> all(0)
    {own, []} = Blackboard.State.enter(other, :mag1, 5, 6_000)
    own = put!(own, :mag1, 7, "mine", 6_000)
    {other, _gone} = Blackboard.State.forget(other, 600_000)
    assert {:ok, "mine", _} = other |> heard(all(own, 600_000), 600_000) |> get(:mag1, 7, 600_000)
  end

  test "with more keys than a robot may have, all keep the same ones: the newest" do
    for _ <- 1..100 do
      history = for n <- Enum.shuffle(1..60), do: {:mag1, Enum.random(1..20), {1, n}, 0, n}
      once = merge(Blackboard.State.new(keys: 5), history, 0)
      assert merge(Blackboard.State.new(keys: 5), Enum.shuffle(history), 0) == once
      assert map_size(once.robots.mag1) == 5
    end
  end

  test "the age of a row is its age at sending plus the time that each board held it" do
    a = entered([:mag1]) |> put!(:mag1, :x, 1, 100)
    b = merge(Blackboard.State.new(), all(a, 150), 5_000)
    c = merge(Blackboard.State.new(), all(b, 5_030), 90)
    assert get(c, :mag1, :x, 100) == {:ok, 1, 50 + 30 + 10}

    # The same row arrives by a way on which it was held for longer: that age is nearer to the
    # truth.
    assert {:ok, 1, 200} =
             c
             |> merge([{:mag1, :x, {1, 1}, 200, 1}], 100)
             |> get(:mag1, :x, 100)

    assert {:ok, 1, 90} = c |> merge([{:mag1, :x, {1, 1}, 20, 1}], 100) |> get(:mag1, :x, 100)
  end

  test "two that exchange digests have the same rows after three messages" do
    for _ <- 1..100 do
      a = merge(Blackboard.State.new(), Enum.take_random(history(), 25), 0)
      b = merge(Blackboard.State.new(), Enum.take_random(history(), 25), 0)
      have = AntiEntropy.stamps(b, AntiEntropy.differing(b, AntiEntropy.digest(a)))
      {lacked, wanted} = AntiEntropy.diff(a, have, 0)
      told = for {robot, key} <- wanted, row <- Blackboard.Rows.rows(b, robot, key, 0), do: row
      assert AntiEntropy.digest(merge(a, told, 0)) == AntiEntropy.digest(merge(b, lacked, 0))
    end
  end

  test "several boards over a network that loses, duplicates and is cut all get the same rows" do
    for _ <- 1..20 do
      stores = for robot <- [:r1, :r2, :r3, :r4, :r5], into: %{}, do: {robot, entered([robot])}
      # r1 and r5 never hear each other: r3 is between them.
      hears? = fn a, b -> abs(n(a) - n(b)) <= 2 and :rand.uniform() > 0.3 end

      stores =
        Enum.reduce(1..30, stores, fn now_ms, stores ->
          writer = Enum.random(Map.keys(stores))

          stores =
            Map.update!(stores, writer, &put!(&1, writer, Enum.random([:a, :b]), now_ms, now_ms))

          [row | _] = Blackboard.Rows.rows(stores[writer], writer, now_ms)

          Map.new(stores, fn {id, rows} ->
            {id, if(hears?.(writer, id), do: merge(rows, [row], now_ms), else: rows)}
          end)
        end)

      stores =
        Enum.reduce(31..70, stores, fn now_ms, stores -> repair(stores, hears?, now_ms) end)

      assert [_same] = stores |> Map.values() |> Enum.map(&AntiEntropy.digest/1) |> Enum.uniq()
      assert map_size(stores.r1.robots) == map_size(stores.r5.robots)
    end
  end

  defp n(robot), do: robot |> Atom.to_string() |> String.last() |> String.to_integer()

  defp repair(stores, hears?, now_ms) do
    for a <- Map.keys(stores),
        b <- Enum.take_random(Map.keys(stores) -- [a], 2),
        hears?.(a, b),
        reduce: stores do
      stores ->
        have =
          AntiEntropy.stamps(
            stores[b],
            AntiEntropy.differing(stores[b], AntiEntropy.digest(stores[a]))
          )

        {lacked, wanted} = AntiEntropy.diff(stores[a], have, now_ms)

        told =
          for {robot, key} <- wanted,
              row <- Blackboard.Rows.rows(stores[b], robot, key, now_ms),
              do: row

        stores =
          if hears?.(a, b), do: Map.update!(stores, b, &merge(&1, lacked, now_ms)), else: stores

        if hears?.(b, a), do: Map.update!(stores, a, &merge(&1, told, now_ms)), else: stores
    end
  end

  test "a digest of thirty robots fits a datagram; that of a hundred is split into parts that omit nobody" do
    rows = fn count ->
      merge(Blackboard.State.new(), for(n <- 1..count, do: {:"mag#{n}", :a, {1, n}, 0, n}), 0)
    end

    assert [{:digest, "", nil, _} = part] = Blackboard.Codec.digest(AntiEntropy.digest(rows.(30)))
    assert byte_size(:erlang.term_to_binary(part)) <= 800
    parts = Blackboard.Codec.digest(AntiEntropy.digest(rows.(100)))
    assert length(parts) > 1
    assert Enum.all?(parts, &(byte_size(:erlang.term_to_binary(&1)) <= 1_200))

    differing = fn rows ->
      for part <- parts,
          {{:digest, first, until, digest}, 0} = Blackboard.Codec.read(part),
          robot <- AntiEntropy.differing(rows, digest, first, until),
          do: robot
    end

    assert differing.(rows.(100)) == []
    assert Enum.sort(differing.(Blackboard.State.new())) == Enum.sort(Map.keys(rows.(100).robots))
    # Rows that only the other has are found, too, wherever in the alphabet.
    more =
      merge(rows.(100), for(robot <- [:aaa1, :mag1x, :zzz1], do: {robot, :a, {1, 1}, 0, 1}), 0)

    assert Enum.sort(differing.(more)) == [:aaa1, :mag1x, :zzz1]
  end

  test "rows over a limit are refused, and an event says so" do
    rows = entered([:mag1], 1, robots: 2, keys: 2, bytes: 100)
    assert {:error, :bytes} = Blackboard.State.put(rows, :mag1, :a, :binary.copy("x", 101), 0)
    rows = rows |> put!(:mag1, :a, 1, 0) |> put!(:mag1, :b, 1, 0) |> put!(:mag1, :a, 2, 0)
    assert {:error, :keys} = Blackboard.State.put(rows, :mag1, :c, 1, 0)
    assert {:error, :not_own} = Blackboard.State.put(rows, :mag2, :a, 1, 0)

    assert {_, [{:refused, :bytes}]} =
             Blackboard.State.merge(rows, [{:mag2, :a, {1, 1}, 0, :binary.copy("x", 101)}], 0)

    incoming = for robot <- [:mag2, :mag3, :mag4, :mag5], do: {robot, :a, {1, 1}, 0, 1}
    {rows, notes} = Blackboard.State.merge(rows, incoming, 0)
    assert {:refused, :robots} in notes
    assert Enum.sort(Map.keys(rows.robots)) == [:mag1, :mag2, :mag3]
    # A new life may have as many keys again.
    {rows, []} = Blackboard.State.enter(rows, :mag1, 2, 0)
    rows = rows |> put!(:mag1, :c, 1, 0) |> put!(:mag1, :d, 1, 0)
    assert Map.keys(rows.robots.mag1) == [:c, :d]
  end

  test "a rival is reported and not accepted; a former life with a higher number is outbid" do
    rows = entered([:mag1], 5) |> put!(:mag1, :a, :mine, 0)

    assert {^rows, [{:rival, :mag1, 9}]} =
             Blackboard.State.merge(rows, [{:mag1, :a, {9, 1}, 100, :other}], 10)

    {outbid, notes} = Blackboard.State.merge(rows, [{:mag1, :a, {9, 1}, 6_000, :old}], 10)
    assert {:again, :mag1} in notes
    assert [{:mag1, :a, {10, 1}, 10, :mine}] = Blackboard.Rows.rows(outbid, :mag1, 10)

    # The same when the robot enters later.
    known = merge(Blackboard.State.new(), [{:mag1, :a, {9, 1}, 0, :old}], 0)
    assert {rivalled, [{:rival, :mag1, 9}]} = Blackboard.State.enter(known, :mag1, 5, 100)
    assert Blackboard.Rows.rows(rivalled, :mag1, 100) == []
    assert {entered, []} = Blackboard.State.enter(known, :mag1, 5, 6_000)

    assert [{:mag1, :a, {10, 1}, 0, :new}] =
             entered |> put!(:mag1, :a, :new, 6_000) |> Blackboard.Rows.rows(:mag1, 6_000)
  end

  test "a board that was lost learns its robot's sequence from the others" do
    rows = entered([:mag1]) |> put!(:mag1, :a, :newest, 0)
    theirs = [{:mag1, :a, {1, 40}, 300, :older}, {:mag1, :b, {1, 39}, 300, :kept}]
    {rows, notes} = Blackboard.State.merge(rows, theirs, 10)
    assert {:again, :mag1} in notes
    assert {:ok, :newest, 10} = get(rows, :mag1, :a, 10)
    assert {:ok, :kept, 300} = get(rows, :mag1, :b, 10)
    assert {:ok, {{1, 41}, :newest, 0}} = Blackboard.Rows.held(rows, :mag1, :a)

    other =
      merge(merge(Blackboard.State.new(), theirs, 10), Blackboard.Rows.rows(rows, :mag1, 10), 10)

    assert AntiEntropy.digest(other) == AntiEntropy.digest(rows)
  end

  test "robots long gone are forgotten, and so are old rows of a former life" do
    ten = 600_000

    rows =
      entered([:mag1])
      |> put!(:mag1, :a, 1, 0)
      |> merge([{:mag2, :a, {1, 1}, 0, 1}, {:mag3, :a, {1, 1}, 0, 1}], 0)

    rows = merge(rows, [{:mag3, :b, {2, 1}, 0, 1}], 5)
    assert {^rows, []} = Blackboard.State.forget(rows, ten - 1)
    {rows, gone} = Blackboard.State.forget(rows, ten)
    assert Enum.sort(gone) == [mag2: :a, mag3: :a]
    assert Enum.sort(Map.keys(rows.robots)) == [:mag1, :mag3]
    {rows, _} = Blackboard.State.forget(rows, ten + 5)
    assert Enum.sort(Map.keys(rows.robots)) == [:mag1]
    # An old row of a living robot stays.
    fresh =
      merge(Blackboard.State.new(), [{:mag2, :a, {1, 1}, ten, 1}, {:mag2, :b, {1, 2}, 0, 1}], 0)

    assert {^fresh, []} = Blackboard.State.forget(fresh, 0)
  end

  test "two boards that forget in turn do not pass each other old rows for ever" do
    gone =
      merge(Blackboard.State.new(), [{:mag1, :a, {1, 1}, 0, 1}, {:mag1, :b, {1, 2}, 0, 1}], 0)

    {a, b} =
      Enum.reduce(590..610, {gone, gone}, fn second, {a, b} ->
        {a, _} = Blackboard.State.forget(a, second * 1_000)
        a = merge(a, all(b, second * 1_000), second * 1_000)
        {b, _} = Blackboard.State.forget(b, second * 1_000 + 500)
        {a, merge(b, all(a, second * 1_000 + 500), second * 1_000 + 500)}
      end)

    assert a.robots == %{} and b.robots == %{}
  end

  test "nothing that arrives creates an atom or crashes" do
    junk = [
      nil,
      :x,
      1.5,
      "t",
      [],
      [1 | 2],
      %{},
      {:rows, 1},
      {:rows, [1 | 2]},
      {:digest, 1, 2, []},
      {:want, %{}}
    ]

    for term <- junk, do: assert(Blackboard.Codec.read(term) == :error)

    assert {{:rows, []}, 3} =
             Blackboard.Codec.read(
               {:rows,
                [{"mag1", 1, 1, 1, -1, ""}, {"nil", 1, 1, 1, 1, ""}, {:mag1, 1, 1, 1, 1, ""}]}
             )

    assert {{:have, []}, 2} =
             Blackboard.Codec.read({:have, [{"mag1", [{1, 1, -1}]}, {"mag1", [1 | 2]}]})

    for n <- 1..100 do
      name = "unheard of #{n}, #{:rand.uniform(1_000_000_000)}"
      assert {{:rows, []}, 1} = Blackboard.Codec.read({:rows, [{name, 1, 1, 1, 1, ""}]})
      assert_raise ArgumentError, fn -> String.to_existing_atom(name) end
    end

    assert Blackboard.Codec.decode(
             :erlang.term_to_binary(List.duplicate(0, 100_000), compressed: 9)
           ) ==
             :error

    assert Blackboard.Codec.decode(<<131, 119, 9, "zzunheard">>) == :error
  end
end
