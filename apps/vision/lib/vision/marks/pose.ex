defmodule Vision.Marks.Pose do
  @moduledoc """
  Finds where a square mark stands from its four corners in a picture. Pure.

  The camera's axes: x to the right, y down, z forward; the mark's as it is printed: x to the right, y down, z into it. Two
  poses fit a plane seen from afar, mirrored at the line of sight. Both come in closed form from the homography of the corners
  and its derivative at the centre: T. Collins and A. Bartoli, "Infinitesimal plane-based pose estimation", International
  Journal of Computer Vision 109, 2014, sections 3 and 4. The homography of a square is that of P. Heckbert, "Fundamentals of
  texture mapping and image warping", 1989, section 2.2.3.
  """

  # How well the detector finds a corner, in pixels.
  @corner_px 0.2
  # A yaw counts if the other one explains the corners so many times worse, and the mark is so many pixels wide: of marks that
  # are smaller, the wrong one of two fits better too often.
  @worse 2.0
  @wide_px 40.0
  # Poses that are as good as exact are equally good.
  @exact 1.0e-6

  @type point :: {float(), float()}
  @type vector :: {float(), float(), float()}
  @typedoc """
  The columns of the rotation from the mark's axes to the camera's, the mark's centre in metres, and how far from the corners
  seen those of this pose are: the root of the mean square, on a picture plane at distance 1.
  """
  @type solution :: {{vector(), vector(), vector()}, vector(), error :: float()}

  @typedoc "How a picture was taken: its size in pixels; field of view, pan and tilt in radians, left and up positive."
  @type camera :: %{
          :width => pos_integer(),
          :height => pos_integer(),
          :field_of_view => float(),
          :pan => float(),
          :tilt => float(),
          optional(atom()) => term()
        }

  @doc """
  The poses that fit four corners on a picture plane at distance 1 (upper left, upper right, lower right, lower left) of a
  square with sides of `size` metres, the better first; `[]` for corners that are not those of a quadrangle.

      iex> corners = [{-0.25, -0.25}, {0.25, -0.25}, {0.25, 0.25}, {-0.25, 0.25}]
      iex> [{_rotation, {x, y, z}, error}, _mirrored] = Vision.Marks.Pose.solve(corners, 1.0)
      iex> Enum.map([x, y, z, error], &Float.round(&1, 9))
      [0.0, 0.0, 2.0, 0.0]
      iex> Vision.Marks.Pose.solve([{0.0, 0.0}, {1.0, 0.0}, {2.0, 0.0}, {3.0, 0.0}], 1.0)
      []
  """
  @spec solve([point(), ...], number()) :: [solution()]
  def solve(corners, size) do
    with {{p, q}, jacobian} <- at_centre(corners),
         [_ | _] = rotations <- rotations({p, q}, jacobian) do
      rotations |> Enum.map(&place(&1, corners, size / 2)) |> Enum.sort_by(&elem(&1, 2))
    else
      _no_quadrangle -> []
    end
  end

  # Where the centre is seen, and the derivatives by the square's coordinates, which run from 0 to 1.
  defp at_centre([{x0, y0}, {x1, y1}, {x2, y2}, {x3, y3}]) do
    {dx1, dx2, sx} = {x1 - x2, x3 - x2, x0 - x1 + x2 - x3}
    {dy1, dy2, sy} = {y1 - y2, y3 - y2, y0 - y1 + y2 - y3}
    area = dx1 * dy2 - dx2 * dy1

    if abs(area) > 1.0e-12 do
      g = (sx * dy2 - dx2 * sy) / area
      h = (dx1 * sy - sx * dy1) / area
      {a, b} = {x1 - x0 + g * x1, x3 - x0 + h * x3}
      {d, e} = {y1 - y0 + g * y1, y3 - y0 + h * y3}
      w = 1 + (g + h) / 2
      {p, q} = {((a + b) / 2 + x0) / w, ((d + e) / 2 + y0) / w}
      {{p, q}, {{(a - g * p) / w, (b - h * p) / w}, {(d - g * q) / w, (e - h * q) / w}}}
    end
  end

  defp rotations({p, q}, {{j00, j01}, {j10, j11}}) do
    {{v00, v01, v02}, {v10, v11, v12}, {v20, v21, v22}} = towards(p, q)
    {b00, b01} = {v00 - p * v20, v01 - p * v21}
    {b10, b11} = {v10 - q * v20, v11 - q * v21}
    det = b00 * b11 - b01 * b10
    {a00, a01} = {(b11 * j00 - b01 * j10) / det, (b11 * j01 - b01 * j11) / det}
    {a10, a11} = {(b00 * j10 - b10 * j00) / det, (b00 * j11 - b10 * j01) / det}

    # The greater singular value.
    {r0, r1} = {a00 * a00 + a01 * a01, a10 * a10 + a11 * a11}
    mixed = a00 * a10 + a01 * a11
    greatest = :math.sqrt((r0 + r1 + :math.sqrt((r0 - r1) * (r0 - r1) + 4 * mixed * mixed)) / 2)

    if greatest > 0.0 do
      {r00, r01} = {a00 / greatest, a01 / greatest}
      {r10, r11} = {a10 / greatest, a11 / greatest}
      c = root(1 - r00 * r00 - r10 * r10)
      d = root(1 - r01 * r01 - r11 * r11)
      d = if r00 * r01 + r10 * r11 > 0.0, do: -d, else: d
      view = {{v00, v01, v02}, {v10, v11, v12}, {v20, v21, v22}}

      for sign <- [1, -1] do
        first = apply_rows(view, {r00, r10, sign * c})
        second = apply_rows(view, {r01, r11, sign * d})
        {first, second, cross(first, second)}
      end
    else
      []
    end
  end

  # The rows of the rotation that turns the z axis to where the centre is seen.
  defp towards(p, q) do
    across = :math.sqrt(p * p + q * q)

    if across < 1.0e-12 do
      {{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}}
    else
      length = :math.sqrt(1 + p * p + q * q)
      {cosine, sine} = {1 / length, across / length}
      {x, y} = {p / across, q / across}
      k = 1 - cosine

      {{1 - k * x * x, -k * x * y, sine * x}, {-k * x * y, 1 - k * y * y, sine * y},
       {-sine * x, -sine * y, cosine}}
    end
  end

  # The centre for which the corners come nearest to those seen, by least squares.
  defp place({first, second, _third} = rotation, seen, half) do
    turned =
      for {x, y} <- [{-half, -half}, {half, -half}, {half, half}, {-half, half}],
          do: add(scale(first, x), scale(second, y))

    pairs = Enum.zip(seen, turned)
    su = sum(pairs, fn {{u, _v}, _} -> u end)
    sv = sum(pairs, fn {{_u, v}, _} -> v end)
    squares = sum(pairs, fn {{u, v}, _} -> u * u + v * v end)
    a = sum(pairs, fn {{u, _v}, {x, _y, z}} -> u * z - x end)
    b = sum(pairs, fn {{_u, v}, {_x, y, z}} -> v * z - y end)
    c = sum(pairs, fn {{u, v}, {x, y, z}} -> u * (u * z - x) + v * (v * z - y) end)
    tz = ((su * a + sv * b) / 4 - c) / (squares - (su * su + sv * sv) / 4)
    at = {(a + su * tz) / 4, (b + sv * tz) / 4, tz}
    {rotation, at, :math.sqrt(sum(pairs, &off(&1, at)) / 4)}
  end

  defp off({{u, v}, corner}, at) do
    {x, y, z} = add(corner, at)
    {du, dv} = {x / z - u, y / z - v}
    du * du + dv * dv
  end

  @doc """
  Range, bearing and yaw of a mark, as `Vision.Mark` has them, with their deviations: those of corners that are wrong by 0.2
  pixels, to first order. `nil` for corners that no pose fits.

      iex> camera = %{width: 640, height: 480, field_of_view: 1.0471975511965976, pan: 0.5, tilt: 0.0}
      iex> corners = [{299.5, 219.5}, {339.5, 219.5}, {339.5, 259.5}, {299.5, 259.5}]
      iex> seen = Vision.Marks.Pose.reading(corners, camera, 0.16)
      iex> {Float.round(seen.range, 3), seen.bearing, seen.yaw}
      {2.217, 0.5, nil}
  """
  @spec reading([point(), ...], camera(), number()) ::
          %{
            range: float(),
            bearing: float(),
            yaw: float() | nil,
            range_sd: float(),
            bearing_sd: float(),
            yaw_sd: float() | nil
          }
          | nil
  def reading(corners, camera, size) do
    focal = camera.width / 2 / :math.tan(camera.field_of_view / 2)

    case solutions(corners, camera, focal, size) do
      [best, other] ->
        {range, bearing, yaw} = here = on_floor(best, camera)
        {range_sd, bearing_sd, yaw_sd} = deviations(corners, camera, focal, size, here)
        {_rotation, {x, y, z}, _error} = best
        wide = focal * size / :math.sqrt(x * x + y * y + z * z)
        clear? = wide >= @wide_px and elem(other, 2) >= @worse * max(elem(best, 2), @exact)

        %{
          range: range,
          bearing: bearing,
          yaw: if(clear?, do: yaw),
          range_sd: range_sd,
          bearing_sd: bearing_sd,
          yaw_sd: if(clear?, do: yaw_sd)
        }

      [] ->
        nil
    end
  end

  # Behind the camera is nothing.
  defp solutions(corners, camera, focal, size) do
    {cx, cy} = {(camera.width - 1) / 2, (camera.height - 1) / 2}
    solutions = solve(for({u, v} <- corners, do: {(u - cx) / focal, (v - cy) / focal}), size)
    if Enum.all?(solutions, fn {_, {_x, _y, z}, _} -> z > 0.0 end), do: solutions, else: []
  end

  # A camera that is tilted up sees what is ahead lower.
  defp on_floor({{_first, _second, inwards}, at, _error}, camera) do
    {x, ahead} = level(at, camera.tilt)
    {nx, n_ahead} = level(inwards, camera.tilt)

    {:math.sqrt(x * x + ahead * ahead), wrap(camera.pan - :math.atan2(x, ahead)),
     wrap(camera.pan - :math.atan2(nx, n_ahead))}
  end

  defp level({x, y, z}, tilt), do: {x, z * :math.cos(tilt) + y * :math.sin(tilt)}

  defp deviations(corners, camera, focal, size, {_, _, yaw} = here) do
    squares =
      for k <- 0..3, step <- [{@corner_px, 0.0}, {0.0, @corner_px}], reduce: {0.0, 0.0, 0.0} do
        squares ->
          corners
          |> List.update_at(k, &add(&1, step))
          |> solutions(camera, focal, size)
          |> Enum.map(&on_floor(&1, camera))
          |> Enum.min_by(fn {_, _, other} -> abs(wrap(other - yaw)) end, fn -> here end)
          |> add_squares(here, squares)
      end

    {range, bearing, yaw} = squares
    {:math.sqrt(range), :math.sqrt(bearing), :math.sqrt(yaw)}
  end

  defp add_squares({range, bearing, yaw}, {range0, bearing0, yaw0}, {a, b, c}) do
    {a + square(range - range0), b + square(wrap(bearing - bearing0)),
     c + square(wrap(yaw - yaw0))}
  end

  defp square(x), do: x * x
  defp root(x), do: :math.sqrt(max(x, 0.0))
  defp wrap(angle), do: Hal.Pose.wrap(angle)
  defp sum(all, value), do: Enum.reduce(all, 0.0, &(&2 + value.(&1)))
  defp add({a, b}, {x, y}), do: {a + x, b + y}
  defp add({a, b, c}, {x, y, z}), do: {a + x, b + y, c + z}
  defp scale({x, y, z}, by), do: {x * by, y * by, z * by}
  defp cross({a, b, c}, {x, y, z}), do: {b * z - c * y, c * x - a * z, a * y - b * x}

  defp apply_rows({{a, b, c}, {d, e, f}, {g, h, i}}, {x, y, z}),
    do: {a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + i * z}
end
