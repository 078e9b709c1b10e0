defmodule Nav.PathPlanner do
  @moduledoc """
  Plans a short path around standing discs. Pure; metres.

  A lazy visibility search: it first tries the straight line to the goal, and considers a disc
  only if that disc blocks a line. The rim of a disc is approximated by a polygon. So a free path
  costs one test, and further tests are needed only for the discs in between.
  """

  @type point :: {x :: float(), y :: float()}
  @type disc :: {x :: float(), y :: float(), radius :: float()}

  @sides 10
  @rim 1.0 / :math.cos(:math.pi() / @sides)
  @slack 1.0e-3
  # A search that has expanded this many places ends without a path.
  @most 120

  @corners for k <- 0..(@sides - 1),
               do: {
                 @rim * :math.cos(2 * :math.pi() * k / @sides),
                 @rim * :math.sin(2 * :math.pi() * k / @sides)
               }

  @doc """
  The corners of the path and the goal itself, or `nil` if no path is found.

      iex> Nav.PathPlanner.way({0.0, 0.0}, {4.0, 0.0}, [])
      [{4.0, 0.0}]
      iex> [_ | _] = way = Nav.PathPlanner.way({0.0, 0.0}, {4.0, 0.0}, [{2.0, 0.1, 0.5}])
      iex> Enum.all?(way, fn {_, y} -> y <= 0.0 end)
      true
      iex> Nav.PathPlanner.way({0.0, 0.0}, {4.0, 0.0}, [{4.0, 0.0, 0.5}])
      nil
  """
  @spec way(point(), point(), [disc()]) :: [point(), ...] | nil
  def way(from, goal, discs) do
    case blocker(from, goal, discs) do
      nil ->
        [goal]

      disc ->
        if inside?(goal, discs) do
          nil
        else
          open = :gb_sets.singleton({distance(from, goal), 0.0, from, [], disc})
          search(open, MapSet.new([from]), goal, discs, @most)
        end
    end
  end

  defp search(_open, _seen, _goal, _discs, 0), do: nil

  defp search(open, seen, goal, discs, left) do
    if :gb_sets.is_empty(open) do
      nil
    else
      {{_guess, cost, place, trail, disc}, open} = :gb_sets.take_smallest(open)

      if place == goal do
        Enum.reverse(trail)
      else
        {open, seen} = expand(open, seen, place, trail, cost, disc, goal, discs)
        search(open, seen, goal, discs, left - 1)
      end
    end
  end

  # From a place where `disc` blocks the line to the goal, the path leads to the visible corners
  # of its rim; where another disc hides them, to the rim of that one.
  defp expand(open, seen, place, trail, cost, nil, goal, _discs) do
    total = cost + distance(place, goal)
    {:gb_sets.add({total, total, goal, [goal | trail], nil}, open), seen}
  end

  defp expand(open, seen, place, trail, cost, disc, goal, discs) do
    place
    |> visible([disc], [], [], discs, 4)
    |> Enum.reduce({open, seen}, fn corner, {open, seen} ->
      if MapSet.member?(seen, corner) do
        {open, seen}
      else
        cost = cost + distance(place, corner)
        guess = cost + distance(corner, goal)
        node = {guess, cost, corner, [corner | trail], blocker(corner, goal, discs)}
        {:gb_sets.add(node, open), MapSet.put(seen, corner)}
      end
    end)
  end

  defp visible(_place, [], _done, corners, _discs, _depth), do: corners
  defp visible(_place, _hiding, _done, corners, _discs, 0), do: corners

  defp visible(place, hiding, done, corners, discs, depth) do
    {seen, hidden_by} =
      hiding
      |> Enum.flat_map(&rim(&1, place))
      |> Enum.reduce({corners, []}, fn corner, {seen, by} ->
        case blocker(place, corner, discs) do
          nil -> {[corner | seen], by}
          disc -> {seen, [disc | by]}
        end
      end)

    done = hiding ++ done
    visible(place, Enum.uniq(hidden_by) -- done, done, seen, discs, depth - 1)
  end

  # The outermost corner on each side; for a place on the rim, the nearest corners along it.
  defp rim({cx, cy, radius}, {px, py} = place) do
    corners = for {x, y} <- @corners, do: {cx + radius * x, cy + radius * y}
    near = radius * @rim * 1.02
    dx = cx - px
    dy = cy - py

    if dx * dx + dy * dy < near * near do
      corners |> Enum.sort_by(&distance(&1, place)) |> Enum.take(4) |> List.delete(place)
    else
      angle = fn {x, y} ->
        :math.atan2(dx * (y - py) - dy * (x - px), dx * (x - px) + dy * (y - py))
      end

      {low, high} = Enum.min_max_by(corners, angle)
      [low, high]
    end
  end

  @doc """
  The first disc that blocks a straight line, or `nil`.

      iex> Nav.PathPlanner.blocker({0.0, 0.0}, {4.0, 0.0}, [{3.0, 0.0, 0.5}, {2.0, 0.2, 0.5}])
      {2.0, 0.2, 0.5}
  """
  @spec blocker(point(), point(), [disc()]) :: disc() | nil
  def blocker({ax, ay}, {bx, by}, discs) do
    dx = bx - ax
    dy = by - ay
    square = dx * dx + dy * dy
    first(discs, ax, ay, dx, dy, max(square, 1.0e-12), nil, 2.0)
  end

  defp first([], _ax, _ay, _dx, _dy, _square, found, _at), do: found

  defp first([{cx, cy, radius} = disc | rest], ax, ay, dx, dy, square, found, at) do
    t = ((cx - ax) * dx + (cy - ay) * dy) / square
    t = t |> max(0.0) |> min(1.0)
    ex = ax + t * dx - cx
    ey = ay + t * dy - cy
    limit = radius - @slack

    if t < at and limit > 0 and ex * ex + ey * ey < limit * limit,
      do: first(rest, ax, ay, dx, dy, square, disc, t),
      else: first(rest, ax, ay, dx, dy, square, found, at)
  end

  defp inside?(point, discs),
    do: Enum.any?(discs, fn {x, y, radius} -> distance(point, {x, y}) < radius - @slack end)

  defp distance({ax, ay}, {bx, by}),
    do: :math.sqrt((ax - bx) * (ax - bx) + (ay - by) * (ay - by))
end
