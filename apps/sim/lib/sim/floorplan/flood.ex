defmodule Sim.Floorplan.Flood do
  @moduledoc "Finds what can be reached from a place by free ways of a certain width. Pure."

  @typedoc "Numbers of cells; the nearest by way first."
  @type cells :: [non_neg_integer()]

  @doc """
  The cells that are reached from cell `from` over cells whose byte in the field is at least
  `way`, and whose own is at least `good`: at least `enough` of them unless there are no more, then
  `:all`. With both the whole area that was passed.
  """
  @spec reach(Sim.Floorplan.t(), non_neg_integer(), pos_integer(), pos_integer(), pos_integer()) ::
          {:some | :all, cells(), passed :: MapSet.t()}
  def reach(map, from, way, good, enough) do
    if :binary.at(map.field, from) >= way,
      do: wave(map, [from], MapSet.new([from]), way, good, {enough, 0, []}),
      else: {:all, [], MapSet.new()}
  end

  defp wave(_map, [], seen, _way, _good, {_enough, _count, found}),
    do: {:all, Enum.reverse(found), seen}

  defp wave(_map, _front, seen, _way, _good, {enough, count, found}) when count >= enough,
    do: {:some, Enum.reverse(found), seen}

  defp wave(map, front, seen, way, good, {enough, count, found}) do
    {count, found} =
      Enum.reduce(front, {count, found}, fn cell, {count, found} ->
        if :binary.at(map.field, cell) >= good,
          do: {count + 1, [cell | found]},
          else: {count, found}
      end)

    {next, seen} =
      Enum.reduce(front, {[], seen}, fn cell, acc ->
        Enum.reduce([-map.width, -1, 1, map.width], acc, &step(map, cell + &1, cell, way, &2))
      end)

    wave(map, Enum.reverse(next), seen, way, good, {enough, count, found})
  end

  # A neighbour on the plan: a row neither ends in the next one, nor does the plan go on.
  defp step(map, to, from, way, {next, seen}) do
    if to >= 0 and to < byte_size(map.field) and
         abs(rem(to, map.width) - rem(from, map.width)) <= 1 and
         :binary.at(map.field, to) >= way and not MapSet.member?(seen, to),
       do: {[to | next], MapSet.put(seen, to)},
       else: {next, seen}
  end
end
