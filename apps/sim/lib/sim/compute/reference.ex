defmodule Sim.Compute.Reference do
  @moduledoc false
  # Implements the kernels in plain Elixir, as their reference, with the arguments of `Sim.Compute.Native`. Every
  # operation and its order are the same in C. Pure.
  alias Sim.Compute.{Columns, Marks, Rays}
  alias Sim.Noise

  @doc "See `Sim.Compute.field/3`. Two sweeps: from below and the left, from above and the right."
  @spec field(binary(), pos_integer(), pos_integer()) :: binary()
  def field(walls, width, _height) do
    rows =
      for <<cell <- walls>> do
        if cell == 0, do: 255, else: 0
      end
      |> Enum.chunk_every(width)

    edge = List.duplicate(0, width)
    down = rows |> sweep(edge) |> Enum.map(&Enum.reverse/1)
    # The second sweep runs over the plan rotated by 180 degrees.
    down
    |> Enum.reverse()
    |> sweep(edge)
    |> Enum.map(&Enum.reverse/1)
    |> Enum.reverse()
    |> IO.iodata_to_binary()
  end

  defp sweep(rows, edge) do
    {rows, _last} =
      Enum.map_reduce(rows, edge, fn row, before ->
        row = sweep_row(row, [0 | before], 0)
        {row, row}
      end)

    rows
  end

  defp sweep_row([], _before, _last), do: []

  defp sweep_row([value | row], [a | [b | after_b] = before], last) do
    c = if after_b == [], do: 0, else: hd(after_b)
    value = min(value, min(last, min(a, min(b, c))) + 1)
    [value | sweep_row(row, before, value)]
  end

  @doc "See `Sim.Compute.sonar/4`."
  @spec sonar_few(tuple(), binary(), [Sim.Compute.ring()], Sim.Compute.noise()) :: [[float()]]
  def sonar_few(map, discs, rings, noise) do
    discs = for <<x::float-native, y::float-native, r::float-native <- discs>>, do: {x, y, r}

    Enum.map(rings, fn {index, _x, _y, _c, _s, least, most, geometry} = ring ->
      others = List.delete_at(discs, index)

      for {<<sensor::binary-size(96)>>, k} <- Enum.with_index(chunks(geometry)) do
        map |> Rays.sensor(others, ring, sensor) |> blur(noise, index, k, least, most)
      end
    end)
  end

  defp chunks(geometry), do: for(<<sensor::binary-size(96) <- geometry>>, do: sensor)

  defp blur(range, {seed, step, _robot}, index, k, least, most) when range < most do
    g = Noise.gauss(Noise.hash(seed, step, index, k))
    (range + (0.01 + 0.01 * range) * g) |> max(least) |> min(most)
  end

  defp blur(range, _noise, _index, _k, least, most), do: range |> max(least) |> min(most)

  @doc "See `Sim.Compute.scan/4`."
  @spec scan_few(tuple(), binary(), [Sim.Compute.lidar()], Sim.Compute.noise()) :: [binary()]
  def scan_few(map, discs, lidars, noise) do
    discs = for <<x::float-native, y::float-native, r::float-native <- discs>>, do: {x, y, r}

    Enum.map(lidars, fn {index, _x, _y, _c, _s, least, most, _geometry} = lidar ->
      ranges = Rays.lidar(map, List.delete_at(discs, index), lidar)

      for {range, k} <- Enum.with_index(ranges),
          into: <<>>,
          do: <<measured(range, noise, index, k, least, most)::16>>
    end)
  end

  @silent Hal.Scan.silent()

  defp measured(range, _noise, _index, _k, _least, most) when range >= most, do: @silent

  defp measured(range, {seed, step, _robot}, index, k, least, most) do
    hash = Noise.hash(seed, step, index, 0x10000 + k)
    range = range + max(0.003, 0.007 * range) * Noise.gauss(hash)
    if Noise.mix(hash) < 85_899_345, do: @silent, else: millimetres(range, least, most)
  end

  defp measured(range, nil, _index, _k, least, most), do: millimetres(range, least, most)

  defp millimetres(range, least, most) when range < least or range > most, do: @silent
  defp millimetres(range, _least, _most), do: trunc(range * 1000.0 + 0.5)

  @doc "See `Sim.Compute.look/3`: parts of 8 bytes each."
  @spec look(tuple(), tuple(), binary()) :: binary()
  def look(map, sight, poles) do
    poles = Columns.poles(sight, poles)

    for column <- 0..(elem(sight, 7) - 1),
        {_wall, pieces} = Columns.column(map, sight, poles, column, :poles),
        {top, bottom, {kind, _, _, _}, luma} <- pieces,
        into: <<>>,
        do: <<column::16-native, top::16-native, bottom::16-native, kind, luma>>
  end

  @doc "See `Sim.Compute.Regions`."
  @spec join(binary(), binary()) :: [Sim.Compute.Regions.t()]
  defdelegate join(pieces, least), to: Sim.Compute.Regions

  @doc "See `Sim.Compute.paint/4`."
  @spec paint(tuple(), tuple(), binary(), [Marks.packed()], Sim.Compute.noise(), binary()) ::
          binary()
  def paint(map, {_, _, _, _, _, _, _, width, height} = sight, poles, marks, noise, tables) do
    poles = Columns.poles(sight, poles)
    marks = for mark <- marks, do: Marks.cover(map, sight, poles, mark)
    columns = for u <- 0..(width - 1), do: Columns.column(map, sight, poles, u, :walls)
    half = Enum.take_every(columns, 2)
    size = div(byte_size(tables), 2)
    {luma, chroma} = :erlang.split_binary(tables, size)

    [
      for(v <- 0..(height - 1), do: row(columns, v, height, marks, noise, 0x40000 + v, luma))
      |> salt(width * height, noise),
      for(v <- 0..(div(height, 2) - 1), do: tint(half, v, 1, marks, noise, 0x50000 + v, chroma)),
      for(v <- 0..(div(height, 2) - 1), do: tint(half, v, 2, marks, noise, 0x60000 + v, chroma))
    ]
    |> IO.iodata_to_binary()
  end

  defp row(columns, v, height, marks, noise, use, table) do
    ceiling = 145 - div(20 * v, height)
    ground = 75 + div(45 * v, height)
    draws = draws(noise, use, table)

    for {{{top, bottom, wall}, pieces}, u} <- Enum.with_index(columns), into: <<>> do
      base =
        case piece(pieces, v) do
          {_, _, _, luma} -> luma
          nil when v < top -> ceiling
          nil when v <= bottom -> wall
          nil -> ground
        end

      <<Marks.over(marks, {u, v}, base) + draws.(u)>>
    end
  end

  # One pixel in a thousand is white or black; the last value of a pixel counts.
  defp salt(rows, _size, nil), do: rows

  defp salt(rows, size, {seed, step, robot}) do
    for n <- 0..(div(size, 1000) - 1)//1, reduce: IO.iodata_to_binary(rows) do
      plane ->
        hash = Noise.hash(seed, step, robot, 0x70000 + n)
        at = rem(hash, size)
        {before, <<_, rest::binary>>} = :erlang.split_binary(plane, at)
        <<before::binary, if(hash >= 0x80000000, do: 235, else: 16), rest::binary>>
    end
  end

  # The darker, the greyer.
  defp tint(columns, v, channel, marks, noise, use, table) do
    draws = draws(noise, use, table)

    for {{_room, pieces}, u} <- Enum.with_index(columns), into: <<>> do
      base =
        case not Marks.covered?(marks, {2 * u, 2 * v}) && piece(pieces, 2 * v) do
          none when none in [nil, false] ->
            128

          {_top, _bottom, {_kind, paint, _, _} = kind, luma} ->
            full = max(paint, 1)
            128 + div((elem(kind, channel + 1) - 128) * (luma + full), 2 * full)
        end

      <<base + draws.(u)>>
    end
  end

  defp piece(pieces, v),
    do: Enum.find(pieces, fn {top, bottom, _, _} -> v >= top and v <= bottom end)

  defp draws(nil, _use, _table), do: fn _u -> 0 end

  defp draws({seed, step, robot}, use, table) do
    start = rem(Noise.hash(seed, step, robot, use), 4096)

    fn u ->
      <<draw::8-signed>> = binary_part(table, start + u, 1)
      draw
    end
  end
end
