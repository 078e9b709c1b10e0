defmodule Sim.World.Blobs do
  @moduledoc """
  Computes the blobs of a robot's picture from geometry alone, without painting pixels. For large
  fleets; tests compare it with painting. Pure.
  """
  alias Sim.{Compute, Noise}
  alias Sim.World.{CameraFrustum, Palette}
  alias Vision.Blob

  @least_area 20

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
    |> Enum.filter(fn {_, kind, _, _, luma} -> luma >= Palette.least_luma(kind) end)
    |> Enum.chunk_by(&elem(&1, 0))
    |> regions()
    |> Enum.with_index()
    |> Enum.map(fn {region, k} -> blob(region, sight, noise, k) end)
    |> Enum.filter(&(&1.area >= @least_area))
    |> Enum.sort_by(&{&1.colour != "YellowLandmark", -&1.area, &1.left, &1.top})
  end

  # Parts that touch from column to column, or in one column, are one region.
  defp regions(columns) do
    {open, closed, _last} =
      Enum.reduce(columns, {[], [], nil}, fn [{column, _, _, _, _} | _] = pieces,
                                             {open, closed, last} ->
        {open, closed} = if last == column - 1, do: {open, closed}, else: {[], open ++ closed}
        {next, still} = Enum.reduce(pieces, {[], open}, &join/2)
        {next, closed ++ still, column}
      end)

    for {kind, _edge, pieces} <- open ++ closed, do: {kind, pieces}
  end

  # A region is `{kind, its rows in the newest column, all its {column, first, last}}`.
  defp join({column, kind, top, bottom, _luma}, {next, open}) do
    touches? = fn {k, rows, _}, gap ->
      k == kind and Enum.any?(rows, fn {t, b} -> t <= bottom + gap and b >= top - gap end)
    end

    {beside, open} = Enum.split_with(open, &touches?.(&1, 0))
    {above, next} = Enum.split_with(next, &touches?.(&1, 1))
    rows = [{top, bottom} | Enum.flat_map(above, &elem(&1, 1))]
    pieces = Enum.flat_map(beside ++ above, &elem(&1, 2))
    {[{kind, rows, [{column, top, bottom} | pieces]} | next], open}
  end

  defp area(pieces),
    do: Enum.reduce(pieces, 0, fn {_, top, bottom}, sum -> sum + bottom - top + 1 end)

  defp blob({kind, pieces}, sight, noise, k) do
    exact = area(pieces)
    {left, right} = pieces |> Enum.map(&elem(&1, 0)) |> Enum.min_max()
    top = pieces |> Enum.map(&elem(&1, 1)) |> Enum.min()
    bottom = pieces |> Enum.map(&elem(&1, 2)) |> Enum.max()
    x = Enum.reduce(pieces, 0, fn {c, t, b}, sum -> sum + c * (b - t + 1) end) / exact
    y = Enum.reduce(pieces, 0, fn {_, t, b}, sum -> sum + (t + b) * (b - t + 1) / 2 end) / exact
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
