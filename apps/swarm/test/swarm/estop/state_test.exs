defmodule Swarm.EStop.StateTest do
  @moduledoc "The spreading of emergency stops among robots that restart, and are cut off from each other."
  use ExUnit.Case, async: true
  alias Swarm.EStop.State

  doctest State

  @robots 0..3
  @all Enum.to_list(@robots)

  test "a stop pressed on a robot that has just started, and was cut off, reaches those that cleared one before" do
    fleet = fleet() |> press(1, 1) |> quiet() |> reset(@robots) |> quiet()
    # Two of the others have started again since then.
    fleet = quiet(%{fleet | 2 => State.new(), 3 => State.new()})
    fleet = press(%{fleet | 0 => State.new()}, 0, 2)
    # Those that have forgotten hear it first.
    assert fleet |> beat(0, 2) |> beat(2, 0) |> beat(0, 3) |> quiet() |> held() == @all
  end

  test "a robot that is held by one stop is held by the next, too, and passes it on" do
    one = fleet() |> press(1, 1) |> beat(1, 0) |> reset([1])
    assert one |> press(0, 2) |> beat(0, 1) |> held() == [0, 1]
    assert one |> hear_call(0, 2) |> beat(0, 1) |> held() == [0, 1]
    # Two stops meet in a robot that passes both on.
    two =
      fleet()
      |> press(0, 1)
      |> beat(0, 1)
      |> reset([1])
      |> press(3, 2)
      |> beat(3, 2)
      |> reset([3])

    assert two |> beat(0, 2) |> beat(2, 0) |> quiet() |> held() == @all
  end

  test "robots that are reset one after the other do not stop each other again" do
    for seed <- 1..300 do
      {fleet, random} = run({fleet(), :rand.seed_s(:exsss, seed)}, 30)
      fleet = fleet |> press(0, 1_000) |> quiet()
      assert held(fleet) == @all

      {fleet, _random} =
        Enum.reduce(@robots, {fleet, random}, fn robot, {fleet, random} ->
          Enum.reduce(1..5, {reset(fleet, [robot]), random}, fn _beat, {fleet, random} ->
            {from, random} = draw(random, 4)
            {to, random} = draw(random, 4)
            {beat(fleet, from, to), random}
          end)
        end)

      assert fleet |> quiet() |> held() == []
    end
  end

  test "whatever happens, the robots that hear each other are held by every stop that none of them has cleared" do
    for seed <- 1..3_000 do
      {fleet, random} = run({fleet(), :rand.seed_s(:exsss, seed)}, 12)
      {robot, _random} = draw(random, 4)
      before = fleet
      fleet = quiet(fleet)

      for {robot, stop} <- fleet, {_other, %{held: tags}} <- before do
        assert {seed, robot, (tags -- stop.held) -- stop.cleared} == {seed, robot, []}
      end

      assert {seed, fleet |> press(robot, 1_000) |> quiet() |> held()} == {seed, @all}
    end
  end

  defp fleet, do: Map.new(@robots, &{&1, State.new()})
  defp call(counter), do: {:base@hall, 1_700_000_000_000, counter}

  defp press(fleet, robot, counter),
    do: Map.update!(fleet, robot, &State.press(&1, call(counter)))

  defp hear_call(fleet, robot, counter),
    do: Map.update!(fleet, robot, &State.call(&1, call(counter)))

  defp reset(fleet, robots),
    do: Enum.reduce(robots, fleet, &Map.update!(&2, &1, fn stop -> State.reset(stop) end))

  defp beat(fleet, same, same), do: fleet
  defp beat(fleet, from, to), do: Map.update!(fleet, to, &State.hear(&1, fleet[from].held))
  defp held(fleet), do: for(robot <- @robots, State.held?(fleet[robot]), do: robot)

  # They tell each other until nothing changes any more, which takes two rounds.
  defp quiet(fleet) do
    [one, two] = Enum.take(Stream.iterate(tell(fleet), &tell/1), 2)
    assert one == two
    one
  end

  defp tell(fleet),
    do:
      for(
        _twice <- 1..2,
        from <- @robots,
        to <- @robots,
        reduce: fleet,
        do: (fleet -> beat(fleet, from, to))
      )

  # Presses, calls that some hear, resets, restarts and heartbeats, in any order.
  defp run(start, steps) do
    Enum.reduce(1..steps, start, fn step, {fleet, random} ->
      {kind, random} = draw(random, 10)
      {robot, random} = draw(random, 4)
      {other, random} = draw(random, 4)

      case kind do
        0 -> {press(fleet, robot, step), random}
        1 -> {fleet |> hear_call(robot, step) |> hear_call(other, step), random}
        2 -> {reset(fleet, [robot]), random}
        3 -> {%{fleet | robot => State.new()}, random}
        _ -> {beat(fleet, robot, other), random}
      end
    end)
  end

  defp draw(random, n),
    do: :rand.uniform_s(n, random) |> then(fn {drawn, random} -> {drawn - 1, random} end)
end
