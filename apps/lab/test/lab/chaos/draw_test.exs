defmodule Lab.Chaos.DrawTest do
  use Lab.LockstepCase, async: true
  @moduletag :slow
  alias Lab.Chaos.{Draw, Random}
  alias Lab.Trial.{Options, Setup}

  doctest Lab.Chaos.Random
  doctest Lab.Chaos.Draw

  test "the same seed and number give the same run, others give others" do
    runs = for n <- 1..20, do: Draw.options(7, n)
    assert runs == for(n <- 1..20, do: Draw.options(7, n))
    assert length(Enum.uniq(runs)) == 20
    assert Draw.options(8, 1) != Draw.options(7, 1)
  end

  # There are three maps and thirteen sizes of fleets.
  defp maps do
    plans =
      for map <- ["hall", "hospital", "arena"], robots <- [20 | Enum.to_list(1..12)], into: %{} do
        {{map, robots}, Sim.Floorplan.open(map, robots)}
      end

    fn map, robots -> Map.fetch!(plans, {map, robots}) end
  end

  defp draws(numbers) do
    open = maps()

    numbers
    |> Task.async_stream(&Draw.options(1, &1, open), timeout: :infinity)
    |> Enum.map(fn {:ok, run} -> run end)
  end

  defp valid!(run) do
    assert {:ok, options} = Options.check(run)
    assert length(options.robots) in 1..12 or length(options.robots) == 20
    assert options.duration_s in 60..240
    assert length(options.kills) <= div(length(options.robots), 2)

    for {at_s, _event} <- options.script, do: assert(at_s < options.duration_s)
    for {_place, at_s} <- options.moves, do: assert(at_s <= options.duration_s - 40)
  end

  test "a hundred draws are valid, and nothing comes too late" do
    Enum.each(draws(1..100), &valid!/1)
  end

  test "who crashes or hangs is started again within 5 s" do
    broken =
      for run <- draws(1..100),
          {at_s, event} <- run[:script],
          elem(event, 0) in [:crash, :hang] do
        starts = for {start_s, {:tell, :all, :start}} <- run[:script], do: start_s - at_s
        assert Enum.any?(starts, &(&1 > Lab.Trial.Event.lasts_s(event) and &1 <= 5))
        elem(event, 2)
      end

    assert broken |> Enum.uniq() |> Enum.sort() == [:comms, :estop, :executive, :gate, :pilot]
  end

  @tag :long
  @tag timeout: :infinity
  test "so are two thousand, and all kinds of everything occur" do
    runs = draws(1..2_000)
    Enum.each(runs, &valid!/1)
    drawn = fn key -> runs |> Enum.map(& &1[key]) |> Enum.uniq() end
    assert Enum.sort(drawn.(:map)) == ["arena", "hall", "hospital"]
    assert Enum.sort(drawn.(:noise)) == [:default, :off, :slip]
    assert Enum.sort(drawn.(:lost_link)) == [:continue, :hold, nil, :stop]
    assert Enum.sort(drawn.(:blobs)) == [:direct, :painted]
    assert length(Enum.uniq(for {kind, _spacing} <- drawn.(:formation), do: kind)) == 6

    events = for run <- runs, {_at_s, event} <- run[:script], uniq: true, do: elem(event, 0)

    assert Enum.sort(events) ==
             [:blind, :crash, :deaf, :estop, :freeze, :hang, :loss, :reset, :tell]

    cuts = for run <- runs, {_from_s, to_s, what} <- run[:cuts], do: {to_s, what}
    assert Enum.any?(cuts, &match?({:end, _what}, &1))
    for kind <- [:link, :way], do: assert(Enum.any?(cuts, &match?({_to_s, {^kind, _, _}}, &1)))
    assert Enum.any?(cuts, &match?({_to_s, [_, _]}, &1))
  end

  test "places where the landmark goes are free, and the fleet has room" do
    for n <- 1..20, run = Draw.options(2, n) do
      assert {:ok, _setup} = Setup.new(run)
    end
  end

  test "weights are kept" do
    {all, _random} =
      Random.times(Random.new(1, 1), 1_000, &Random.weighted(&1, often: 3, seldom: 1, never: 0))

    counts = Enum.frequencies(all)
    assert counts.often in 700..800
    refute is_map_key(counts, :never)
  end
end
