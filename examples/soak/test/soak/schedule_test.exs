defmodule Soak.ScheduleTest do
  use ExUnit.Case, async: true
  alias Soak.{Junk, Schedule}

  doctest Schedule
  doctest Junk
  doctest Soak.Journal
  doctest Soak.Links
  doctest Soak.Main, except: [run: 2]

  @robots ~w(mag1 mag2 mag3 min1 min2 min3)a
  @hour 3_600_000

  test "it is a function of the seed" do
    assert Schedule.new(5, @hour, @robots, true) == Schedule.new(5, @hour, @robots, true)
    assert Schedule.new(5, @hour, @robots, true) != Schedule.new(6, @hour, @robots, true)
  end

  test "an hour holds every kind, in order of time, and none after the end" do
    for seed <- 1..20 do
      plan = Schedule.new(seed, @hour, @robots, true)
      times = for {at, _deed} <- plan, do: at
      assert times == Enum.sort(times)
      assert hd(times) >= 0 and List.last(times) < @hour
      kinds = for {_at, deed} <- plan, uniq: true, do: kind(deed)
      assert Schedule.kinds() -- kinds == []
      assert [:estop, :reset, :start, :calm, :formation, :landmark] -- kinds == []
    end
  end

  test "changes of the network never overlap, and where none can be made there are none" do
    for seed <- 1..20 do
      spans =
        for {at, deed} <- Schedule.new(seed, @hour, @robots, true),
            ms = lasts(deed),
            do: {at, at + ms}

      for [{_from, until}, {from, _until}] <- Enum.chunk_every(spans, 2, 1, :discard),
          do: assert(from > until)

      assert for({_at, deed} <- Schedule.new(seed, @hour, @robots, false), lasts(deed), do: deed) ==
               []
    end
  end

  test "both halves of a cut hold all robots, and freezes are from 0.2 to 5 s" do
    for seed <- 1..20, {_at, deed} <- Schedule.new(seed, @hour, @robots, true) do
      case deed do
        {:split, [[_ | _] = one, [_ | _] = other], _ms} ->
          assert Enum.sort(one ++ other) == Enum.sort(@robots)

        {:freeze, _robot, ms} ->
          assert ms in 200..5_000

        _other ->
          :ok
      end
    end
  end

  test "in the calm part of a cycle nothing is disturbed" do
    for seed <- 1..20,
        {_at, deed} <- calm(Schedule.new(seed, @hour, @robots, true)),
        do: assert(kind(deed) == :start)
  end

  test "a run of a few seconds has disturbances, too" do
    for seed <- 1..20 do
      assert Enum.any?(Schedule.new(seed, 6_000, @robots, true), fn {_at, deed} ->
               kind(deed) in Schedule.kinds()
             end)
    end
  end

  test "junk is of its kind, and noise where nothing was recorded" do
    assert [_, _] = noise = Junk.datagrams(:recorded, 2, 1, [])
    assert Enum.all?(noise, &(byte_size(&1) in 1..1_400))
    changed = Junk.datagrams(:mutated, 100, 1, ["a datagram that was recorded"])
    assert length(changed) == 100
    assert Enum.count(changed, &(&1 != "a datagram that was recorded")) > 90
  end

  defp calm(plan) do
    {calm, _in_it?} =
      Enum.flat_map_reduce(plan, false, fn
        {_at, :calm}, _in_it? ->
          {[], true}

        {at, deed}, true ->
          if at >= next_cycle(at), do: {[], false}, else: {[{at, deed}], deed == :start}

        _deed, false ->
          {[], false}
      end)

    calm
  end

  # 75 s each.
  defp next_cycle(at), do: if(rem(at, 75_000) < 45_000, do: 0, else: at + 1)

  defp lasts({kind, _what, ms}) when kind in [:split, :loss], do: ms
  defp lasts({:block, _a, _b, ms}), do: ms
  defp lasts(_deed), do: nil

  defp kind(deed) when is_atom(deed), do: deed
  defp kind(deed), do: elem(deed, 0)
end
