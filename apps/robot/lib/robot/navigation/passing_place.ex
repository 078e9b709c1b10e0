defmodule Robot.Navigation.PassingPlace do
  @moduledoc """
  Finds where a robot can stand so that another one gets past it: a niche, or a room beside a door. Pure; metres, in the
  frame of the map.

  A body leaves a way if a ring about it, as wide as the other needs it to be, has one stretch on which the other fits: it
  gets from any point of that to any other. In a corridor for one there are two, before the body and behind it. In a niche
  where the other does not come so near there is none; then a wider ring tells.
  """
  alias Hal.Pose
  alias Robot.Navigation.{Grid, Reach}

  @typedoc "A round body: its place and radius."
  @type body :: {Pose.point(), radius :: float()}

  # The room between two bodies that pass: the least, and what is worth some way (metres); and between one that stands
  # aside and a wall.
  @between 0.2
  @wider [0.0, 0.2, 0.4]
  @roomy {0.35, 0.6}
  @wall 0.1
  # It is looked for this far away, and so much farther than the first one.
  @farthest 8.0
  @farther 1.0
  # A place where one step of the ring less is free, so that it is less in the way, is worth so long a way.
  @step 0.015

  @steps 36
  @ring for k <- 0..(@steps - 1),
            a = 2 * :math.pi() * k / @steps,
            do: {:math.cos(a), :math.sin(a)}

  @doc """
  Whether a robot of radius `other` gets past one of radius `own` that stands here, and past those `bodies` that stand, too.

      iex> row = for i <- 0..29, into: <<>>, do: if(i in 12..17, do: <<1>>, else: <<0>>)
      iex> corridor = for j <- 0..19, into: <<>>, do: if(j in 5..14, do: :binary.copy(<<0>>, 30), else: row)
      iex> grid = Robot.Navigation.Grid.new(corridor, {30, 20}, 0.1, {0.0, 0.0}, closed?: false)
      iex> for x <- [0.5, 1.5], do: Robot.Navigation.PassingPlace.passes?(grid, {x, 1.0}, 0.2, 0.29)
      [true, false]
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

      if Enum.any?(free), do: free
    end)
  end

  # Whether it is one stretch: it begins once, or has no end.
  defp alone?([]), do: false

  defp alone?(free) do
    begins = free |> Enum.zip(tl(free) ++ [hd(free)]) |> Enum.count(&(&1 == {false, true}))
    begins == 1 or (begins == 0 and hd(free))
  end

  @doc """
  The nearest such place for a robot here, `body`, that it reaches without passing the `other`; and how far away (metres)
  the nearest is, 0 if the robot stands in one. Where it would stand in the way of `bodies`, or they in its, is none.

      iex> row = for i <- 0..29, into: <<>>, do: if(i in 12..29, do: <<1>>, else: <<0>>)
      iex> corridor = for j <- 0..19, into: <<>>, do: if(j in 5..14, do: :binary.copy(<<0>>, 30), else: row)
      iex> grid = Robot.Navigation.Grid.new(corridor, {30, 20}, 0.1, {0.0, 0.0})
      iex> {:ok, {x, _y}, metres} = Robot.Navigation.PassingPlace.nearest(grid, {{1.7, 1.0}, 0.2}, {{2.5, 1.0}, 0.2}, [])
      iex> {x < 1.2, metres > 0.5, Robot.Navigation.PassingPlace.nearest(grid, {{2.5, 1.0}, 0.2}, {{1.7, 1.0}, 0.2}, [])}
      {true, true, :error}
  """
  @spec nearest(Grid.t(), body(), other :: body(), [body()]) ::
          {:ok, Pose.point(), metres :: float()} | :error
  def nearest(grid, {from, own}, {other_at, other}, bodies) do
    cell = Grid.index(grid, from)
    apart = min(own + other, Pose.distance(from, other_at) - grid.cell)
    reach? = &(Grid.free?(grid, &1, Reach.room(own)) and Pose.distance(&1, other_at) >= apart)

    {roomy, worth} = @roomy

    cost = fn place ->
      if Grid.free?(grid, place, own + @wall) and
           Enum.all?(bodies, fn {at, r} -> Pose.distance(at, place) >= r + own + @between end) and
           passes?(grid, place, own, other, bodies) do
        free = free(grid, place, own + other + roomy, other, bodies)
        @step * Enum.count(free, & &1) + if(alone?(free), do: 0.0, else: worth)
      end
    end

    waves(grid, [cell], MapSet.new([cell]), 0, {reach?, cost}, nil)
  end

  # Wave by wave of cells; the best so far is `{cost, place, first}`, where `first` is the number of its first wave.
  defp waves(grid, cells, seen, wave, {reach?, cost} = rules, best) do
    last = if best, do: elem(best, 2) + round(@farther / grid.cell), else: @farthest / grid.cell

    if cells == [] or wave > last do
      with {_cost, place, first} <- best || :error, do: {:ok, place, first * grid.cell}
    else
      best = Enum.reduce(cells, best, &better(&2, centre(grid, &1), cost, wave, grid.cell))

      {next, seen} =
        for {i, j} <- cells, dx <- -1..1, dy <- -1..1, reduce: {[], seen} do
          {next, seen} -> reached({i + dx, j + dy}, next, seen, grid, reach?)
        end

      waves(grid, Enum.reverse(next), seen, wave + 1, rules, best)
    end
  end

  defp reached(cell, next, seen, grid, reach?) do
    if not MapSet.member?(seen, cell) and reach?.(centre(grid, cell)),
      do: {[cell | next], MapSet.put(seen, cell)},
      else: {next, seen}
  end

  defp better(best, place, cost, wave, cell) do
    case {cost.(place), best} do
      {nil, best} ->
        best

      {cost, nil} ->
        {cost + wave * cell, place, wave}

      {cost, {least, _place, first}} when cost + wave * cell < least ->
        {cost + wave * cell, place, first}

      {_cost, best} ->
        best
    end
  end

  defp centre(grid, {i, j}),
    do: {grid.left + (i + 0.5) * grid.cell, grid.low + (j + 0.5) * grid.cell}
end
