defmodule Sim.Kernel.Reference do
  @moduledoc "What the kernels mean, in plain Elixir: every operation and its order is the same in C."
  alias Sim.Noise

  @rays 5

  @doc "See `Sim.Kernel.sonar/4`."
  @spec sonar(
          Sim.Map.t(),
          [{float(), float(), float()}],
          [Sim.Kernel.ring()],
          {integer(), integer()} | nil
        ) :: [[float()]]
  def sonar(map, bodies, rings, noise), do: Enum.map(rings, &ring(map, bodies, &1, noise))

  defp ring(map, bodies, {index, x, y, c, s, least, most, geometry}, noise) do
    others = List.delete_at(bodies, index)
    ring = {map, others, index, x, y, c, s, least, most, noise}
    sensors(geometry, 0, ring)
  end

  defp sensors(<<>>, _k, _ring), do: []

  defp sensors(
         <<sx::float-native, sy::float-native, rays::binary-size(80), rest::binary>>,
         k,
         {map, others, index, x, y, c, s, least, most, noise} = ring
       ) do
    ox = x + c * sx - s * sy
    oy = y + s * sx + c * sy
    near = near(others, ox, oy, most)
    range = cone(rays, @rays, map, near, ox, oy, c, s, most)
    [blur(range, noise, index, k, least, most) | sensors(rest, k + 1, ring)]
  end

  defp cone(_rays, 0, _map, _near, _ox, _oy, _c, _s, best), do: best

  defp cone(
         <<dx::float-native, dy::float-native, rest::binary>>,
         n,
         map,
         near,
         ox,
         oy,
         c,
         s,
         best
       ) do
    rx = c * dx - s * dy
    ry = s * dx + c * dy
    best = discs(near, rx, ry, best)
    {t, _axis} = wall(map, ox, oy, rx, ry, best)
    cone(rest, n - 1, map, near, ox, oy, c, s, min(t, best))
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
        b <= 0.0 or under < 0.0 -> best
        true -> min(best, b - :math.sqrt(under))
      end

    discs(rest, rx, ry, best)
  end

  @doc """
  How far a ray goes before it meets a wall, as a multiple of its direction, at most `most`; and
  whether it met a side that looks along x (0) or y (1), or none (2).

  In a cell whose nearest wall is d steps away, the square of d - 1 cells round it is free: the
  ray goes on to the edge of that square. Each jump crosses at least one cell along one axis and never goes back.
  """
  @spec wall(Sim.Map.t(), float(), float(), float(), float(), float()) :: {float(), 0..2}
  def wall(map, x, y, rx, ry, most) do
    px = x + map.width * map.cell / 2
    py = y + map.height * map.cell / 2
    ix = if abs(rx) < 1.0e-12, do: 0.0, else: 1.0 / rx
    iy = if abs(ry) < 1.0e-12, do: 0.0, else: 1.0 / ry
    ray = {map.field, map.width, map.height, map.cell, px, py, rx, ry, ix, iy, most}
    march(ray, floor(px / map.cell), floor(py / map.cell), 0.0, 2)
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
          tx = max(tx, t)
          march(ray, beyond(ix, i, d), aside(iy, ry, py, j, d, cell, tx), tx, 0)

        true ->
          ty = max(ty, t)
          march(ray, aside(ix, rx, px, i, d, cell, ty), beyond(iy, j, d), ty, 1)
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

  defp blur(range, nil, _index, _k, least, most), do: range |> max(least) |> min(most)

  defp blur(range, {seed, step}, index, k, least, most) do
    if range < most do
      g = Noise.gauss(Noise.hash(seed, step, index, k))
      (range + (0.01 + 0.01 * range) * g) |> max(least) |> min(most)
    else
      most
    end
  end
end
