defmodule Sim.Compute.Marks do
  @moduledoc false
  # Paints flat pictures that stand upright, in plain Elixir: the reference for the marks of `paint.c`. Pure.
  alias Sim.Compute.Rays

  @nearest 0.05
  # From the side there is nothing to see.
  @edge 1.0e-6
  @white 225
  @black 30
  # 4 x 4 points of a pixel, from its centre.
  @samples [-0.375, -0.125, 0.125, 0.375]

  @typedoc "Its place, the cosine and sine of where it faces, the height of the middle of its rows, their height, how many; the edges of its columns from its place, to the right, as native floats; each cell as a byte, not 0 is white."
  @type packed ::
          {x :: float(), y :: float(), cosine :: float(), sine :: float(), middle :: float(),
           row :: float(), rows :: pos_integer(), edges :: binary(), white :: binary()}

  @typedoc "How many points of a pixel show a mark, and the sum of their brightness."
  @type cover :: %{{non_neg_integer(), non_neg_integer()} => {1..16, non_neg_integer()}}

  @doc "The farthest first, so that the nearest is painted last."
  @spec sort([packed()], {float(), float()}) :: [packed()]
  def sort(marks, {x, y}) do
    Enum.sort_by(marks, fn mark ->
      {dx, dy} = {elem(mark, 0) - x, elem(mark, 1) - y}
      -(dx * dx + dy * dy)
    end)
  end

  @doc "What a camera sees of a mark behind these poles."
  @spec cover(tuple(), tuple(), [tuple()], packed()) :: cover()
  def cover(map, sight, poles, mark) do
    case box(sight, mark) do
      nil ->
        %{}

      {columns, rows} ->
        for column <- columns,
            {rx, ry} = ray(sight, column),
            depth = front(sight, mark, rx, ry),
            above = unhidden(map, sight, poles, column, {rx, ry}, depth),
            across = across(sight, mark, column),
            row <- rows,
            row < above,
            {_inside, _sum} = covered <- [points(sight, mark, across, row)],
            into: %{},
            do: {{column, row}, covered}
    end
  end

  @doc "The brightness of a pixel behind these marks."
  @spec over([cover()], {non_neg_integer(), non_neg_integer()}, byte()) :: byte()
  def over(covers, place, luma) do
    Enum.reduce(covers, luma, fn cover, luma ->
      case cover do
        %{^place => {inside, sum}} -> div(sum + (16 - inside) * luma + 8, 16)
        _beside -> luma
      end
    end)
  end

  @doc "Whether one of these marks covers a pixel, if only in part."
  @spec covered?([cover()], {non_neg_integer(), non_neg_integer()}) :: boolean()
  def covered?(covers, place), do: Enum.any?(covers, &is_map_key(&1, place))

  defp box({sx, sy, cosine, sine, eye, focal, horizon, width, height}, mark) do
    {x, y, mark_cosine, mark_sine, middle, row, rows, edges, _white} = mark
    half = rows * row / 2

    ends =
      for edge <- [hd(edges(edges)), List.last(edges(edges))] do
        dx = x - edge * mark_sine - sx
        dy = y + edge * mark_cosine - sy
        depth = cosine * dx + sine * dy

        if depth >= @nearest do
          {(width - 1) / 2 - focal * ((cosine * dy - sine * dx) / depth),
           horizon - focal * ((middle + half - eye) / depth),
           horizon - focal * ((middle - half - eye) / depth)}
        end
      end

    with [{a, top_a, bottom_a}, {b, top_b, bottom_b}] <- ends do
      {max(floor(min(a, b)), 0)..min(ceil(max(a, b)), width - 1)//1,
       max(floor(min(top_a, top_b)), 0)..min(ceil(max(bottom_a, bottom_b)), height - 1)//1}
    else
      _near -> nil
    end
  end

  defp ray({_, _, cosine, sine, _, focal, _, width, _}, column) do
    k = ((width - 1) / 2 - column) / focal
    {cosine - sine * k, sine + cosine * k}
  end

  # The depth at which a ray meets the front of the mark's plane.
  defp front(sight, {x, y, cosine, sine, _, _, _, _, _}, rx, ry) do
    ahead = (x - elem(sight, 0)) * cosine + (y - elem(sight, 1)) * sine
    along = rx * cosine + ry * sine
    if along < -@edge and ahead < 0.0, do: ahead / along
  end

  # The row above which the mark is not hidden by a pole; none if a wall hides all of it.
  defp unhidden(map, {sx, sy, _, _, eye, focal, horizon, _, height}, poles, column, ray, depth) do
    {rx, ry} = ray
    {wall, _axis} = Rays.wall(map, sx, sy, rx, ry, depth)

    unless wall < depth do
      for {range, pole} <- poles,
          column in range,
          at = Sim.Compute.Columns.meet({sx, sy}, pole, rx, ry),
          at < depth,
          reduce: height,
          do: (above -> min(above, ceil(horizon - focal * (elem(pole, 3) - eye) / at)))
    end
  end

  # For each point of a pixel's row: the depth, and the column.
  defp across({sx, sy, _, _, _, _, _, _, _} = sight, mark, column) do
    {x, y, cosine, sine, _middle, _row, _rows, edges, _white} = mark
    edges = edges(edges)

    for point <- @samples do
      {rx, ry} = ray(sight, column + point)

      with depth when depth != nil <- front(sight, mark, rx, ry) do
        {dx, dy} = {sx + rx * depth - x, sy + ry * depth - y}
        {depth, column(dy * cosine - dx * sine, edges)}
      end
    end
  end

  defp points({_, _, _, _, eye, focal, horizon, _, _}, mark, across, row) do
    {_x, _y, _cosine, _sine, middle, row_height, rows, edges, white} = mark
    columns = div(byte_size(edges), 8) - 1

    lumas =
      for point <- @samples,
          {depth, column} when column != nil <- across,
          height = eye + (horizon - (row + point)) * depth / focal,
          down = row((middle - height) / row_height + rows / 2, rows),
          do: if(:binary.at(white, down * columns + column) == 0, do: @black, else: @white)

    if lumas != [], do: {length(lumas), Enum.sum(lumas)}
  end

  defp edges(binary), do: for(<<edge::float-native <- binary>>, do: edge)

  defp column(at, [first | edges]) do
    if at >= first and at < List.last(edges), do: Enum.find_index(edges, &(at < &1))
  end

  defp row(at, rows), do: if(at >= 0.0 and at < rows, do: trunc(at))
end
