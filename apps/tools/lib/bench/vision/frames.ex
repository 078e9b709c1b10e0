defmodule Bench.Vision.Frames do
  @moduledoc """
  Makes the frames that `mix bench vision` searches, 640x480 yuyv with eight classes each, or more. Pure.

    * easy: nine ellipses and rectangles on a grey slope, each in the middle of its class, under
      noise of 3 (Y) and 2 (U, V);
    * speckle: the same, and 5 % of the pixels moved into a random class;
    * photograph: a picture, and the eight classes of the grid that are most frequent in it.

  A class is a box of 12 to each side of a place of a grid of U and V; grey is none. Class 0 of the
  drawn frames is the demo's landmark.

  A frame is searched as 24 copies, each rolled by another distance, so that the processor's
  branch predictor does not learn it.
  """

  @width 640
  @height 480
  @copies 24
  @seed {640, 480, 8}
  @share 0.05
  @reach 12
  @yellow %{name: "yellow", y: {170, 240}, u: {60, 90}, v: {130, 145}}
  @grid [28, 68, 108, 148, 188, 228]
  # Of the grid, but not the landmark's.
  @places [{28, 28}, {28, 188}, {68, 68}, {108, 228}, {148, 68}, {188, 188}, {228, 108}]

  @type class :: %{name: String.t(), y: limits(), u: limits(), v: limits()}
  @type limits :: {0..255, 0..255}

  @doc """
  Width, height and number of copies.

      iex> Bench.Vision.Frames.size()
      {640, 480, 24}
  """
  @spec size() :: {pos_integer(), pos_integer(), pos_integer()}
  def size, do: {@width, @height, @copies}

  @doc "The eight classes of the drawn frames."
  @spec classes() :: [class()]
  def classes,
    do: [@yellow | Enum.map(@places, &place/1)]

  @doc "The eight classes of the grid that are most frequent in a picture."
  @spec classes_of(yuyv :: binary()) :: [class()]
  def classes_of(bytes) do
    places = Map.new(grid(), &{&1, 0})

    counts =
      for <<_y0, u, _y1, v <- bytes>>, reduce: places do
        counts ->
          place = {nearest(u), nearest(v)}
          if is_map_key(counts, place), do: %{counts | place => counts[place] + 1}, else: counts
      end

    counts
    |> Enum.sort_by(fn {place, count} -> {-count, place} end)
    |> Enum.take(8)
    |> Enum.map(fn {place, _count} -> place(place) end)
  end

  @doc """
  So many classes: these, and then those of the grid that share no colour with them. With 32 a frame has the same regions
  as with its own eight, or others beside them.

      iex> classes = Bench.Vision.Frames.more(Bench.Vision.Frames.classes(), 32)
      iex> {length(classes), Enum.take(classes, 8) == Bench.Vision.Frames.classes()}
      {32, true}
  """
  @spec more([class()], 8..32) :: [class()]
  def more(classes, count) do
    others =
      for place <- grid(),
          other = place(place),
          not Enum.any?(classes, &share?(&1, other)),
          do: other

    Enum.take(classes ++ others, count)
  end

  @doc "The easy frame."
  @spec easy() :: binary()
  def easy do
    shapes = shapes()
    {rows, _random} = Enum.map_reduce(0..(@height - 1), random(), &row(&1, shapes, &2))
    IO.iodata_to_binary(rows)
  end

  @doc "A frame with 5 % of its pixels moved into the middle of a random class."
  @spec speckle(binary()) :: binary()
  def speckle(bytes) do
    middles = List.to_tuple(Enum.map(classes(), &middle/1))

    {pairs, _random} =
      Enum.map_reduce(for(<<pair::binary-4 <- bytes>>, do: pair), random(), fn pair, random ->
        Enum.reduce(0..1, {pair, random}, &maybe_move(&1, &2, middles))
      end)

    IO.iodata_to_binary(pairs)
  end

  @doc """
  Copies of a frame, each rolled by some rows and columns more.

      iex> [one, two | _] = copies = Bench.Vision.Frames.rolled(<<0::32, 1::32, 0::size(614_392)-unit(8)>>)
      iex> {length(Enum.uniq(copies)), one == two, byte_size(two)}
      {24, false, 614_400}
  """
  @spec rolled(binary()) :: [binary()]
  def rolled(bytes) do
    for k <- 0..(@copies - 1) do
      at = rem(k * (19 * 2 * @width + 4 * 26), byte_size(bytes))
      binary_part(bytes, at, byte_size(bytes) - at) <> binary_part(bytes, 0, at)
    end
  end

  # Without the cells next to grey.
  defp grid,
    do: for(u <- @grid, v <- @grid, not (u in [108, 148] and v in [108, 148]), do: {u, v})

  defp share?(a, b) do
    Enum.all?([:y, :u, :v], fn channel ->
      {{first, last}, {low, high}} = {Map.fetch!(a, channel), Map.fetch!(b, channel)}
      first <= high and low <= last
    end)
  end

  defp place({u, v}) do
    limits = fn value -> {value - @reach, value + @reach} end
    %{name: "class at #{u},#{v}", y: {40, 230}, u: limits.(u), v: limits.(v)}
  end

  defp nearest(value), do: Enum.find(@grid, &(abs(value - &1) <= @reach))

  defp random, do: :rand.seed_s(:exsss, @seed)

  defp middle(class) do
    [y, u, v] = for {low, high} <- [class.y, class.u, class.v], do: div(low + high, 2)
    {y, u, v}
  end

  # Three rows of three: every second one is an ellipse, else it is a rectangle.
  defp shapes do
    middles = Enum.map(classes(), &middle/1)

    for {k, colour} <- Enum.zip(0..8, middles ++ middles) do
      {rem(k, 2) == 0, 107 + 213 * rem(k, 3), 80 + 160 * div(k, 3), colour}
    end
  end

  defp row(y, shapes, random) do
    shapes = Enum.filter(shapes, fn {_ellipse?, _x, at, _colour} -> abs(y - at) <= 45 end)

    Enum.map_reduce(0..(div(@width, 2) - 1), random, fn pair, random ->
      {left, u, v} = colour(2 * pair, y, shapes)
      {right, _u, _v} = colour(2 * pair + 1, y, shapes)

      Enum.map_reduce([{left, 3}, {u, 2}, {right, 3}, {v, 2}], random, fn {value, noise},
                                                                          random ->
        {normal, random} = :rand.normal_s(random)
        {min(max(round(value + noise * normal), 0), 255), random}
      end)
    end)
  end

  defp colour(x, y, shapes) do
    grey = {70 + 100 * x / @width + 30 * y / @height, 128, 128}

    Enum.find_value(shapes, grey, fn {ellipse?, at_x, at_y, colour} ->
      across = (x - at_x) / 60
      down = (y - at_y) / 45

      inside? =
        if ellipse?,
          do: across * across + down * down <= 1,
          else: abs(across) <= 1 and abs(down) <= 1

      if inside?, do: colour
    end)
  end

  defp maybe_move(which, {<<y0, _u, y1, _v>> = pair, random}, middles) do
    case :rand.uniform_s(random) do
      {share, random} when share < @share ->
        {k, random} = :rand.uniform_s(tuple_size(middles), random)
        {y, to_u, to_v} = elem(middles, k - 1)
        {if(which == 0, do: <<y, to_u, y1, to_v>>, else: <<y0, to_u, y, to_v>>), random}

      {_share, random} ->
        {pair, random}
    end
  end
end
