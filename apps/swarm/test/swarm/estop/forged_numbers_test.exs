defmodule Swarm.EStop.ForgedNumbersTest do
  # One sender says a number at the end of its range; afterwards stops reach everybody, and
  # resets hold, as before. No stop is refused because of its number.
  use ExUnit.Case, async: true
  alias Swarm.EStop.{Calls, State}

  @last 0xFFFFFFFFFFFFFFFF
  # A number is a count with a tag of 16 bits.
  @tags 65_536
  @last_number 0xFFFFFFFFFFFFFFFFFFFF
  @boot 1_700_000_000_000
  @call {:base@hall, @boot, 1}

  # All hear each other's heartbeats, several times.
  defp beats(stops, times \\ 10) do
    Enum.reduce(1..times, stops, fn _, stops ->
      for {stop, n} <- Enum.with_index(stops) do
        for {other, m} <- Enum.with_index(stops), m != n, reduce: stop do
          stop -> State.hear(stop, other.known, other.latched?)
        end
      end
    end)
  end

  defp latched(stops), do: Enum.map(stops, & &1.latched?)
  defp all(stops, function), do: Enum.map(stops, function)

  test "a latched heartbeat stops, whatever its number, and leaves room for later ones" do
    for number <- [1, 100_001 * @tags, 1_000_000 * @tags, 500_000_000 * @tags, @last_number] do
      stop = State.hear(State.new(), number, true)
      assert stop.latched?
      assert stop.known <= 1_000_000 * @tags
      refute State.hear(State.reset(stop), stop.known, true).latched?
    end
  end

  test "after one heartbeat with the last number the fleet is stopped and reset as before" do
    for latched? <- [true, false], hearers <- [1, 2, 3] do
      {some, others} = Enum.split(List.duplicate(State.new(), 3), hearers)
      stops = beats(all(some, &State.hear(&1, @last_number, latched?)) ++ others)
      assert latched(stops) == List.duplicate(latched?, 3)
      stops = stops |> all(&State.reset/1) |> beats()
      assert latched(stops) == [false, false, false]
      [first | rest] = stops
      stops = beats([State.press(first, @call) | rest])
      assert latched(stops) == [true, true, true]
      assert Enum.all?(stops, &(&1.known < 10_000_000 * @tags))
      # A person resets one after the other, while the others are still latched.
      stops =
        for n <- 0..2, reduce: stops do
          stops -> stops |> List.update_at(n, &State.reset/1) |> beats(1)
        end

      assert latched(beats(stops)) == [false, false, false]
    end
  end

  test "a robot that is new to a fleet with a high number is stopped by it at once" do
    fleet =
      List.duplicate(
        %State{known: 7_000_000 * @tags, cleared: 6_999_999 * @tags, latched?: true},
        2
      )

    [new | _fleet] = beats([State.new() | fleet], 1)
    assert new.latched?
    stops = [State.new() | fleet] |> beats(100) |> all(&State.reset/1) |> beats()
    assert latched(stops) == [false, false, false]
  end

  test "a stop pressed by such a robot reaches the fleet by heartbeats alone" do
    fleet = List.duplicate(%State{known: 700_000 * @tags, cleared: 700_000 * @tags}, 2)
    assert latched(beats([State.press(State.new(), @call) | fleet], 20)) == [true, true, true]
  end

  test "a call with the last counter, or the last boot, does not hide the later calls of its node" do
    for forged <- [{:base@hall, @boot, @last}, {:base@hall, @last, @last}] do
      stop = State.new() |> State.call(forged) |> State.reset()

      stop =
        for counter <- 1..200, reduce: stop do
          stop ->
            called = State.call(stop, {:base@hall, @boot, counter})
            assert called.latched?
            reset = State.reset(called)
            # Repeats, of this call and of the forged one, change nothing.
            for repeat <- [{:base@hall, @boot, counter}, forged],
                do: assert(State.call(reset, repeat) == reset)

            reset
        end

      assert length(stop.calls) <= 64
    end
  end

  test "late calls with the last counter do not hide later calls either" do
    stop = State.late(State.new(), {:base@hall, @boot, @last})
    assert State.call(stop, {:base@hall, @boot, 1}).latched?
  end

  test "no two calls are new in turn, however far apart their counters are" do
    for _ <- 1..200 do
      calls =
        for _ <- 1..:rand.uniform(20),
            do:
              {Enum.random([:a@b, :b@c]), Enum.random([1, 2]),
               Enum.random([1, 9, 80, 9_999, @last])}

      heard = Enum.reduce(calls, [], &elem(Calls.hear(&2, &1), 1))
      for call <- calls, do: assert({false, ^heard} = Calls.hear(heard, call))
    end
  end
end
