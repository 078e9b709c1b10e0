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

    {owner, _u, _v} =
      Enum.reduce(1..n, {%{}, zero, zero}, fn row, potentials ->
        augment(row, potentials, costs, n)
      end)

    owner = for {column, row} <- owner, column > 0, do: {row, column - 1}
    owner |> Enum.sort() |> Enum.map(&elem(&1, 1))
  end

  # Rows and columns count from 1; the path starts at column 0.
  defp augment(row, {owner, u, v}, costs, n) do
    least = Map.new(1..n, &{&1, {nil, 0}})

    {last, owner, u, v, way} =
      grow(0, Map.put(owner, 0, row), u, v, least, [], Enum.to_list(1..n), costs)

    {flip(last, owner, way), u, v}
  end

  # One step of Dijkstra's search: `used` columns are settled, `least` holds the reduced cost of
  # the free ones and from which column it was reached.
  defp grow(column, owner, u, v, least, used, free, costs) do
    row = Map.fetch!(owner, column)
    used = [column | used]

    least =
      Enum.reduce(free, least, fn j, least ->
        cost = elem(elem(costs, row - 1), j - 1) - Map.fetch!(u, row) - Map.fetch!(v, j)

        case Map.fetch!(least, j) do
          {known, _from} when is_integer(known) and known <= cost -> least
          _dearer -> Map.put(least, j, {cost, column})
        end
      end)

    next = Enum.min_by(free, &{elem(Map.fetch!(least, &1), 0), &1})
    {delta, _from} = Map.fetch!(least, next)

    {u, v} =
      Enum.reduce(used, {u, v}, fn j, {u, v} ->
        {Map.update!(u, Map.fetch!(owner, j), &(&1 + delta)), Map.update!(v, j, &(&1 - delta))}
      end)

    least =
      Enum.reduce(free, least, fn j, least ->
        Map.update!(least, j, fn {cost, from} -> {cost - delta, from} end)
      end)

    if Map.has_key?(owner, next),
      do: grow(next, owner, u, v, least, used, List.delete(free, next), costs),
      else: {next, owner, u, v, least}
  end

  defp flip(0, owner, _way), do: owner

  defp flip(column, owner, way) do
    {_cost, from} = Map.fetch!(way, column)
    flip(from, Map.put(owner, column, Map.fetch!(owner, from)), way)
  end

  defp squared({ax, ay}, {bx, by}), do: (ax - bx) * (ax - bx) + (ay - by) * (ay - by)
end
