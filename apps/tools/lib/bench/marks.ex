defmodule Bench.Marks do
  @moduledoc """
  Lists what `mix bench marks` measures, and makes its pictures: one mark on grey, turned by up to 10 degrees, and how a camera
  spoils it. Pure.
  """
  alias Hal.Frame
  alias Vision.Marks.Picture

  # In the middle of the picture, wherever that lies among the pixels.
  @width 160
  @height 120
  @grey 127.0
  # White and black are 0.9 and 0.1 of full.
  @white 229.5
  @black 25.5
  @samples [-0.375, -0.125, 0.125, 0.375]
  @turn 10 * :math.pi() / 180

  @typedoc "Rows of brightness, 0 to 255."
  @type picture :: [[float()]]
  @type condition :: :clean | :noise | :contrast | :blur | :blur_and_noise

  @doc "How wide the square between the corners is, in pixels: more for a family that needs more."
  @spec widths(Vision.Mark.family()) :: [pos_integer(), ...]
  def widths(:similar), do: [20, 24, 30, 40, 50]
  def widths(_apriltag), do: [12, 16, 20, 24, 32]

  @doc "What is done to a picture, in the order of the table."
  @spec conditions() :: [{condition(), String.t()}, ...]
  def conditions,
    do: [
      clean: "clean",
      noise: "noise 5 %",
      contrast: "contrast 40 %, noise 5 %",
      blur: "blur 1-2-1",
      blur_and_noise: "blur, noise 10 %"
    ]

  @doc "A picture with a mark of the family somewhere in its middle, its id, and the random state after it."
  @spec draw(Vision.Mark.family(), pos_integer(), :rand.state()) ::
          {picture(), id :: non_neg_integer(), :rand.state()}
  def draw(family, width, random) do
    {id, random} = :rand.uniform_s(Vision.Marks.ids(family), random)
    {[x, y, turn], random} = Enum.map_reduce(1..3, random, fn _, r -> :rand.uniform_s(r) end)
    picture = Vision.Marks.picture(family, id - 1)
    {left, right} = Picture.sides(picture)
    angle = (2 * turn - 1) * @turn
    {cosine, sine} = {:math.cos(angle), :math.sin(angle)}
    # Its middle, which may be another than that of the square.
    middle = width * (left + right) / 2
    {x, y} = {@width / 2 + x - middle * cosine, @height / 2 + y - middle * sine}
    # More than its half, since it is turned.
    reach = 1.25 * width * max(right, picture.rows * picture.row / 2)
    mark = {List.to_tuple(picture.edges), picture}

    rows =
      for v <- 0..(@height - 1) do
        for u <- 0..(@width - 1),
            do: pixel(u, v, {x, y, cosine / width, sine / width}, reach, mark)
      end

    {rows, id - 1, random}
  end

  defp pixel(u, v, {x, y, _cosine, _sine} = place, reach, mark) do
    if abs(u - x) > reach or abs(v - y) > reach do
      @grey
    else
      sum =
        for du <- @samples, dv <- @samples, reduce: 0.0 do
          sum -> sum + point(u + du - x, v + dv - y, place, mark)
        end

      sum / 16
    end
  end

  defp point(dx, dy, {_x, _y, cosine, sine}, {edges, picture}) do
    across = cosine * dx + sine * dy
    down = (cosine * dy - sine * dx) / picture.row + picture.rows / 2
    columns = tuple_size(edges) - 1

    cond do
      across < elem(edges, 0) or across >= elem(edges, columns) -> @grey
      down < 0 or down >= picture.rows -> @grey
      white?(picture.white, trunc(down) * columns + column(across, edges, 1)) -> @white
      true -> @black
    end
  end

  defp white?(white, cell), do: :binary.at(white, cell) == 1

  defp column(across, edges, k) when across >= elem(edges, k), do: column(across, edges, k + 1)
  defp column(_across, _edges, k), do: k - 1

  @doc "The picture in a condition, as a frame."
  @spec spoil(picture(), condition(), :rand.state()) :: {Frame.t(), :rand.state()}
  def spoil(picture, :clean, random), do: frame(picture, 0.0, random)
  def spoil(picture, :noise, random), do: frame(picture, 0.05, random)
  def spoil(picture, :blur, random), do: picture |> blur() |> frame(0.0, random)
  def spoil(picture, :blur_and_noise, random), do: picture |> blur() |> frame(0.1, random)

  def spoil(picture, :contrast, random) do
    picture
    |> Enum.map(fn row -> Enum.map(row, &(@grey + 0.4 * (&1 - @grey))) end)
    |> frame(0.05, random)
  end

  # 1-2-1, along rows and columns.
  defp blur(rows),
    do: rows |> Enum.map(&smooth/1) |> transpose() |> Enum.map(&smooth/1) |> transpose()

  defp transpose(rows), do: Enum.zip_with(rows, & &1)

  defp smooth([first | _] = row) do
    Enum.zip_with([[first | row], row, tl(row) ++ [List.last(row)]], fn [a, b, c] ->
      (a + 2 * b + c) / 4
    end)
  end

  defp frame(rows, noise, random) do
    {luma, random} =
      Enum.map_reduce(Enum.concat(rows), random, fn value, random ->
        {normal, random} = if noise > 0.0, do: :rand.normal_s(random), else: {0.0, random}
        {(value + 255 * noise * normal) |> round() |> max(0) |> min(255), random}
      end)

    chroma = :binary.copy(<<128>>, div(@width * @height, 2))
    bytes = :binary.list_to_bin(luma) <> chroma
    {:ok, frame} = Frame.new(:i420, @width, @height, bytes, 0)
    {frame, random}
  end
end
