defmodule Sim.Floorplan.Image do
  @moduledoc """
  Maps from bitmaps: `FILE:WIDTHxHEIGHT` with a PNG or PGM file and its size in metres. Pixels
  darker than half are wall. The picture is divided into cells of 5 cm; a cell is wall if any of
  its pixels is, so that thin walls have no gaps.
  """
  alias Sim.Compute
  alias Sim.Floorplan.{Pgm, Png}

  @cell 0.05
  @most_cells 64_000_000

  @doc "The fields of the map `FILE:WIDTHxHEIGHT`; the error is one line."
  @spec open(String.t()) :: {:ok, map()} | {:error, String.t()}
  def open(name) do
    case Regex.run(~r/\A(.+):([^:]*)\z/s, name) do
      [_, file, size] ->
        with {:ok, size} <- size(name, size),
             {:ok, bytes} <- read(file),
             {:ok, picture} <- decode(file, bytes),
             do: {:ok, lay(name, picture, size)}

      nil ->
        {:error, "unknown map #{name}: hall, hospital, arena or FILE.png:WIDTHxHEIGHT in metres"}
    end
  end

  defp size(name, text) do
    with [_, width, height] <- Regex.run(~r/\A(\d{1,9}\.?\d{0,9})x(\d{1,9}\.?\d{0,9})\z/, text),
         {width, _} <- Float.parse(width),
         {height, _} <- Float.parse(height),
         true <- width >= 1.0 and height >= 1.0 do
      if width * height / (@cell * @cell) <= @most_cells,
        do: {:ok, {width, height}},
        else:
          {:error,
           "map #{name}: too large, at most #{div(@most_cells, 1_000_000)} million cells of 5 cm are allowed"}
    else
      _ ->
        {:error,
         "map #{name}: its size must be WIDTHxHEIGHT in metres, each at least 1, such as 16x12"}
    end
  end

  # Reading a device or a pipe would never end.
  defp read(file) do
    with {:ok, %File.Stat{type: :regular}} <- File.stat(file),
         {:ok, bytes} <- File.read(file) do
      {:ok, bytes}
    else
      {:ok, %File.Stat{type: type}} -> {:error, "map file #{file}: is a #{type}, not a file"}
      {:error, reason} -> {:error, "map file #{file}: #{:file.format_error(reason)}"}
    end
  end

  defp decode(file, bytes) do
    result =
      case bytes do
        <<0x89, "PNG\r\n", 0x1A, "\n", chunks::binary>> -> Png.decode(chunks, @most_cells)
        <<"P", kind, rest::binary>> when kind in [?2, ?5] -> Pgm.decode(kind, rest, @most_cells)
        _ -> {:error, "is neither a PNG nor a PGM (P2, P5) picture"}
      end

    with {:error, reason} <- result, do: {:error, "map file #{file}: #{reason}"}
  end

  defp lay(name, {width, height, rows}, {metres_x, metres_y}) do
    {w, h} = {max(round(metres_x / @cell), 1), max(round(metres_y / @cell), 1)}
    rows = List.to_tuple(rows)
    columns = for i <- 0..(w - 1), do: part(i, w, width)

    {cells, _last} =
      Enum.map_reduce((h - 1)..0//-1, {nil, nil}, fn j, {last, row} ->
        case part(j, h, height) do
          ^last -> {row, {last, row}}
          part -> part |> squeeze(rows, columns) |> then(&{&1, {part, &1}})
        end
      end)

    field = cells |> IO.iodata_to_binary() |> Compute.field(w, h)
    {x, y} = {w * @cell / 2, h * @cell / 2}
    %{name: name, width: w, height: h, cell: @cell, field: field, room: {-x, -y, x, y}}
  end

  # The pixels in cell `i` of `cells`: the first, and their number.
  defp part(i, cells, pixels) do
    first = div(i * pixels, cells)
    {first, max(div((i + 1) * pixels + cells - 1, cells) - first, 1)}
  end

  defp squeeze({first, count}, rows, columns) do
    rows = for k <- first..(first + count - 1), do: elem(rows, k)

    for {column, width} <- columns, into: <<>> do
      wall? = Enum.any?(rows, &(:binary.match(&1, <<1>>, scope: {column, width}) != :nomatch))
      if wall?, do: <<1>>, else: <<0>>
    end
  end
end
