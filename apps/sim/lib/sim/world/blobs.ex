defmodule Sim.World.Blobs do
  @moduledoc false
  # Computes the blobs of a robot's picture from geometry alone, without painting pixels. For large
  # fleets; tests compare it with painting. Pure.
  alias Sim.{Compute, Noise}
  alias Sim.Compute.Palette
  alias Sim.Compute.CameraFrustum
  alias Vision.Blob

  @least_area 20

  @doc """
  The blobs of these poles in a camera's picture, in the order of the blob finder. `noise` is
  `{seed, robot, step}`, or `nil` for none.
  """
  @spec see(
          Sim.Floorplan.t(),
          CameraFrustum.t(),
          [CameraFrustum.pole()] | binary(),
          {integer(), integer(), integer()} | nil
        ) ::
          [Blob.t()]
  def see(map, %CameraFrustum{} = sight, poles, noise) do
    map
    |> Compute.regions(sight, poles)
    |> Enum.with_index()
    |> Enum.map(fn {region, k} -> {elem(region, 0), blob(region, sight, noise, k)} end)
    |> Enum.filter(fn {_kind, blob} -> blob.area >= @least_area end)
    |> Enum.sort_by(fn {kind, blob} -> {kind, -blob.area, blob.left, blob.top} end)
    |> Enum.map(&elem(&1, 1))
  end

  defp blob({index, exact, left, right, top, bottom, columns, rows}, sight, noise, k) do
    kind = Palette.kind(index)
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
