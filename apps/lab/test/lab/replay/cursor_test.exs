defmodule Lab.Replay.CursorTest do
  use Lab.LockstepCase, async: true
  alias Lab.{Replay, Trial}
  alias Lab.Replay.Cursor

  setup_all do
    options = %{robots: [:mag1, :mag2, :min1], seed: 5, blobs: :direct, kills: [{:leader, 9}]}
    {:ok, setup} = Trial.setup(options)

    {ticks, _trial} =
      Enum.map_reduce(1..120, Trial.begin(setup, record: true), fn _n, trial ->
        {entries, trial} = trial |> Trial.step() |> Trial.take_entries()
        {{trial.at_ms, entries}, trial}
      end)

    # The replay after each tick, as one that only goes forwards has it.
    {all, _replay} =
      Enum.map_reduce(ticks, Replay.new(setup), fn tick, replay ->
        {next, []} = Replay.step(replay, tick)
        {next, next}
      end)

    %{setup: setup, ticks: ticks, all: [Replay.new(setup) | all]}
  end

  defp from(ticks), do: fn ms -> Enum.filter(ticks, fn {at_ms, _} -> at_ms >= ms end) end

  defp is_at(cursor, number, %{all: all, ticks: ticks}) do
    assert cursor.here.number == number
    assert cursor.here.replay == Enum.at(all, number)
    assert cursor.here.before == if(number > 0, do: Enum.at(all, number - 1))
    assert cursor.here.tick == if(number > 0, do: Enum.at(ticks, number - 1))
    cursor
  end

  test "wherever one goes, forwards or backwards, the run is as it was there", context do
    random = :rand.seed_s(:exsss, 7)
    cursor = Cursor.new(Replay.new(context.setup), from(context.ticks), every: 8, most: 4)

    Enum.reduce(1..40, {cursor, 0, random}, fn _n, {cursor, number, random} ->
      {count, random} = :rand.uniform_s(101, random)
      to = max(0, min(120, number + count - 51))
      {cursor, []} = Cursor.step(cursor, count - 51)
      assert length(cursor.kept) <= 4
      {is_at(cursor, to, context), to, random}
    end)
  end

  test "one step and one step back lead to the same place, also at a state that is kept",
       context do
    {cursor, []} =
      Cursor.new(Replay.new(context.setup), from(context.ticks), every: 10) |> Cursor.step(30)

    {on, []} = Cursor.step(cursor, 1)
    {back, []} = Cursor.step(on, -1)
    assert back.here == cursor.here
    is_at(back, 30, context)
  end

  test "times lead to the last tick that has ended then", context do
    cursor = Cursor.new(Replay.new(context.setup), from(context.ticks))
    {cursor, []} = Cursor.goto(cursor, 5_050)
    is_at(cursor, 50, context)
    assert Cursor.at_ms(cursor) == 5_000
    {cursor, []} = Cursor.goto(cursor, 4_999)
    is_at(cursor, 49, context)
    {cursor, []} = Cursor.goto(cursor, 0)
    is_at(cursor, 0, context)
    {cursor, []} = Cursor.goto(cursor, 1_000_000)
    is_at(cursor, 120, context)
  end

  test "it goes on until something happens, or to the end", context do
    cursor = Cursor.new(Replay.new(context.setup), from(context.ticks))
    dead? = fn replay -> map_size(Replay.trial(replay).members) < 3 end
    {cursor, []} = Cursor.until(cursor, dead?)
    assert dead?.(cursor.here.replay) and not dead?.(cursor.here.before)
    is_at(cursor, cursor.here.number, context)
    {cursor, []} = Cursor.until(cursor, fn _replay -> false end)
    is_at(cursor, 120, context)
    {same, []} = Cursor.step(cursor, 1)
    assert same.here == cursor.here
  end

  test "a tick that differs is told when it is passed first, and where one is", context do
    ticks =
      List.update_at(context.ticks, 19, fn {at_ms, entries} ->
        {at_ms, Enum.map(entries, &wrong/1)}
      end)

    cursor = Cursor.new(Replay.new(context.setup), from(ticks), every: 10)
    {cursor, [_ | _] = found} = Cursor.step(cursor, 25)
    assert length(found) <= 3
    {cursor, []} = Cursor.step(cursor, -10)
    {cursor, []} = Cursor.step(cursor, 5)
    assert [{:decision, _} | _] = cursor.here.differences
  end

  defp wrong({:step, id, input, [_first | effects]}), do: {:step, id, input, effects}
  defp wrong(entry), do: entry
end
