defmodule Swarm.EStop.ForgedNumbersTest do
  # One sender says what nobody has said; afterwards stops reach everybody, and resets hold, as
  # before. No stop is refused because of what it is called.
  use ExUnit.Case, async: true
  alias Swarm.EStop.{Calls, State}

  @last 0xFFFFFFFFFFFFFFFF
  @last_tag 0xFFFFFFFF
  @boot 1_700_000_000_000
  @call {:base@hall, @boot, 1}

  # All hear each other's heartbeats, several times.
  defp beats(stops, times \\ 10) do
    Enum.reduce(1..times, stops, fn _, stops ->
      for {stop, n} <- Enum.with_index(stops) do
        for {other, m} <- Enum.with_index(stops), m != n, reduce: stop do
          stop -> State.hear(stop, other.held)
        end
      end
    end)
  end

  defp held(stops), do: Enum.map(stops, &State.held?/1)
  defp all(stops, function), do: Enum.map(stops, function)

  test "a heartbeat with as many stops as it may have, and the last tag, stops, and leaves room for later ones" do
    for tags <- [[0], [@last_tag], Enum.to_list((@last_tag - 15)..@last_tag)] do
      stop = State.hear(State.new(), tags)
      assert State.held?(stop)
      reset = State.reset(stop)
      refute State.held?(State.hear(reset, tags))
      assert State.held?(State.hear(reset, [State.tag(@call)]))
      assert State.held?(State.call(reset, @call))
    end
  end

  test "after a flood of forged stops the fleet is stopped and reset as before, and remembers no more" do
    for hearers <- [1, 2, 3] do
      {some, others} = Enum.split(List.duplicate(State.new(), 3), hearers)

      flooded =
        for flood <- 1..200, reduce: some do
          some -> all(some, &State.hear(&1, Enum.to_list((flood * 16)..(flood * 16 + 15))))
        end

      stops = beats(flooded ++ others)
      assert held(stops) == [true, true, true]
      assert Enum.all?(stops, &(length(&1.held) == 16))
      # One that is full is pressed, and reaches another that was reset meanwhile.
      [first, second, third] = stops
      pressed = [State.press(first, @call), State.reset(second), third]
      assert [_, true, _] = held(beats(pressed))
      stops = stops |> all(&State.reset/1) |> beats()
      assert held(stops) == [false, false, false]
      [first | rest] = stops
      stops = beats([State.press(first, @call) | rest])
      assert held(stops) == [true, true, true]
      # A person resets one after the other, while the others are still held.
      stops =
        for n <- 0..2, reduce: stops do
          stops -> stops |> List.update_at(n, &State.reset/1) |> beats(1)
        end

      assert held(beats(stops)) == [false, false, false]
    end
  end

  test "a stop that is said twice in a heartbeat is the same stop, also after a reset" do
    stop = State.hear(State.new(), [7, 7, 8])
    assert stop.held == [7, 8]
    refute State.held?(State.hear(State.reset(stop), [7, 8, 7, 7]))
  end

  test "who is pressed more often than can be told is not stopped again by what the others still say" do
    [one, other] =
      for n <- 1..40, reduce: [State.new(), State.new()] do
        [one, other] ->
          one = State.press(one, {:base@hall, @boot, n})
          [one, State.hear(other, one.held)]
      end

    refute State.held?(State.hear(State.reset(one), other.held))
  end

  test "what was cleared is remembered up to a limit, the last first" do
    stop =
      for tag <- 1..10_000, reduce: State.new() do
        stop -> stop |> State.hear([tag]) |> State.reset()
      end

    assert length(stop.cleared) == 256
    refute State.held?(State.hear(stop, Enum.to_list(9_985..10_000)))
  end

  test "a call with the last counter, or the last boot, does not hide the later calls of its node" do
    for forged <- [{:base@hall, @boot, @last}, {:base@hall, @last, @last}] do
      stop = State.new() |> State.call(forged) |> State.reset()

      stop =
        for counter <- 1..200, reduce: stop do
          stop ->
            called = State.call(stop, {:base@hall, @boot, counter})
            assert State.held?(called)
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
    assert State.held?(State.call(stop, {:base@hall, @boot, 1}))
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
