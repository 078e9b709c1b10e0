defmodule Nav.PassingPlace do
  @moduledoc """
  Finds where a robot can stand so that another one gets past it: a niche, or a room beside a door. Pure; metres, in the
  frame of the map.

  A body leaves a way if a ring about it, as wide as the other needs it to be, has one stretch on which the other fits: it
  gets from any point of that to any other. In a corridor for one there are two, before the body and behind it. In a niche
  where the other does not come so near there is none; then a wider ring tells.
  """
  alias Hal.Pose
  alias Nav.{Grid, Reach}

  @typedoc "A round body: its place and radius."
  @type body :: {Pose.point(), radius :: float()}

  # The room between two bodies that pass: the least, and what is worth some way (metres); and between one that stands
  # aside and a wall.
  @between 0.2
  @wider [0.0, 0.2, 0.4]
  @roomy 0.35
  @worth 0.6
  @wall 0.1
  # It is looked for this far away (metres).
  @farthest 8.0
  # A place where one step of the ring less is free, so that it is less in the way, is worth so long a way.
  @step 0.015

  @steps 36
  @ring for k <- 0..(@steps - 1),
            a = 2 * :math.pi() * k / @steps,
            do: {:math.cos(a), :math.sin(a)}

  @doc """
  Whether a robot of radius `other` gets past one of radius `own` that stands here, and past those `bodies` that stand, too.

      iex> wall = for i <- 0..29, into: <<>>, do: if(i in 12..17, do: <<1>>, else: <<0>>)
      iex> cells = for j <- 0..29, into: <<>>, do: if(j in 10..19, do: <<0::240>>, else: wall)
      iex> grid = Nav.Grid.new(cells, {30, 30}, 0.1, {0.0, 0.0}, closed?: false)
      iex> for place <- [{1.5, 1.5}, {0.6, 1.5}, {0.6, 2.5}],
      ...>     do: Nav.PassingPlace.passes?(grid, place, 0.2, 0.29)
      [false, false, true]
  """
  @spec passes?(Grid.t(), Pose.point(), own :: float(), other :: float(), [body()]) :: boolean()
  def passes?(grid, place, own, other, bodies \\ []) do
    radius = own + other + @between

    # A body that closes the way behind makes no passing place.
    alone?(free(grid, place, radius, other, [])) and
      (bodies == [] or alone?(free(grid, place, radius, other, bodies)))
  end

  # By step of the ring, whether the other fits there.
  defp free(grid, {x, y}, radius, other, bodies) do
    room = Reach.room(other)

    Enum.find_value(@wider, [], fn wider ->
      r = radius + wider

      free =
        for {c, s} <- @ring, at = {x + r * c, y + r * s} do
          Grid.free?(grid, at, room) and
            Enum.all?(bodies, fn {body, r} -> Pose.distance(body, at) >= r + room end)
        end

      if true in free, do: free
    end)
  end

  # Whether it is one stretch: it begins once, or has no end.
  defp alone?([]), do: false

  defp alone?([first | rest] = free),
    do: begins(free, rest ++ [first], 0) == 1 or false not in free

  defp begins([], [], count), do: count
  defp begins([false | a], [true | b], count), do: begins(a, b, count + 1)
  defp begins([_ | a], [_ | b], count), do: begins(a, b, count)

  @doc """
  How far a robot here, `body`, has to go to the nearest such place that it reaches without passing the `other` (metres),
  0 if it stands in one, and that place; among those up to `farther` than the nearest, the one where it is least in the way. None
  is where it would stand in the way of `bodies`, or they in its.

      iex> wall = for i <- 0..29, into: <<>>, do: if(i in 12..29, do: <<1>>, else: <<0>>)
      iex> cells = for j <- 0..29, into: <<>>, do: if(j in 10..19, do: <<0::240>>, else: wall)
      iex> grid = Nav.Grid.new(cells, {30, 30}, 0.1, {0.0, 0.0}, closed?: false)
      iex> {metres, {x, _y}} = Nav.PassingPlace.nearest(grid, {{1.7, 1.5}, 0.2}, {{2.5, 1.5}, 0.2}, [], 1.0)
      iex> {metres > 0.5, x < 1.2}
      {true, true}
  """
  @spec nearest(Grid.t(), body(), other :: body(), [body()], farther :: float()) ::
          {metres :: float(), Pose.point()} | nil
  def nearest(grid, {from, own}, {other_at, other}, bodies, farther \\ 0.0) do
    apart = min(own + other, Pose.distance(from, other_at) - grid.cell)
    roomy = own + other + @roomy

    rules = %{
      reach?: &(Grid.free?(grid, &1, Reach.room(own)) and Pose.distance(&1, other_at) >= apart),
      place?: fn place ->
        Grid.free?(grid, place, own + @wall) and
          Enum.all?(bodies, fn {at, r} -> Pose.distance(at, place) >= r + own + @between end) and
          passes?(grid, place, own, other, bodies)
      end,
      cost: fn place ->
        free = free(grid, place, roomy, other, bodies)
        @step * Enum.count(free, & &1) + if(alone?(free), do: 0.0, else: @worth)
      end,
      waves: round(farther / grid.cell)
    }

    cell = Grid.index(grid, from)
    waves(grid, [cell], MapSet.new([cell]), 0, rules, nil)
  end

  # Wave by wave of cells; the best so far is `{cost, place, first}`, where `first` is the number of its first wave.
  defp waves(grid, cells, seen, wave, rules, best) do
    last = if best, do: elem(best, 2) + rules.waves, else: @farthest / grid.cell

    if cells == [] or wave > last do
      with {_cost, place, first} <- best, do: {first * grid.cell, place}
    else
      best = Enum.reduce(cells, best, &better(centre(grid, &1), &2, wave, grid.cell, rules))

      {next, seen} =
        for {i, j} <- cells, dx <- -1..1, dy <- -1..1, reduce: {[], seen} do
          {next, seen} -> reached({i + dx, j + dy}, next, seen, grid, rules.reach?)
        end

      waves(grid, Enum.reverse(next), seen, wave + 1, rules, best)
    end
  end

  defp reached(cell, next, seen, grid, reach?) do
    if not MapSet.member?(seen, cell) and reach?.(centre(grid, cell)),
      do: {[cell | next], MapSet.put(seen, cell)},
      else: {next, seen}
  end

  # Where only the nearest is asked for, the first one found is as good as others of its wave.
  defp better(_place, {_cost, _place_so_far, _first} = best, _wave, _cell, %{waves: 0}), do: best

  defp better(place, best, wave, cell, rules) do
    metres = wave * cell

    cond do
      best != nil and metres >= elem(best, 0) -> best
      not rules.place?.(place) -> best
      best == nil -> {metres + rules.cost.(place), place, wave}
      true -> min(best, {metres + rules.cost.(place), place, elem(best, 2)})
    end
  end

  defp centre(grid, {i, j}),
    do: {grid.left + (i + 0.5) * grid.cell, grid.low + (j + 0.5) * grid.cell}
end
