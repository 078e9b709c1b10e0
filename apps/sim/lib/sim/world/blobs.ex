defmodule Sim.World.Blobs do
  @moduledoc """
  Computes the blobs of a robot's picture from geometry alone, without painting pixels. For large
  fleets; tests compare it with painting. Pure.
  """
  alias Sim.{Compute, Noise}
  alias Sim.Compute.Palette
  alias Sim.World.CameraFrustum
  alias Vision.Blob

  @least_area 20
  @robot_luma Palette.least_luma(:robot)
  @landmark_luma Palette.least_luma(:landmark)

  @doc """
  The blobs of these poles in a camera's picture, in the order of the blob finder. `noise` is
  `{seed, robot, step}`, or `nil` for none.
  """
  @spec see(
          Sim.Floorplan.t(),
          CameraFrustum.t(),
          [CameraFrustum.pole()],
          {integer(), integer(), integer()} | nil
        ) ::
          [Blob.t()]
  def see(map, %CameraFrustum{} = sight, poles, noise) do
    map
    |> Compute.look(sight, poles)
    |> regions()
    |> Enum.with_index()
    |> Enum.map(fn {region, k} -> blob(region, sight, noise, k) end)
    |> Enum.filter(&(&1.area >= @least_area))
    |> Enum.sort_by(&{&1.colour != "YellowLandmark", -&1.area, &1.left, &1.top})
  end

  # Parts that touch from column to column, or in one column, are one region. A region is `{kind, its rows in the
  # newest column, its sums}`; `next` are those of this column, `open` those that end in the column before.
  defp regions(pieces) do
    {_column, next, open, closed} =
      Enum.reduce(pieces, {nil, [], [], []}, fn
        # Too dark to be found.
        {_column, kind, _, _, luma}, state
        when (kind == :robot and luma < @robot_luma) or
               (kind == :landmark and luma < @landmark_luma) ->
          state

        {column, _, _, _, _} = piece, {column, next, open, closed} ->
          {next, open} = join(piece, next, open)
          {column, next, open, closed}

        {column, _, _, _, _} = piece, {last, next, still, closed} ->
          closed = closed ++ still
          {open, closed} = if last == column - 1, do: {next, closed}, else: {[], next ++ closed}
          {next, open} = join(piece, [], open)
          {column, next, open, closed}
      end)

    for {kind, _rows, sums} <- next ++ closed ++ open, do: {kind, sums}
  end

  defp join({column, kind, top, bottom, _luma}, next, open) do
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

  # All that a blob needs of its pieces: area, left, right, top, bottom, the sum of the columns of its pixels, and
  # twice the sum of their rows. They are whole numbers, so that their order does not matter.
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

  defp blob({kind, {exact, left, right, top, bottom, columns, rows}}, sight, noise, k) do
    x = columns / exact
    y = rows / 2 / exact
    area = max(round(exact * (1 + 0.01 * draw(noise, 3 * k))), 1)
    share = area / (sight.width * sight.height)

    %Blob{
      colour: Palette.of(kind).name,
      area: area,
      share: share,
      x: x + 0.1 * draw(noise, 3 * k + 1),
      y: y + 0.1 * draw(noise, 3 * k + 2),
      left: left,
      right: right,
      top: top,
      bottom: bottom,
      width: sight.width,
      height: sight.height,
      distance: Palette.distance(kind, share),
      clipped?: left == 0 or top == 0 or right == sight.width - 1 or bottom == sight.height - 1
    }
  end

  defp draw(nil, _use), do: 0.0

  defp draw({seed, robot, step}, use),
    do: Noise.gauss(Noise.hash(seed, step, robot, 0xB10B00 + use))
end
