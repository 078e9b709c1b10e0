defmodule Sim.World.MarkReadings do
  @moduledoc false
  # Computes which printed marks a camera reads from geometry alone, without painting pixels. For long runs and large fleets; tests
  # compare it with painting. Pure.
  #
  # A mark is read if it faces the camera, is whole in the picture and wide enough, and nothing stands before its middle or its
  # sides, or the end of its barcode. Its corners are off by what a detector's are, so that range, bearing and yaw have the
  # errors, and the doubts, of those in pictures (`Vision.Marks.Pose`).
  alias Sim.{Compute, Noise}
  alias Sim.Compute.{CameraFrustum, Columns, Rays}
  alias Vision.Marks

  # What 20 pixels of a `tag36h11` are for a `tagStandard41h12`, whose square is 5 cells wide instead of 8.
  # A self-similar mark has cells of a tenth of its square.
  @wide_px [tag36h11: 20.0, tagStandard41h12: 14.0, similar: 24.0]
  @corner_px 0.2
  # A wall nearer than the mark by this (metres) hides it; depths below the nearest are behind the camera.
  @before 1.0e-6
  @nearest 0.05

  @doc """
  The readings of marks (`Sim.World.Mark`, with its pose now) in a frame, by id. `frame` has what `Vision.Marks.reading/4` needs of
  it, and `at_ms`; `noise` is `{seed, robot, step}`, or `nil` for none.
  """
  @spec see(
          Sim.Floorplan.t(),
          CameraFrustum.t(),
          [CameraFrustum.pole()],
          [Sim.World.Mark.t()],
          map(),
          {integer(), integer(), integer()} | nil
        ) :: [Vision.Mark.t()]
  def see(map, %CameraFrustum{} = sight, poles, marks, frame, noise) do
    poles = Columns.poles(Compute.pack(sight), Compute.pack(poles))

    for {mark, k} <- Enum.with_index(marks),
        {[left, right] = sides, corners} <- [corners(sight, mark)],
        wide?(corners, mark.family),
        middle = {(elem(left, 0) + elem(right, 0)) / 2, (elem(left, 1) + elem(right, 1)) / 2},
        code = code(mark),
        Enum.all?(code, &inside?(sight, &1)),
        Enum.all?([middle | sides] ++ code, &free?(map, sight, poles, &1, corners)),
        looked_for = %Marks{family: mark.family, size: mark.size},
        corners = noisy(corners, noise, k),
        {:ok, reading} <- [Marks.reading(looked_for, mark.id, corners, frame)] do
      reading
    end
    |> Enum.sort_by(&{&1.id, &1.x})
  end

  # The left and the right side of the mark (in the plane), and its corners in the picture; `nil` from behind.
  defp corners(sight, %{pose: pose, size: size, height: height}) do
    {c, s} = Sim.Trig.cos_sin(pose.heading)
    half = size / 2

    if c * (sight.x - pose.x) + s * (sight.y - pose.y) > 0.0 do
      sides = for side <- [-half, half], do: {pose.x - side * s, pose.y + side * c}

      with [{_, near}, {_, far}] = seen when near >= @nearest and far >= @nearest <-
             Enum.map(sides, &seen(sight, &1)),
           [{ul, ll}, {ur, lr}] = for(one <- seen, do: ends(sight, one, height, half)),
           do: {sides, [ul, ur, lr, ll]},
           else: (_behind -> nil)
    end
  end

  # The end of a barcode that stands beside the square.
  defp code(%{family: :similar, pose: pose, size: size}) do
    {c, s} = Sim.Trig.cos_sin(pose.heading)
    right = Vision.Mark.code_end(:similar) * size
    [{pose.x - right * s, pose.y + right * c}]
  end

  defp code(_apriltag), do: []

  defp inside?(sight, place) do
    {aside, depth} = seen(sight, place)

    depth >= @nearest and
      abs(sight.focal * aside / depth) <= (sight.width - 1) / 2
  end

  defp seen(sight, {x, y}) do
    {dx, dy} = {x - sight.x, y - sight.y}
    depth = sight.cosine * dx + sight.sine * dy
    {sight.cosine * dy - sight.sine * dx, depth}
  end

  defp ends(sight, {aside, depth}, height, half) do
    u = (sight.width - 1) / 2 - sight.focal * aside / depth
    row = &(sight.horizon - sight.focal * (&1 - sight.eye) / depth)
    {{u, row.(height + half)}, {u, row.(height - half)}}
  end

  # By the shorter of its two sides, seen aslant: across, or upright.
  defp wide?([{x0, y0}, {x1, y1}, {_x2, y2}, {_x3, y3}], family) do
    across = x1 - x0
    upright = (y3 - y0 + (y2 - y1)) / 2
    min(across, upright) >= @wide_px[family]
  end

  defp free?(map, sight, poles, {x, y}, corners) do
    {rx, ry} = {x - sight.x, y - sight.y}
    {wall, _axis} = Rays.wall(Compute.pack(map), sight.x, sight.y, rx, ry, 1.0)
    low = corners |> Enum.map(&elem(&1, 1)) |> Enum.max()
    wall >= 1.0 - @before and not Enum.any?(poles, &hides?(&1, sight, {rx, ry}, low))
  end

  # All poles stand on the floor.
  defp hides?({_columns, pole}, sight, {rx, ry}, low) do
    at = Columns.meet({sight.x, sight.y}, pole, rx, ry)

    if at != nil and at < 1.0 do
      depth = at * (sight.cosine * rx + sight.sine * ry)
      sight.horizon - sight.focal * (elem(pole, 3) - sight.eye) / max(depth, @nearest) < low
    else
      false
    end
  end

  defp noisy(corners, nil, _k), do: corners

  defp noisy(corners, {seed, robot, step}, k) do
    draw = &(@corner_px * Noise.gauss(Noise.hash(seed, step, robot, 0x3A4B0000 + 8 * k + &1)))
    for {{x, y}, n} <- Enum.with_index(corners), do: {x + draw.(2 * n), y + draw.(2 * n + 1)}
  end
end
