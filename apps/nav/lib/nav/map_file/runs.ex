defmodule Nav.MapFile.Runs do
  @moduledoc """
  Turns rows of bytes into runs, and finds areas of runs that touch. A plan has few runs for its many cells, so
  that what would take seconds cell by cell takes milliseconds. Pure.
  """

  @typedoc "The first and the last column of neighbours in a row."
  @type run :: {first :: non_neg_integer(), last :: non_neg_integer()}

  @typedoc "Runs that touch each other, their number of cells, and the columns and rows they lie in."
  @type area :: %{
          runs: [{row :: non_neg_integer(), run()}],
          cells: pos_integer(),
          columns: run(),
          rows: run()
        }

  @typedoc "For each of the 256 bytes whether it belongs to a run."
  @type marks :: tuple()

  @doc """
  The runs of marked bytes, from the left.

      iex> Nav.MapFile.Runs.of(<<0, 7, 9, 3, 8>>, Nav.MapFile.Runs.marks(& &1 >= 7))
      [{1, 2}, {4, 4}]
  """
  @spec of(binary(), marks()) :: [run()]
  def of(row, marks) when tuple_size(marks) == 256, do: outside(row, marks, 0, [])

  @doc "The marks of the bytes for which a function says `true`."
  @spec marks((byte() -> boolean())) :: marks()
  def marks(marked?), do: 0..255 |> Enum.map(marked?) |> List.to_tuple()

  defp outside(<<byte, rest::binary>>, marks, i, runs) when not elem(marks, byte),
    do: outside(rest, marks, i + 1, runs)

  defp outside(<<_byte, rest::binary>>, marks, i, runs), do: inside(rest, marks, i + 1, i, runs)
  defp outside(<<>>, _marks, _i, runs), do: Enum.reverse(runs)

  defp inside(<<byte, rest::binary>>, marks, i, first, runs) when elem(marks, byte),
    do: inside(rest, marks, i + 1, first, runs)

  defp inside(<<_byte, rest::binary>>, marks, i, first, runs),
    do: outside(rest, marks, i + 1, [{first, i - 1} | runs])

  defp inside(<<>>, _marks, i, first, runs), do: Enum.reverse([{first, i - 1} | runs])

  @doc """
  Draws runs, in any order, into a row of so many bytes: 1 in a run, else 0.

      iex> Nav.MapFile.Runs.row([{3, 4}, {0, 1}, {1, 1}], 6)
      <<1, 1, 0, 1, 1, 0>>
  """
  @spec row([run()], pos_integer()) :: binary()
  def row(runs, width) do
    {parts, at} =
      runs
      |> Enum.sort()
      |> Enum.reduce({[], 0}, fn
        {_first, last}, {parts, at} when last < at ->
          {parts, at}

        {first, last}, {parts, at} ->
          from = max(first, at)
          {[parts, fill(0, from - at), fill(1, last - from + 1)], last + 1}
      end)

    IO.iodata_to_binary([parts, fill(0, width - at)])
  end

  defp fill(byte, count), do: :binary.copy(<<byte>>, count)

  @doc """
  The areas of runs that touch, given the runs of each row from row 0; with `:corners` also those
  that touch at a corner only. In the order of their first runs.

      iex> areas = Nav.MapFile.Runs.areas([[{0, 1}, {4, 4}], [{1, 3}]], :sides)
      iex> Enum.map(areas, & &1.cells)
      [5, 1]
      iex> length(Nav.MapFile.Runs.areas([[{0, 1}, {4, 4}], [{1, 3}]], :corners))
      1
  """
  @spec areas([[run()]], :sides | :corners) :: [area()]
  def areas(rows, touch) do
    reach = if touch == :corners, do: 1, else: 0

    {runs, parents, _above, _row} =
      Enum.reduce(rows, {[], %{}, [], 0}, fn row, {runs, parents, above, j} ->
        numbered = Enum.with_index(row, map_size(parents))
        parents = Enum.reduce(numbered, parents, fn {_run, id}, p -> Map.put(p, id, id) end)
        parents = join(above, numbered, reach, parents)

        {Enum.reduce(numbered, runs, fn {run, id}, r -> [{id, {j, run}} | r] end), parents,
         numbered, j + 1}
      end)

    runs
    |> Enum.group_by(fn {id, _run} -> root(parents, id) end, &elem(&1, 1))
    |> Enum.sort_by(&elem(&1, 0))
    |> Enum.map(fn {_root, runs} -> area(runs) end)
  end

  # Both rows run to the right; the run that ends first is done with.
  defp join([{{_, above}, _} | rest], [{{first, _}, _} | _] = row, reach, parents)
       when above + reach < first,
       do: join(rest, row, reach, parents)

  defp join([{{first, _}, _} | _] = above, [{{_, last}, _} | rest], reach, parents)
       when last + reach < first,
       do: join(above, rest, reach, parents)

  defp join([{{_, a_last}, a} | above_rest] = above, [{{_, b_last}, b} | row_rest] = row, r, p) do
    p = unite(p, root(p, a), root(p, b))
    if a_last < b_last, do: join(above_rest, row, r, p), else: join(above, row_rest, r, p)
  end

  defp join(_above, _row, _reach, parents), do: parents

  # The lower number is the root, so that areas keep the order of their first runs.
  defp unite(parents, same, same), do: parents
  defp unite(parents, a, b), do: Map.put(parents, max(a, b), min(a, b))

  defp root(parents, id) do
    case parents do
      %{^id => ^id} -> id
      %{^id => parent} -> root(parents, parent)
    end
  end

  defp area(runs) do
    {first, last} = {fn {_j, {a, _b}} -> a end, fn {_j, {_a, b}} -> b end}
    rows = Enum.map(runs, &elem(&1, 0))

    %{
      runs: Enum.reverse(runs),
      cells: Enum.reduce(runs, 0, fn {_j, {a, b}}, sum -> sum + b - a + 1 end),
      columns: {runs |> Enum.map(first) |> Enum.min(), runs |> Enum.map(last) |> Enum.max()},
      rows: {Enum.min(rows), Enum.max(rows)}
    }
  end
end
