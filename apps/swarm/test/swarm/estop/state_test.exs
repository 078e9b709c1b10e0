defmodule Swarm.EStop.StateTest do
  @moduledoc "The spreading of an emergency stop among robots that restart, and are cut off from each other."
  use ExUnit.Case, async: true
  alias Swarm.EStop.State

  doctest State

  @robots 0..3

  test "a stop pressed on a robot that has just started, and was cut off, reaches those that cleared one before" do
    fleet = quiet(press(fleet(), 1, 1))
    fleet = quiet(reset(fleet, @robots))

    # Two of the others have started again since then, and have heard how far the fleet has counted.
    fleet = quiet(%{fleet | 2 => State.new(), 3 => State.new()})
    fleet = press(%{fleet | 0 => State.new()}, 0, 2)
    # Those that know no better hear it first.
    fleet = fleet |> beat(0, 2) |> beat(2, 0) |> beat(0, 3)
    assert stopped(quiet(fleet)) == Enum.to_list(@robots)
  end

  test "two stops of the same count, pressed in two parts of a fleet, are not the same stop" do
    for call <- 1..50 do
      one = %{fleet() | 0 => State.press(State.new(), call(call))}
      others = reset(quiet(press(fleet(), 1, call + 100), 1..3), 1..3)
      both = %{others | 0 => one[0]}

      for order <- [both |> beat(0, 1), both |> beat(1, 0)],
          do: assert(stopped(quiet(order)) == [0, 1, 2, 3])
    end
  end

  test "robots that are reset one after the other do not stop each other again" do
    for seed <- 1..300 do
      {fleet, random} = run({fleet(), :rand.seed_s(:exsss, seed)}, 30)
      fleet = quiet(press(fleet, 0, 1_000 + seed))
      assert stopped(fleet) == Enum.to_list(@robots)

      {fleet, _random} =
        Enum.reduce(@robots, {fleet, random}, fn robot, {fleet, random} ->
          Enum.reduce(1..5, {reset(fleet, [robot]), random}, fn _beat, {fleet, random} ->
            {from, random} = draw(random, 4)
            {to, random} = draw(random, 4)
            {beat(fleet, from, to), random}
          end)
        end)

      assert stopped(quiet(fleet)) == []
    end
  end

  test "robots that have counted differently, and hear one call, do not stop each other again" do
    counted = for robot <- @robots, do: {robot, State.number(robot + 1, call(robot))}

    fleet =
      Map.new(counted, fn {robot, known} -> {robot, %State{known: known, cleared: known}} end)

    fleet = Map.new(fleet, fn {robot, stop} -> {robot, State.call(stop, call(9))} end)
    fleet = reset(fleet, [3])
    assert stopped(quiet(fleet)) == [0, 1, 2]
    assert stopped(quiet(reset(quiet(fleet), 0..2))) == []
  end

  test "whatever happens, a robot that hears a stopped one stands, unless that stop was cleared there" do
    for seed <- 1..2_000 do
      random = :rand.seed_s(:exsss, seed)
      {fleet, random} = run({fleet(), random}, 10)

      # The last stop is pressed, somewhere, and the fleet is connected again. It has been cleared nowhere.
      {robot, _random} = draw(random, 4)
      fleet = quiet(press(fleet, robot, 10_000 + seed))
      assert {seed, stopped(fleet)} == {seed, Enum.to_list(@robots)}
    end
  end

  defp fleet, do: Map.new(@robots, &{&1, State.new()})
  defp call(counter), do: {:base@hall, 1_700_000_000_000, counter}

  defp press(fleet, robot, counter),
    do: Map.update!(fleet, robot, &State.press(&1, call(counter)))

  defp reset(fleet, robots),
    do: Enum.reduce(robots, fleet, &Map.update!(&2, &1, fn stop -> State.reset(stop) end))

  defp beat(fleet, from, to) when from == to, do: fleet

  defp beat(fleet, from, to) do
    stop = State.hear(fleet[to], fleet[from].known, fleet[from].latched?)
    # What is known is never forgotten.
    assert stop.known >= fleet[to].known
    %{fleet | to => stop}
  end

  defp stopped(fleet), do: for(robot <- @robots, fleet[robot].latched?, do: robot)

  # They tell each other until nothing changes any more, which it must within a few heartbeats of each.
  defp quiet(fleet, robots \\ @robots) do
    Enum.reduce_while(1..12, fleet, fn round, fleet ->
      assert round < 12

      told =
        for(from <- robots, to <- robots, do: {from, to})
        |> Enum.reduce(fleet, fn {from, to}, fleet -> beat(fleet, from, to) end)

      if told == fleet, do: {:halt, fleet}, else: {:cont, told}
    end)
  end

  # Presses, resets, restarts and heartbeats, in any order.
  defp run(start, steps) do
    Enum.reduce(1..steps, start, fn step, {fleet, random} ->
      {kind, random} = draw(random, 10)
      {robot, random} = draw(random, 4)
      {other, random} = draw(random, 4)

      case kind do
        0 -> {press(fleet, robot, step), random}
        1 -> {reset(fleet, [robot]), random}
        2 -> {%{fleet | robot => State.new()}, random}
        _ -> {beat(fleet, robot, other), random}
      end
    end)
  end

  defp draw(random, n),
    do: :rand.uniform_s(n, random) |> then(fn {drawn, random} -> {drawn - 1, random} end)
end
