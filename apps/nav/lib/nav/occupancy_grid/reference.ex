defmodule Nav.OccupancyGrid.Reference do
  @moduledoc false
  # Defines what the kernels of `Nav.OccupancyGrid` compute, in Elixir: the definition, for small grids and for builds
  # without C. The same bytes. Pure.
  #
  # The evidence of a cell is a whole number from -40 (free) to 60 (wall), 0 if nothing is known: log odds in steps of
  # about 0.1. An echo adds up to 10 to the cells of its arc, most on the axis of its cone, and takes 4 from those before it
  # (Moravec and Elfes 1985). Cells and readings are in cells from the lower left corner.

  @hit 10
  @miss -4
  @most 60
  @least -40
  @body -20

  @doc """
  Moves the window by whole cells `{right, up}`, lets all evidence go by `decay`, adds the readings (packed doubles: place,
  cosine and sine, how far it is seen through, range, 1 if there is an echo), and clears the cells of these discs (packed
  doubles: place, radius). `tangent` is that of half the cone, `thick` half the depth of an arc. Also returns how
  many cells became surely wall, or ceased to be.
  """
  @spec add(
          binary(),
          pos_integer(),
          integer(),
          integer(),
          non_neg_integer(),
          binary(),
          float(),
          float(),
          binary(),
          pos_integer()
        ) :: {binary(), non_neg_integer()}
  def add(cells, size, right, up, decay, cones, tangent, thick, discs, sure) do
    state = {moved(cells, size, right, up, decay), 0}

    state =
      for <<x::float-native, y::float-native, c::float-native, s::float-native,
            clear::float-native, range::float-native, echo::float-native <- cones>>,
          reduce: state do
        state -> cone(state, size, {x, y, c, s, clear, range, echo > 0.5}, tangent, thick, sure)
      end

    {map, changes} =
      for <<x::float-native, y::float-native, radius::float-native <- discs>>, reduce: state do
        state -> disc(state, size, {x, y, radius}, sure)
      end

    {for(k <- 0..(size * size - 1), into: <<>>, do: <<Map.get(map, k, 0)::signed>>), changes}
  end

  defp moved(cells, size, right, up, decay) do
    for y <- 0..(size - 1),
        x <- 0..(size - 1),
        (x + right) in 0..(size - 1) and (y + up) in 0..(size - 1),
        value = decayed(at(cells, size, x + right, y + up), decay),
        value != 0,
        into: %{},
        do: {y * size + x, value}
  end

  defp at(cells, size, x, y) do
    <<value::signed>> = binary_part(cells, y * size + x, 1)
    value
  end

  defp decayed(value, decay) when value > 0, do: max(value - decay, 0)
  defp decayed(value, decay), do: min(value + decay, 0)

  defp cone(state, size, {cx, cy, c, s, clear, range, echo?}, tangent, thick, sure) do
    for y <- 0..(size - 1),
        x <- 0..(size - 1),
        dx = x + 0.5 - cx,
        dy = y + 0.5 - cy,
        along = dx * c + dy * s,
        side = dy * c - dx * s,
        edge = along * tangent,
        along > 0 and side <= edge and side >= -edge,
        reduce: state do
      state ->
        far = :math.sqrt(dx * dx + dy * dy)
        off = side / edge

        cond do
          echo? and far >= range - thick and far < range + thick ->
            change(state, y * size + x, trunc(@hit * (1.0 - off * off)), sure)

          far < clear ->
            change(state, y * size + x, @miss, sure)

          true ->
            state
        end
    end
  end

  defp change({map, changes}, cell, by, sure) do
    before = Map.get(map, cell, 0)
    now = (before + by) |> min(@most) |> max(@least)
    {Map.put(map, cell, now), if(before >= sure != now >= sure, do: changes + 1, else: changes)}
  end

  defp disc(state, size, {cx, cy, radius}, sure) do
    for y <- 0..(size - 1),
        x <- 0..(size - 1),
        dx = x + 0.5 - cx,
        dy = y + 0.5 - cy,
        dx * dx + dy * dy < radius * radius,
        reduce: state do
      {map, changes} ->
        before = Map.get(map, y * size + x, 0)

        {Map.put(map, y * size + x, min(before, @body)),
         if(before >= sure, do: changes + 1, else: changes)}
    end
  end

  @doc """
  The cells that are surely wall (bytes 1, else 0), as another frame has them: the centre of its cell `{i, j}` is at
  `{x + c * i - s * j, y + s * i + c * j}`. Also returns their number.
  """
  @spec walls(binary(), pos_integer(), {float(), float(), float(), float()}, pos_integer()) ::
          {binary(), non_neg_integer()}
  def walls(cells, size, {x, y, c, s}, sure) do
    walls =
      for j <- 0..(size - 1), i <- 0..(size - 1), into: <<>> do
        {px, py} = {x + c * i - s * j, y + s * i + c * j}

        wall? =
          px >= 0 and py >= 0 and px < size and py < size and
            at(cells, size, trunc(px), trunc(py)) >= sure

        <<if(wall?, do: 1, else: 0)>>
      end

    {walls, for(<<wall <- walls>>, reduce: 0, do: (count -> count + wall))}
  end
end
