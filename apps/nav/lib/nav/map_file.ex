defmodule Nav.MapFile do
  @moduledoc """
  Reads and saves a floor plan as map_server writes it: a description in YAML (`.Description`) and the picture that it names,
  PNG, PGM or BMP (`.Picture`). It gives a robot the walls of its building (`Nav.Grid`) in the frame of the map, in
  which the description says where the picture lies.

  What the picture does not cover is wall; so only the part of it with floor becomes the grid, and only that must not be
  larger than a robot can search for a way ten times a second.
  """
  alias Nav.Grid
  alias Nav.MapFile.{Description, Ffmpeg, Pgm, Picture, Turn, Writer}

  # A picture of 4000 x 4000 pixels, which some mappers always write, is read within seconds.
  @most_pixels 16_000_000
  @most_text 65_536
  @most_bytes 100_000_000
  # Cells of `Picture.cell/0`: 500 m.
  @most_side 10_000
  # Cells of the grid, 10 cm wide: 100 x 100 m.
  @most_grid 1_000_000

  @enforce_keys [:file, :grid]
  defstruct @enforce_keys ++ [marks: []]

  @typedoc "`marks` are the printed marks that hang there: id, and place and heading in the map (metres, radians), with the standard deviation of the place where
  the file says it."
  @type t :: %__MODULE__{
          file: Path.t(),
          grid: Grid.t(),
          marks: [
            {non_neg_integer(),
             {float(), float(), float()} | {float(), float(), float(), sd :: float()}}
          ]
        }

  @doc """
  The map that a description in YAML describes; the error is one line.

      iex> Nav.MapFile.open("no/such.yaml")
      {:error, "no/such.yaml: no such file or directory"}
  """
  @spec open(Path.t()) :: {:ok, t()} | {:error, line :: String.t()}
  def open(file) do
    with {:ok, description} <- description(file),
         {:ok, {width, height, _rows} = picture} <-
           picture(description.image, @most_pixels, description.transparent),
         size = {width * description.resolution, height * description.resolution},
         :ok <- size(file, Picture.cells(size)),
         {:ok, grid} <- grid(file, Picture.walls(picture, description.shades, size), description),
         do: {:ok, %__MODULE__{file: file, grid: grid, marks: description.marks}}
  end

  @doc """
  Writes a map that robots have made (`c:Robot.Mission.map/1`): `FILE.yaml`, and the picture `FILE.pgm` beside it. The error is
  one line.
  """
  @spec save(Path.t(), Writer.raster()) :: :ok | {:error, line :: String.t()}
  def save(file, map) do
    image = Path.rootname(file) <> ".pgm"
    {yaml, pgm} = Writer.encode(map, Path.basename(image))

    with {:pgm, :ok} <- {:pgm, File.write(image, pgm)},
         {:yaml, :ok} <- {:yaml, File.write(file, yaml)} do
      :ok
    else
      {:pgm, {:error, reason}} -> {:error, "#{image}: #{:file.format_error(reason)}"}
      {:yaml, {:error, reason}} -> {:error, "#{file}: #{:file.format_error(reason)}"}
    end
  end

  @doc "What a file describes; the path of its picture is complete. The error is one line that names the file."
  @spec description(Path.t()) :: {:ok, Description.t()} | {:error, line :: String.t()}
  def description(file) do
    with {:ok, bytes} <- read(file, @most_text),
         {:ok, description} <- Description.parse(bytes) do
      {:ok, %{description | image: Path.expand(description.image, Path.dirname(file))}}
    else
      {:error, reason} -> {:error, "#{file}: #{reason}"}
    end
  end

  @doc """
  The picture in a file, of at most so many pixels; `transparent` is the shade of what is transparent in it, by default
  white. The error is one line that names the file. What is too large is refused by its head.
  """
  @spec picture(Path.t(), pos_integer(), transparent :: byte()) ::
          {:ok, Picture.t()} | {:error, line :: String.t()}
  def picture(file, most_pixels, transparent \\ 255) do
    with {:ok, bytes} <- read(file, @most_bytes),
         {:ok, picture} <- decode(file, bytes, most_pixels, transparent) do
      {:ok, picture}
    else
      {:error, reason} -> {:error, "#{file}: #{reason}"}
    end
  end

  # Reading a device or a pipe would never end.
  defp read(file, most) do
    with {:ok, %File.Stat{type: :regular, size: size}} when size <= most <- File.stat(file),
         {:ok, bytes} <- File.read(file) do
      {:ok, String.replace_prefix(bytes, "\uFEFF", "")}
    else
      {:ok, %File.Stat{type: :regular, size: size}} ->
        {:error, "has #{size} bytes: up to #{most} are read"}

      {:ok, %File.Stat{type: type}} ->
        {:error, "is a #{type}, not a file"}

      {:error, reason} ->
        {:error, :file.format_error(reason)}
    end
  end

  defp decode(_file, <<"P", kind, rest::binary>>, most, _transparent) when kind in [?2, ?5],
    do: Pgm.decode(kind, rest, most)

  defp decode(file, bytes, most, transparent) do
    case Ffmpeg.head(bytes) do
      {kind, {width, height} = size} ->
        with :ok <- Picture.size(width, height, most),
             do: Ffmpeg.decode(file, kind, size, transparent)

      :error ->
        {:error, "the picture is damaged"}

      nil ->
        unknown(bytes)
    end
  end

  defp unknown(bytes) do
    what = if kind = kind(bytes), do: "is #{kind}", else: "is no picture that is known"
    {:error, "#{what}: PNG, PGM (P2, P5) and BMP are read; save it as PNG"}
  end

  defp kind(<<0xFF, 0xD8, 0xFF, _::binary>>), do: "a JPEG picture"
  defp kind(<<"GIF8", _::binary>>), do: "a GIF picture"
  defp kind(<<"RIFF", _size::32, "WEBP", _::binary>>), do: "a WebP picture"
  defp kind(<<"II*", 0, _::binary>>), do: "a TIFF picture"
  defp kind(<<"MM", 0, "*", _::binary>>), do: "a TIFF picture"
  defp kind(<<"P", n, _::binary>>) when n in [?1, ?4], do: "a PBM picture"
  defp kind(<<"P", n, _::binary>>) when n in [?3, ?6], do: "a PPM picture"
  defp kind(<<"%PDF", _::binary>>), do: "a PDF document"
  defp kind(<<"<", _::binary>>), do: "XML, as an SVG drawing is"
  defp kind(<<>>), do: "empty"
  defp kind(_other), do: nil

  defp size(_file, {w, h}) when w in 2..@most_side//1 and h in 2..@most_side//1, do: :ok

  defp size(file, {w, h}) do
    [w, h] = for cells <- [w, h], do: Float.round(cells * Picture.cell(), 2)

    {:error,
     "#{file}: is #{w} x #{h} m: 0.1 to 500 m are allowed for each side; see its resolution"}
  end

  defp grid(file, rows, %{origin: origin}) do
    case floor_of(rows) do
      nil ->
        {:error,
         "#{file}: shows no floor: light pixels are floor, unless its negate says otherwise"}

      {rows, at} ->
        cell = Picture.cell()
        {rows, corner} = Turn.turn(rows, cell, beside(origin, at, cell))
        {w, h} = {byte_size(hd(rows)), length(rows)}

        if w * h * cell * cell <= @most_grid * Grid.plan_cell() * Grid.plan_cell(),
          do: {:ok, Grid.plan(IO.iodata_to_binary(rows), {w, h}, cell, corner)},
          else:
            {:error,
             "#{file}: has floor on #{round(w * cell)} x #{round(h * cell)} m: up to 100 x 100 m, or as large an " <>
               "area, are allowed"}
    end
  end

  # The pose of the cell in this column and row, of rows whose first cell has this one.
  defp beside({x, y, turn}, {column, row}, cell) do
    {cos, sin} = {:math.cos(turn), :math.sin(turn)}
    {dx, dy} = {column * cell, row * cell}
    {x + dx * cos - dy * sin, y + dx * sin + dy * cos, turn}
  end

  # The rows without what surrounds all floor, and the place of their lower left cell.
  defp floor_of(rows) do
    width = byte_size(hd(rows))
    wall = :binary.copy(<<1>>, width)
    low = Enum.find_index(rows, &(&1 != wall))

    if low do
      rows =
        rows
        |> Enum.drop(low)
        |> Enum.reverse()
        |> Enum.drop_while(&(&1 == wall))
        |> Enum.reverse()

      left = rows |> Enum.map(&:binary.longest_common_prefix([&1, wall])) |> Enum.min()
      right = rows |> Enum.map(&:binary.longest_common_suffix([&1, wall])) |> Enum.min()
      {Enum.map(rows, &binary_part(&1, left, width - left - right)), {left, low}}
    end
  end
end
