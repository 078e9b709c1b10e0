defmodule Swarm.Formation.Assignment do
  @moduledoc """
  Assigns slots to robots. Pure and exact: costs are whole numbers (mm squared), so that every
  robot that computes from the same record gets the same answer.

  `:chain` is the thesis's order by distance to the leader, `O(n log n)`. `:cost` minimises the
  sum of squared distances, which keeps straight paths apart if all start together (Turpin,
  Michael, Kumar 2014); it is the shortest augmenting path algorithm of Jonker and Volgenant,
  `O(n^3)`.
  """

  @type millimetres :: {integer(), integer()}
  @type method :: :chain | :cost

  @doc """
  The robots in the order of the slots. `robots` are `{id, {x_mm, y_mm}}`, without the leader.

      iex> robots = [b: {-2000, 0}, a: {-1000, 0}]
      iex> Swarm.Formation.Assignment.order(:chain, robots, {0, 0}, [{-1000, 0}, {-2000, 0}])
      [:a, :b]
      iex> Swarm.Formation.Assignment.order(:cost, [a: {0, 9}, b: {0, 1}], {0, 0}, [{0, 10}, {0, 0}])
      [:a, :b]
  """
  @spec order(method(), [{atom(), millimetres()}], millimetres(), [millimetres()]) :: [atom()]
  def order(:chain, robots, leader, _slots), do: Swarm.Formation.Chain.order(robots, leader)

  def order(:cost, robots, _leader, slots) do
    robots = Enum.sort(robots)
    costs = for {_id, place} <- robots, do: for(slot <- slots, do: squared(place, slot))
    ids = robots |> Enum.map(&elem(&1, 0)) |> List.to_tuple()

    costs
    |> match()
    |> Enum.with_index()
    |> Enum.sort()
    |> Enum.map(fn {_slot, robot} -> elem(ids, robot) end)
  end

  @doc """
  The column of each row in the cheapest perfect matching of a square matrix of integers.

      iex> Swarm.Formation.Assignment.match([[4, 1, 3], [2, 0, 5], [3, 2, 2]])
      [1, 0, 2]
      iex> Swarm.Formation.Assignment.match([])
      []
  """
  @spec match([[integer()]]) :: [non_neg_integer()]
  def match([]), do: []

  def match(rows) do
    n = length(rows)
    costs = rows |> Enum.map(&List.to_tuple/1) |> List.to_tuple()
    zero = Map.new(0..n, &{&1, 0})

    {owner, _u, _v} = Enum.reduce(1..n, {%{}, zero, zero}, &augment(&1, &2, costs, n))

    owner = for {column, row} <- owner, column > 0, do: {row, column - 1}
    owner |> Enum.sort() |> Enum.map(&elem(&1, 1))
  end

  # Rows and columns count from 1; the path starts at column 0. A free column is `{column, potential, way, from}`: the
  # shortest way to it so far, `nil` for none, and the column before it.
  defp augment(row, {owner, u, v}, costs, n) do
    owner = Map.put(owner, 0, row)
    free = for j <- 1..n, do: {j, Map.fetch!(v, j), nil, 0}
    {last, length, settled, from} = grow(0, 0, free, [], %{}, {owner, u, costs})

    {u, v} =
      Enum.reduce(settled, {u, v}, fn {j, at}, {u, v} ->
        i = Map.fetch!(owner, j)
        more = length - at
        {%{u | i => Map.fetch!(u, i) + more}, %{v | j => Map.fetch!(v, j) - more}}
      end)

    {flip(last, owner, from), u, v}
  end

  # One step of Dijkstra's search, from a column that is settled at the end of a way of this length.
  defp grow(column, length, free, settled, from, {owner, u, costs} = graph) do
    row = Map.fetch!(owner, column)
    base = length - Map.fetch!(u, row)
    free = relax(free, elem(costs, row - 1), base, column)
    {next, _potential, way, before} = nearest = nearest(free)
    settled = [{column, length} | settled]
    from = Map.put(from, next, before)

    if is_map_key(owner, next),
      do: grow(next, way, List.delete(free, nearest), settled, from, graph),
      else: {next, way, settled, from}
  end

  defp relax([{j, potential, known, _from} = column | free], row, base, by) do
    way = base + elem(row, j - 1) - potential

    if known != nil and known <= way,
      do: [column | relax(free, row, base, by)],
      else: [{j, potential, way, by} | relax(free, row, base, by)]
  end

  defp relax([], _row, _base, _by), do: []

  # The first of the nearest.
  defp nearest([column | free]), do: nearest(free, column)

  defp nearest([{_, _, way, _} = column | free], {_, _, least, _}) when way < least,
    do: nearest(free, column)

  defp nearest([_column | free], best), do: nearest(free, best)
  defp nearest([], best), do: best

  defp flip(0, owner, _from), do: owner

  defp flip(column, owner, from) do
    before = Map.fetch!(from, column)
    flip(before, Map.put(owner, column, Map.fetch!(owner, before)), from)
  end

  defp squared({ax, ay}, {bx, by}), do: (ax - bx) * (ax - bx) + (ay - by) * (ay - by)
end
