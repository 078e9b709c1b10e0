defmodule Sim.World.Contact do
  @moduledoc false
  # Contacts between bodies, which are discs: how far one may go before it touches a wall or
  # another, and which ones touch. Pure.
  alias Hal.Pose
  alias Sim.Floorplan

  # A move is tested at points no further apart than this, so that it cannot jump over thin
  # things.
  @stride 0.05
  @halvings 12
  @touch 0.001
  @apart 0.01

  @type disc :: {x :: float(), y :: float(), radius :: float()}

  @doc """
  The last place on the straight way `{dx, dy}` where the disc still touches nothing, and the
  share of the way up to there. A disc that already overlaps something may only move away from it.
  """
  @spec move(Floorplan.t(), disc(), {float(), float()}, [disc()]) ::
          {Pose.point(), share :: float()}
  def move(_map, {x, y, _r}, {dx, dy}, _others) when dx == 0.0 and dy == 0.0, do: {{x, y}, 1.0}

  def move(map, {x, y, r}, {dx, dy}, others) do
    way = :math.sqrt(dx * dx + dy * dy)
    near = for {ox, oy, o} = other <- others, near?(ox - x, oy - y, r + o + way), do: other

    floors =
      {min(Floorplan.clearance(map, {x, y}, r), r), Enum.map(near, &min(gap({x, y, r}, &1), 0.0))}

    fits? = fn share -> fits?(map, {x + share * dx, y + share * dy, r}, near, floors) end
    strides = trunc(way / @stride) + 1

    share =
      case Enum.find(1..strides, &(not fits?.(&1 / strides))) do
        nil -> 1.0
        k -> halve(fits?, (k - 1) / strides, k / strides, @halvings)
      end

    {{x + share * dx, y + share * dy}, share}
  end

  defp fits?(map, {x, y, r} = disc, near, {wall, gaps}) do
    Floorplan.clearance(map, {x, y}, r) >= wall and
      near |> Enum.zip(gaps) |> Enum.all?(fn {other, gap} -> gap(disc, other) >= gap end)
  end

  defp halve(_fits?, good, _bad, 0), do: good

  defp halve(fits?, good, bad, n) do
    middle = (good + bad) / 2

    if fits?.(middle),
      do: halve(fits?, middle, bad, n - 1),
      else: halve(fits?, good, middle, n - 1)
  end

  @doc "The gap between the edges of two discs; negative if they overlap."
  @spec gap(disc(), disc()) :: float()
  def gap({ax, ay, ar}, {bx, by, br}) do
    dx = bx - ax
    dy = by - ay
    :math.sqrt(dx * dx + dy * dy) - ar - br
  end

  defp near?(dx, dy, reach), do: dx * dx + dy * dy <= reach * reach

  @typedoc "Two bodies, or a body and `:wall`."
  @type pair :: {non_neg_integer(), non_neg_integer() | :wall}

  @doc """
  All pairs whose gap is at most `reach`, the lower number first. Sweeps from left to right, so
  that bodies far apart along x are never compared.

      iex> Sim.World.Contact.close([{0, {0.0, 0.0, 0.2}}, {1, {1.0, 0.0, 0.3}}, {2, {9.0, 0.0, 0.2}}], 1.0)
      [{0, 1, 0.5}]
  """
  @spec close([{non_neg_integer(), disc()}], number()) :: [
          {non_neg_integer(), non_neg_integer(), float()}
        ]
  def close(discs, reach) do
    widest = discs |> Enum.map(fn {_, {_, _, r}} -> r end) |> Enum.max(fn -> 0.0 end)
    discs |> Enum.sort_by(fn {_, {x, _, _}} -> x end) |> sweep(reach, widest, [])
  end

  defp sweep([], _reach, _widest, found), do: found

  defp sweep([{i, {x, _, r} = disc} | rest], reach, widest, found),
    do: sweep(rest, reach, widest, ahead(rest, i, disc, x + r + widest + reach, reach, found))

  defp ahead([{j, {x, _, _} = other} | rest], i, disc, last, reach, found) when x <= last do
    gap = gap(disc, other)
    found = if gap <= reach, do: [{min(i, j), max(i, j), gap} | found], else: found
    ahead(rest, i, disc, last, reach, found)
  end

  defp ahead(_rest, _i, _disc, _last, _reach, found), do: found

  @doc """
  Which pairs touch (gap at most 1 mm), which are still in contact (at most 1 cm), and the least
  gap of any two of the first `count` discs, or `least` if none is less.
  """
  @spec pairs([{non_neg_integer(), disc()}], non_neg_integer(), float() | nil) ::
          {touching :: [pair()], together :: [pair()], least :: float() | nil}
  def pairs(discs, count, least) do
    # `nil` compares greater than any number: all pairs matter until there is a least gap.
    near = close(discs, if(least == nil, do: 1.0e9, else: max(least, @apart)))

    Enum.reduce(near, {[], [], least}, fn {i, j, gap}, {touching, together, least} ->
      touching = if gap <= @touch, do: [{i, j} | touching], else: touching
      together = if gap <= @apart, do: [{i, j} | together], else: together
      {touching, together, if(j < count, do: min(gap, least), else: least)}
    end)
  end

  @doc "The points of the walls that a disc touches, and whether it is still within 1 cm of one."
  @spec walls(Floorplan.t(), disc()) :: {[Pose.point()], together? :: boolean()}
  def walls(map, {x, y, r}) do
    case Floorplan.near(map, {x, y}, r + @apart) do
      [] -> {[], false}
      near -> {for({distance, point} <- near, distance <= r + @touch, do: point), true}
    end
  end
end
