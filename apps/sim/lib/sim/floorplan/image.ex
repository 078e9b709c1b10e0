defmodule Sim.Floorplan.Image do
  @moduledoc false
  # Reads maps from files: a PNG, PGM or BMP picture with its size in metres, `FILE:WIDTHxHEIGHT`, whose middle is the origin;
  # or a description in YAML as map_server writes it, `FILE.yaml`, which names the picture and says where the origin is.
  alias Nav.MapFile
  alias Nav.MapFile.{Picture, Turn}
  alias Sim.Compute
  alias Sim.Floorplan.Maps

  @most_cells 64_000_000
  # Metres: what a picture may have, with as much beside it.
  @widest 2000.0

  @doc """
  The fields of the map of this name; the error is one line. `grey` says what the grey of a picture without a description is
  that seems to stand for what is unknown.
  """
  @spec open(String.t(), Sim.Floorplan.grey()) :: {:ok, map()} | {:error, String.t()}
  def open(name, grey) do
    cond do
      String.starts_with?(name, "rooms:") -> unknown(name)
      name =~ ~r/\.ya?ml\z/i -> described(name)
      match = Regex.run(~r/\A(.+):([^:]*)\z/s, name) -> sized(name, match, grey)
      true -> unknown(name)
    end
  end

  defp unknown(name) do
    {allowed, hint} = Maps.fault(name)
    {:error, "map: expected #{String.trim_trailing(allowed, ",")}, got #{name}#{hint}"}
  end

  defp sized(name, [_, file, size], grey) do
    with {:ok, {width, height} = size} <- size(size, "map #{name}"),
         :ok <- few("map #{name}", size),
         {:ok, picture} <- picture(file) do
      unknown = if grey == :wall, do: Picture.unknown(picture)
      walls = Picture.walls(picture, Picture.shades(unknown), size)
      known = if unknown, do: Picture.walls(picture, Picture.shades(nil), size), else: walls
      {:ok, fields} = plan(name, {walls, known}, size, {-width / 2, -height / 2})
      {:ok, Map.put(fields, :grey, unknown)}
    end
  end

  defp described(file) do
    with {:ok, description} <- file |> MapFile.description() |> about(),
         {:ok, picture} <- picture(description.image, description.transparent) do
      {width, height, _rows} = picture
      size = {width * description.resolution, height * description.resolution}

      with :ok <- large_enough(file, size),
           :ok <- around(file, description.origin, whole(size, description.origin)) do
        [{walls, corner}, {known, corner}] =
          for shades <- [description.shades, description.known],
              walls = Picture.walls(picture, shades, size),
              do: Turn.turn(walls, Picture.cell(), description.origin)

        plan(file, {walls, known}, turned(size, walls, description.origin), corner)
      end
    end
  end

  # The plan has its origin in the middle, so what the picture does not cover is added as wall.
  defp whole({width, height}, {x, y, turn}) do
    {cos, sin} = {:math.cos(turn), :math.sin(turn)}

    corners =
      for w <- [0.0, width],
          h <- [0.0, height],
          do: {x + w * cos - h * sin, y + w * sin + h * cos}

    {xs, ys} = Enum.unzip(corners)
    {2 * Enum.max(Enum.map(xs, &abs/1)), 2 * Enum.max(Enum.map(ys, &abs/1))}
  end

  defp turned(size, _walls, {_x, _y, turn}) when turn == 0.0, do: size

  defp turned(_size, walls, _origin),
    do: {byte_size(hd(walls)) * Picture.cell(), length(walls) * Picture.cell()}

  defp about({:error, line}), do: {:error, "map file #{line}"}
  defp about(ok), do: ok

  defp large_enough(_file, {width, height}) when width >= 1.0 and height >= 1.0, do: :ok

  defp large_enough(file, {width, height}) do
    size = Enum.map_join([width, height], " x ", &:erlang.float_to_binary(&1, decimals: 2))
    {:error, "map #{file}: it is #{size} m; each side must be at least 1 m: see its resolution"}
  end

  defp around(file, {x, y, _turn}, {width, height} = whole) do
    if Enum.all?([width, height], &(&1 > 0 and &1 <= @widest)) and few(file, whole) == :ok,
      do: :ok,
      else:
        {:error,
         "map #{file}: its origin [#{x}, #{y}] is too far from 0,0, which must be in the picture or near it"}
  end

  defp size(text, what) do
    with [_, width, height] <- Regex.run(~r/\A(\d{1,9}\.?\d{0,9})x(\d{1,9}\.?\d{0,9})\z/, text),
         {width, _} <- Float.parse(width),
         {height, _} <- Float.parse(height),
         true <- width >= 1.0 and height >= 1.0 do
      {:ok, {width, height}}
    else
      _ ->
        {:error,
         "#{what}: its size must be WIDTHxHEIGHT in metres, each at least 1, such as 16x12"}
    end
  end

  defp few(what, {width, height}) do
    if width * height / (Picture.cell() * Picture.cell()) <= @most_cells,
      do: :ok,
      else:
        {:error,
         "#{what}: too large, at most #{div(@most_cells, 1_000_000)} million cells of 5 cm are allowed"}
  end

  defp picture(file, transparent \\ 255),
    do: file |> MapFile.picture(@most_cells, transparent) |> about()

  # `known` are those of the walls that are surely there; `{x, y}` is where the lower left corner of the walls lies.
  defp plan(name, {walls, known}, {width, height} = size, {x, y}) do
    {columns, rows} = Picture.cells(size)
    {w, right} = middle(columns, x, width)
    {h, up} = middle(rows, y, height)
    surround = &surround(&1, &2, {w, h}, {columns, rows}, {right, up})
    cells = surround.(walls, 1)
    cell = Picture.cell()
    {left, low} = {(right - w / 2) * cell, (up - h / 2) * cell}
    room = {left, low, left + columns * cell, low + rows * cell}
    # Surely known walls are walls, too, so what is left of these is unknown.
    unknown = if walls != known, do: :crypto.exor(cells, surround.(known, 0))
    fields = %{name: name, width: w, height: h, cell: cell, room: room, unknown: unknown}
    {:ok, Map.put(fields, :field, Compute.field(cells, w, h))}
  end

  # How many cells the plan needs along an axis, and how many of them come before the picture.
  defp middle(cells, low, length) when low == -length / 2, do: {cells, 0}

  defp middle(cells, low, _length) do
    before = round(-low / Picture.cell())
    half = max(before, cells - before)
    {2 * half, half - before}
  end

  # What the picture does not cover is wall, and unknown.
  defp surround(walls, outside, {w, h}, {columns, rows}, {right, up}) do
    fill = &:binary.copy(<<outside>>, &1)
    {left, rest} = {fill.(right), fill.(w - right - columns)}

    IO.iodata_to_binary([
      fill.(up * w),
      Enum.map(walls, &[left, &1, rest]),
      fill.((h - up - rows) * w)
    ])
  end
end
