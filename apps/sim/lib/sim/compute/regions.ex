defmodule Sim.Compute.Regions do
  @moduledoc false
  # Joins the pieces of poles that a picture shows to regions: the reference of `Sim.Compute.Native.join/2`, which gives the
  # same, in the same order. Pure.

  @typedoc """
  The number of its kind, its area, its left, right, top and bottom, the sum of the columns of its pixels, and twice that
  of their rows. They are whole numbers, so that the order of its pieces does not matter.
  """
  @type t :: {
          kind :: byte(),
          area :: pos_integer(),
          left :: non_neg_integer(),
          right :: non_neg_integer(),
          top :: non_neg_integer(),
          bottom :: non_neg_integer(),
          columns :: non_neg_integer(),
          rows :: non_neg_integer()
        }

  @doc """
  The regions of pieces as `Sim.Compute.Reference.look/3` gives them; `least` has one byte for each kind: the lowest
  brightness at which it is found.

      iex> pieces = for {column, top} <- [{3, 5}, {4, 6}, {9, 0}], into: <<>>, do: <<column::16-native, top::16-native, 7::16-native, 1, 99>>
      iex> Sim.Compute.Regions.join(pieces, <<0, 30>>)
      [{1, 8, 9, 9, 0, 7, 72, 56}, {1, 5, 3, 4, 5, 7, 17, 62}]
  """
  @spec join(binary(), least :: binary()) :: [t()]
  def join(pieces, least) do
    regions(
      for <<column::16-native, top::16-native, bottom::16-native, kind, luma <- pieces>>,
          luma >= :binary.at(least, kind),
          do: {column, kind, top, bottom}
    )
  end

  # Parts that touch from column to column, or in one column, are one region. A region is `{kind, its rows in the
  # newest column, its sums}`; `next` are those of this column, `open` those that end in the column before.
  defp regions(pieces) do
    {_column, next, open, closed} =
      Enum.reduce(pieces, {nil, [], [], []}, fn
        {column, _, _, _} = piece, {column, next, open, closed} ->
          {next, open} = join(piece, next, open)
          {column, next, open, closed}

        {column, _, _, _} = piece, {last, next, still, closed} ->
          closed = closed ++ still
          {open, closed} = if last == column - 1, do: {next, closed}, else: {[], next ++ closed}
          {next, open} = join(piece, [], open)
          {column, next, open, closed}
      end)

    for {kind, _rows, {area, left, right, top, bottom, columns, rows}} <- next ++ closed ++ open,
        do: {kind, area, left, right, top, bottom, columns, rows}
  end

  defp join({column, kind, top, bottom}, next, open) do
    {beside, open} = touching(open, kind, top, bottom)
    {above, next} = touching(next, kind, top - 1, bottom + 1)
    rows = [{top, bottom} | if(above == [], do: [], else: Enum.flat_map(above, &elem(&1, 1)))]
    {[{kind, rows, sums(beside, sums(above, sums(column, top, bottom)))} | next], open}
  end

  # The regions of this kind that have one of these rows, and the others.
  defp touching([], _kind, _top, _bottom), do: {[], []}

  defp touching([{kind, rows, _} = region | rest], kind, top, bottom) do
    {touching, others} = touching(rest, kind, top, bottom)

    if meet?(rows, top, bottom),
      do: {[region | touching], others},
      else: {touching, [region | others]}
  end

  defp touching([region | rest], kind, top, bottom) do
    {touching, others} = touching(rest, kind, top, bottom)
    {touching, [region | others]}
  end

  defp meet?([], _top, _bottom), do: false
  defp meet?([{t, b} | _rest], top, bottom) when t <= bottom and b >= top, do: true
  defp meet?([_rows | rest], top, bottom), do: meet?(rest, top, bottom)

  defp sums(column, top, bottom) do
    area = bottom - top + 1
    {area, column, column, top, bottom, column * area, (top + bottom) * area}
  end

  defp sums([], sums), do: sums

  # Up to OTP 25, `max` and `min` are calls; comparisons are not.
  defp sums([{_, _, {a, l, r, t, b, x, y}} | rest], {area, left, right, top, bottom, sx, sy}) do
    left = if l < left, do: l, else: left
    right = if r > right, do: r, else: right
    top = if t < top, do: t, else: top
    bottom = if b > bottom, do: b, else: bottom
    sums(rest, {area + a, left, right, top, bottom, sx + x, sy + y})
  end
end
