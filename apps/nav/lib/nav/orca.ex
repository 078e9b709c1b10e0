defmodule Nav.Orca do
  @moduledoc """
  Solves optimal reciprocal collision avoidance (van den Berg, Guy, Lin and Manocha 2011): which
  velocities avoid contact for some time if the others do their share, and which of them is
  nearest to the desired one. Pure; metres, seconds, map frame.

  A half-plane `{{nx, ny}, offset}` allows the velocities with `n . v >= offset`.
  """

  @type vector :: {x :: float(), y :: float()}
  @type half_plane :: {normal :: vector(), offset :: float()}

  # Two discs that already overlap separate within this time, because wheels cannot do it in a
  # tick.
  @parting_s 0.5

  @doc """
  The half-plane of velocities that avoid another disc for `horizon_s` seconds. The arguments are
  this disc's place and velocity, the other's place and velocity, `radius`, the sum of both radii,
  and `share`, this disc's part of the evasion: one half if the other evades too, else 1.

      iex> {{nx, _ny}, offset} = Nav.Orca.half_plane({0.0, 0.0}, {0.0, 0.0}, {2.0, 0.0}, {0.0, 0.0}, 0.5, 3.0, 1.0)
      iex> {Float.round(nx, 6), Float.round(offset, 6)}
      {-1.0, -0.5}
  """
  @spec half_plane(vector(), vector(), vector(), vector(), float(), float(), float()) ::
          half_plane()
  def half_plane({ax, ay}, {avx, avy}, {bx, by}, {bvx, bvy}, radius, horizon_s, share) do
    px = bx - ax
    py = by - ay
    vx = avx - bvx
    vy = avy - bvy
    distance = :math.sqrt(px * px + py * py)

    {nx, ny, size} =
      if distance > radius,
        do: apart(px, py, vx, vy, distance, radius, horizon_s),
        else: cap(vx - px / @parting_s, vy - py / @parting_s, radius / @parting_s, {px, py})

    {{nx, ny}, nx * avx + ny * avy + share * size}
  end

  # The nearest border of the velocity obstacle: its round cap, or one of its legs.
  defp apart(px, py, vx, vy, distance, radius, horizon_s) do
    ux = px / distance
    uy = py / distance
    wx = vx - px / horizon_s
    wy = vy - py / horizon_s
    w = :math.sqrt(wx * wx + wy * wy)
    sine = radius / distance

    away = 0.0 - (wx * ux + wy * uy)

    if away > sine * w do
      cap(wx, wy, radius / horizon_s, {px, py})
    else
      cosine = :math.sqrt(1 - sine * sine)
      side = if ux * wy - uy * wx > 0, do: 1.0, else: -1.0
      leg_x = cosine * ux - side * sine * uy
      leg_y = cosine * uy + side * sine * ux
      nx = -side * leg_y
      ny = side * leg_x
      {nx, ny, -(vx * nx + vy * ny)}
    end
  end

  defp cap(wx, wy, radius, {px, py}) do
    w = :math.sqrt(wx * wx + wy * wy)
    p = :math.sqrt(px * px + py * py)

    cond do
      w > 1.0e-9 -> {wx / w, wy / w, radius - w}
      p > 1.0e-9 -> {-px / p, -py / p, radius}
      true -> {1.0, 0.0, radius}
    end
  end

  @doc """
  The velocity nearest to the wished one that all half-planes allow, no faster than `top`. If no
  velocity satisfies all of them, the one whose worst violation is least.

      iex> Nav.Orca.solve([], {0.3, 0.0}, 0.5)
      {0.3, 0.0}
      iex> Nav.Orca.solve([{{-1.0, 0.0}, -0.1}], {0.3, 0.2}, 0.5)
      {0.1, 0.2}
  """
  @spec solve([half_plane()], vector(), float()) :: vector()
  def solve(planes, wished, top) do
    case walk(planes, [], clip(wished, top), wished, top) do
      {:ok, velocity} -> velocity
      {:infeasible, rest, before, velocity} -> least_bad(rest, before, velocity, top)
    end
  end

  defp walk([], _before, velocity, _wished, _top), do: {:ok, velocity}

  defp walk([plane | rest] = planes, before, velocity, wished, top) do
    if inside?(plane, velocity) do
      walk(rest, [plane | before], velocity, wished, top)
    else
      case along(plane, before, wished, top) do
        nil -> {:infeasible, planes, before, velocity}
        velocity -> walk(rest, [plane | before], velocity, wished, top)
      end
    end
  end

  # The best point on the border of `plane` within the disc of speeds and all planes before it.
  defp along({{nx, ny}, offset}, before, {wx, wy}, top) do
    square = top * top - offset * offset

    if square < 0 do
      nil
    else
      reach = :math.sqrt(square)
      dx = ny
      dy = -nx
      qx = nx * offset
      qy = ny * offset

      case narrow(before, qx, qy, dx, dy, -reach, reach) do
        nil ->
          nil

        {low, high} ->
          t = (dx * (wx - qx) + dy * (wy - qy)) |> max(low) |> min(high)
          {qx + t * dx, qy + t * dy}
      end
    end
  end

  defp narrow(_planes, _qx, _qy, _dx, _dy, low, high) when low > high, do: nil
  defp narrow([], _qx, _qy, _dx, _dy, low, high), do: {low, high}

  defp narrow([{{nx, ny}, offset} | rest], qx, qy, dx, dy, low, high) do
    slope = nx * dx + ny * dy
    missing = offset - (nx * qx + ny * qy)

    cond do
      slope > 1.0e-9 -> narrow(rest, qx, qy, dx, dy, max(low, missing / slope), high)
      slope < -1.0e-9 -> narrow(rest, qx, qy, dx, dy, low, min(high, missing / slope))
      missing > 1.0e-9 -> nil
      true -> narrow(rest, qx, qy, dx, dy, low, high)
    end
  end

  defp least_bad(planes, before, velocity, top) do
    {velocity, _worst, _before} =
      Enum.reduce(planes, {velocity, 0.0, before}, fn plane, {velocity, worst, before} ->
        if violation(plane, velocity) > worst + 1.0e-9 do
          velocity = relax(plane, before, velocity, top)
          {velocity, violation(plane, velocity), [plane | before]}
        else
          {velocity, worst, [plane | before]}
        end
      end)

    velocity
  end

  # As far along the normal as no earlier plane is violated more than this one.
  defp relax({{nx, ny}, offset}, before, velocity, top) do
    bounds =
      for {{mx, my}, other} <- Enum.reverse(before),
          length = :math.sqrt((mx - nx) * (mx - nx) + (my - ny) * (my - ny)),
          length > 1.0e-6,
          do: {{(mx - nx) / length, (my - ny) / length}, (other - offset) / length}

    far = {nx * 1.0e3, ny * 1.0e3}

    case walk(bounds, [], clip(far, top), far, top) do
      {:ok, better} -> better
      _ -> velocity
    end
  end

  defp inside?(plane, velocity), do: violation(plane, velocity) <= 1.0e-9
  defp violation({{nx, ny}, offset}, {vx, vy}), do: offset - (nx * vx + ny * vy)

  @doc "A vector no longer than `top`, in its direction."
  @spec clip(vector(), float()) :: vector()
  def clip({x, y} = vector, top) do
    size = :math.sqrt(x * x + y * y)
    if size > top, do: {x * top / size, y * top / size}, else: vector
  end
end
