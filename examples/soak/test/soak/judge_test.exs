defmodule Soak.JudgeTest do
  @moduledoc "Each wrong that the soak is for, as events by hand: it is found, once, and what is allowed is not."
  use ExUnit.Case, async: true
  alias Soak.Judge

  @s 1_000_000
  @robots [:a, :b, :c]
  @processes [":gate", "Swarm.EStop"]

  defp probe(robot, changes \\ %{}) do
    Map.merge(
      %{
        well: {true, "fine"},
        offline: [],
        processes: @processes,
        peers: @robots -- [robot],
        listed: @robots
      },
      Map.merge(%{bytes: 20_000_000, atoms: 14_000}, changes)
    )
  end

  # Events and looks by time: everything that was found wrong.
  defp judged(events, looks) do
    looks = for at <- looks, do: {round(at * @s), :look}
    events = for {at, who, kind, value} <- events, do: {round(at * @s), who, kind, value}

    {wrong, _judge} =
      Enum.flat_map_reduce(Enum.sort_by(looks ++ events, &elem(&1, 0)), Judge.new(@robots), fn
        {us, :look}, judge -> Judge.judge(judge, us)
        event, judge -> Judge.note(judge, event)
      end)

    wrong
  end

  defp up(at \\ 0), do: for(robot <- @robots, do: {at, :soak, :up, robot})

  defp lead(at, robot, epoch),
    do: {at, robot, :claim, %{phase: :lead, leader: robot, epoch: epoch}}

  defp follow(at, robot, leader, epoch),
    do: {at, robot, :claim, %{phase: :follow, leader: leader, epoch: epoch}}

  # All are well and one group, told each second.
  defp well(seconds, changes \\ %{}) do
    claims = [lead(0.5, :a, 1), follow(0.5, :b, :a, 1), follow(0.5, :c, :a, 1)]

    up() ++
      claims ++
      for(
        at <- seconds,
        robot <- @robots,
        do: {at, robot, :probe, probe(robot, Map.get(changes, {robot, at}, %{}))}
      )
  end

  test "all is well" do
    assert judged(well(1..60), 1..60) == []
  end

  describe "leaders" do
    test "two for longer than the lease are found, and told once" do
      events = up() ++ [lead(10, :a, 1), lead(11, :b, 2)]
      assert judged(events, [11.5, 12.5]) == []

      assert ["a (epoch 1) and b (epoch 2) have both led for 2000 ms"] =
               judged(events, [12.5, 13, 13.5, 14])
    end

    test "two in one epoch are found at once" do
      assert ["a and b both lead in epoch 3"] =
               judged(up() ++ [lead(10, :a, 3), lead(11, :b, 3)], [11, 11.2])
    end

    test "those that are cut off from each other may, till the cut has been healed for long enough" do
      events = up() ++ [{9, :soak, :cut, [{:b, :a}]}, lead(10, :a, 3), lead(11, :b, 3)]
      assert judged(events, [11, 15, 19]) == []
      assert judged(events ++ [{20, :soak, :heal, nil}], [21, 23.7]) == []
      assert [_two] = judged(events ++ [{20, :soak, :heal, nil}], [24])
    end

    test "one that is frozen claims nothing, and has a lease when it thaws" do
      events = up() ++ [lead(10, :a, 1), {11, :soak, :freeze, :a}, lead(13, :b, 2)]
      assert judged(events, [15, 16]) == []
      assert judged(events ++ [{16, :soak, :thaw, :a}, follow(17, :a, :b, 2)], 16..19) == []
      assert [_two] = judged(events ++ [{16, :soak, :thaw, :a}], 16..20)
    end

    test "one whose node was killed leads no more" do
      assert judged(up() ++ [lead(10, :a, 1), {11, :soak, :down, :a}, lead(13, :b, 2)], 13..19) ==
               []
    end
  end

  describe "an e-stop" do
    test "that all hear is well" do
      events =
        up() ++ [{10, :soak, :estop, :a}] ++ for(robot <- @robots, do: {10.2, robot, :held, true})

      assert judged(events, [10.1, 10.5, 12, 20]) == []
    end

    test "that one does not hear is found" do
      events = up() ++ [{10, :soak, :estop, :a}, {10.2, :a, :held, true}, {10.2, :b, :held, true}]
      assert judged(events, [10.2, 11.4]) == []
      assert ["c is not held 1600 ms after the e-stop on a"] = judged(events, [11.6, 12])
    end

    test "passes by way of others, and waits for those that are cut off" do
      cut =
        up() ++
          [
            {5, :soak, :cut, [{:a, :c}]},
            {10, :soak, :estop, :a},
            {10.2, :a, :held, true},
            {10.2, :b, :held, true}
          ]

      assert [_by_b] = judged(cut, [12])
      off = [{6, :soak, :cut, [{:b, :c}]} | cut]
      assert judged(off, [12, 20]) == []
      healed = [{21, :soak, :heal, nil} | off]
      assert judged(healed, [22, 27]) == []
      assert [_late] = judged(healed, [28])
      assert judged([{26, :c, :held, true} | healed], [27, 28, 29]) == []
    end

    test "is asked of a robot that has forgotten it only where another one knows it" do
      cut = [
        {5, :soak, :cut, [{:a, :b}, {:a, :c}]},
        {10, :soak, :estop, :a},
        {10.2, :a, :held, true}
      ]

      again = [
        {11, :soak, :down, :a},
        {11, :a, :held, nil},
        {12, :soak, :heal, nil},
        {15, :soak, :up, :a},
        {15.1, :a, :held, false}
      ]

      assert judged(up() ++ cut ++ again, [20, 30]) == []
      knows = [{14, :b, :held, true}]
      assert [_a, _c] = judged(up() ++ cut ++ again ++ knows, [30])
    end

    test "one that was answered not to have been carried out holds nobody; the next one does" do
      refused = up() ++ [{10, :soak, :estop, :a}, {10.1, :soak, :estop_refused, :a}]
      assert judged(refused, [12, 20]) == []
      next = [{10.1, :soak, :estop, :b}, {10.3, :b, :held, true}, {10.3, :a, :held, true}]
      assert ["c is not held 1900 ms after the e-stop on b"] = judged(refused ++ next, [12])
    end

    test "that is not released everywhere is found" do
      stopped = [{5, :soak, :estop, :a}, {5.1, :c, :held, true}, {10, :soak, :reset, nil}]

      assert ["all, 26 s after the last disturbance: c is held"] =
               judged(well(1..40) ++ stopped, [35, 36])
    end
  end

  describe "health" do
    test "a process that does not come back is found" do
      lost = for at <- 10..40, into: %{}, do: {{:b, at}, %{processes: [":gate"]}}
      events = well(1..40, lost) ++ [{9, :soak, :process, :b}]
      assert judged(events, 10..28) == []

      assert ["b, 20 s after the last disturbance: Swarm.EStop does not run"] =
               judged(events, [28.9, 29.5])
    end

    test "a device that stays offline, and a robot that is not well in systemd's words, are found" do
      for sick <- [%{offline: [:ptz]}, %{well: {false, "b: its gate hangs"}}] do
        lost = for at <- 10..40, into: %{}, do: {{:b, at}, sick}
        assert [line] = judged(well(1..40, lost) ++ [{9, :soak, :process, :b}], [30])
        assert line =~ "ptz is offline" or line =~ "its gate hangs"
      end
    end

    test "a node that does not come back, or tells nothing, is found" do
      gone = [{10, :soak, :down, :c}]
      told = for {at, _who, _kind, _value} = event <- well(1..9), at < 10, do: event
      others = for at <- 10..40, robot <- [:a, :b], do: {at, robot, :probe, probe(robot)}
      assert judged(told ++ gone ++ others, 10..30) == []

      assert ["c, 20 s after the last disturbance: it tells nothing"] =
               judged(told ++ gone ++ others, [30.5])
    end

    test "robots that do not hear or list each other, or are in two groups, are found" do
      for lost <- [%{peers: [:b]}, %{listed: [:a, :b]}] do
        changes = for at <- 10..40, into: %{}, do: {{:a, at}, lost}
        assert [line] = judged(well(1..40, changes) ++ [{9, :soak, :heal, nil}], [35])
        assert line =~ "a does not hear c" or line =~ "a does not list c"
      end

      assert [line] = judged(well(1..40) ++ [{9, :soak, :heal, nil}, follow(9, :c, :c, 2)], [35])
      assert line =~ "2 groups"

      assert [line] =
               judged(well(1..40) ++ [{9, :soak, :heal, nil}, {9, :c, :claim, %{phase: :idle}}], [
                 35
               ])

      assert line =~ "in no group: c"
    end
  end

  describe "growth" do
    test "memory and atoms that grow are found, and a node that starts again begins anew" do
      grown = fn change -> Enum.filter(well(1..400, change), &(elem(&1, 2) != :claim)) end
      more = for at <- 1..400, into: %{}, do: {{:a, at}, %{bytes: 20_000_000 + 60_000 * at}}
      assert ["a has grown from " <> _] = judged(grown.(more), [])
      atoms = for at <- 1..400, into: %{}, do: {{:a, at}, %{atoms: 14_000 + 5 * at}}
      assert ["a has grown from " <> _] = judged(grown.(atoms), [])
      assert judged(grown.(more) ++ [{150, :soak, :up, :a}, {300, :soak, :up, :a}], []) == []
    end

    test "what waits to be collected is not taken for growth" do
      wave =
        for at <- 1..400,
            into: %{},
            do: {{:a, at}, %{bytes: 20_000_000 + 1_000_000 * rem(at, 40)}}

      assert judged(well(1..400, wave), []) == []
    end
  end

  test "collisions and processes that were left behind are found" do
    counts =
      for {at, count} <- [{1, 0}, {2, 2}, {3, 2}],
          do: {at, :soak, :collisions, {count, ["b and c", "a and b", "an old one"]}}

    assert judged(counts, []) == ["2 new collisions: a and b; b and c"]

    assert ["a has left processes behind: 17 erl"] =
             judged([{1, :soak, :orphans, {:a, ["17 erl"]}}], [])
  end
end
