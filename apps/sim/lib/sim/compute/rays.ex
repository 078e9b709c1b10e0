defmodule Sim.Compute.Rays do
  @moduledoc "Rays among walls and discs, in plain Elixir: the reference for `rays.c`. Pure."

  @doc """
  The range of one sonar before noise: the nearest of the five rays of its cone, at most the
  ring's greatest range.
  """
  @spec sensor(tuple(), [Sim.Compute.disc()], Sim.Compute.ring(), binary()) :: float()
  def sensor(map, others, {_index, x, y, c, s, _least, most, _geometry}, sensor) do
    <<sx::float-native, sy::float-native, rays::binary>> = sensor
    ox = x + c * sx - s * sy
    oy = y + s * sx + c * sy
    near = near(others, ox, oy, most)

    for <<dx::float-native, dy::float-native <- rays>>, reduce: most do
      best ->
        rx = c * dx - s * dy
        ry = s * dx + c * dy
        best = discs(near, rx, ry, best)
        {t, _axis} = wall(map, ox, oy, rx, ry, best)
        min(t, best)
    end
  end

  @doc "The ranges of the rays of a lidar before noise, at most its greatest."
  @spec lidar(tuple(), [Sim.Compute.disc()], Sim.Compute.lidar()) :: [float()]
  def lidar(map, others, {_index, x, y, c, s, _least, most, geometry}) do
    <<sx::float-native, sy::float-native, rays::binary>> = geometry
    ox = x + c * sx - s * sy
    oy = y + s * sx + c * sy
    near = near(others, ox, oy, most)

    for <<dx::float-native, dy::float-native <- rays>> do
      rx = c * dx - s * dy
      ry = s * dx + c * dy
      best = discs(near, rx, ry, most)
      {t, _axis} = wall(map, ox, oy, rx, ry, best)
      min(t, best)
    end
  end

  # Discs as seen from a sensor: offset, and squared distance to their edge.
  defp near(discs, ox, oy, most) do
    for {bx, by, r} <- discs,
        mx = bx - ox,
        my = by - oy,
        m2 = mx * mx + my * my,
        m2 <= (most + r) * (most + r),
        do: {mx, my, m2 - r * r}
  end

  defp discs([], _rx, _ry, best), do: best

  defp discs([{mx, my, c2} | rest], rx, ry, best) do
    b = mx * rx + my * ry
    under = b * b - c2

    best =
      cond do
        c2 <= 0.0 -> 0.0
        b > 0.0 and under >= 0.0 -> min(best, b - :math.sqrt(under))
        true -> best
      end

    discs(rest, rx, ry, best)
  end

  @doc """
  How far a ray goes before it meets a wall, as a multiple of its direction, at most `most`; and
  whether it met a side that faces along x (0) or y (1), or none (2).

  In a cell whose nearest wall is d steps away, the square of d - 1 cells around it is free, so
  the ray jumps to the edge of that square. Each jump crosses at least one cell along one axis and
  never goes back.
  """
  @spec wall(tuple(), float(), float(), float(), float(), float()) :: {float(), 0..2}
  def wall({field, width, height, cell}, x, y, rx, ry, most) do
    px = x + width * cell / 2
    py = y + height * cell / 2
    ix = if abs(rx) < 1.0e-12, do: 0.0, else: 1.0 / rx
    iy = if abs(ry) < 1.0e-12, do: 0.0, else: 1.0 / ry
    ray = {field, width, height, cell, px, py, rx, ry, ix, iy, most}
    march(ray, floor(px / cell), floor(py / cell), 0.0, 2)
  end

  defp march({field, w, h, cell, px, py, rx, ry, ix, iy, most} = ray, i, j, t, axis) do
    d = if i < 0 or j < 0 or i >= w or j >= h, do: 0, else: :binary.at(field, j * w + i)

    if d == 0 do
      {t, axis}
    else
      tx = leave(ix, i, d, cell, px)
      ty = leave(iy, j, d, cell, py)

      cond do
        min(tx, ty) >= most ->
          {most, 2}

        tx <= ty ->
          t = max(tx, t)
          march(ray, beyond(ix, i, d), aside(iy, ry, py, j, d, cell, t), t, 0)

        true ->
          t = max(ty, t)
          march(ray, aside(ix, rx, px, i, d, cell, t), beyond(iy, j, d), t, 1)
      end
    end
  end

  # When the ray leaves the free square along one axis.
  defp leave(inverse, _i, _d, _cell, _p) when inverse == 0.0, do: 1.0e30
  defp leave(inverse, i, d, cell, p) when inverse > 0.0, do: ((i + d) * cell - p) * inverse
  defp leave(inverse, i, d, cell, p), do: ((i - d + 1) * cell - p) * inverse

  defp beyond(inverse, i, d) when inverse > 0.0, do: i + d
  defp beyond(_inverse, i, d), do: i - d

  # The cell along the other axis: inside the free square, and never backwards.
  defp aside(inverse, _r, _p, j, _d, _cell, _t) when inverse == 0.0, do: j

  defp aside(inverse, r, p, j, d, cell, t) when inverse > 0.0,
    do: floor((p + r * t) / cell) |> max(j) |> min(j + d - 1)

  defp aside(_inverse, r, p, j, d, cell, t),
    do: floor((p + r * t) / cell) |> min(j) |> max(j - d + 1)
end
