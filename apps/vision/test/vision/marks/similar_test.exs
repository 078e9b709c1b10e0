defmodule Vision.Marks.SimilarTest do
  use ExUnit.Case, async: true
  alias Hal.Frame
  alias Vision.Marks
  alias Vision.Marks.Picture
  alias Vision.Marks.Similar.{Native, Pattern, Reference}
  doctest Vision.Marks.Picture
  doctest Vision.Marks.Similar.Pattern

  @width 200
  @height 120
  @samples [-0.375, -0.125, 0.125, 0.375]

  # A frame of grey with marks: [{id, left, top, width of the square, how far each row is pushed aside}].
  defp frame(marks, options \\ []) do
    marks =
      for {id, left, top, size, aside} <- marks do
        picture = Pattern.picture(id)
        {List.to_tuple(picture.edges), picture, left, top, size, aside}
      end

    {luma, _random} =
      for(y <- 0..(@height - 1), x <- 0..(@width - 1), do: pixel(x, y, marks))
      |> Enum.map_reduce(:rand.seed_s(:exsss, options[:seed] || 1), fn value, random ->
        {draw, random} = :rand.normal_s(random)
        {round(min(max(value + (options[:noise] || 0.0) * draw, 0.0), 255.0)), random}
      end)

    bytes =
      if options[:format] == :yuyv,
        do: for(y <- luma, into: <<>>, do: <<y, 128>>),
        else: :binary.list_to_bin(luma) <> :binary.copy(<<128>>, div(@width * @height, 2))

    {:ok, frame} = Frame.new(options[:format] || :i420, @width, @height, bytes, 7)
    %{frame | field_of_view: :math.pi() / 3}
  end

  defp pixel(x, y, marks) do
    sum =
      for dx <- @samples,
          dy <- @samples,
          reduce: 0,
          do: (sum -> sum + point(x + dx, y + dy, marks))

    sum / 16
  end

  defp point(x, y, marks) do
    Enum.find_value(marks, 140, fn {edges, picture, left, top, size, aside} ->
      across = (x - left - aside * (y - top)) / size - 0.5
      down = floor(((y - top) / size - 0.5) / picture.row + picture.rows / 2)
      columns = tuple_size(edges) - 1

      if down in 0..(picture.rows - 1) and across >= elem(edges, 0) and
           across < elem(edges, columns) do
        column = Enum.find(1..columns, &(across < elem(edges, &1))) - 1
        if :binary.at(picture.white, down * columns + column) == 1, do: 220, else: 30
      end
    end)
  end

  defp find(frame) do
    {:ok, marks} = Marks.new(family: :similar, size: 0.16)
    {:ok, detector} = Marks.detector(marks)
    Marks.find(marks, detector, frame)
  end

  test "the library is loaded, and needs no other" do
    assert Native.loaded?()
    assert Marks.available(:similar) == :ok
  end

  test "the pattern looks the same from any distance, but for its ends" do
    edges = Pattern.edges() |> Enum.drop(2)

    for {t, k} <- Enum.with_index(edges),
        do: assert_in_delta(t, :math.pow(2 / 3, k / 2), 1.0e-12)

    picture = Pattern.picture(3)
    rows = Picture.rows(picture)
    assert length(rows) == picture.rows

    colour = fn t ->
      column = Enum.find_index(tl(picture.edges), &(t - 0.5 < &1))
      :binary.at(Enum.at(rows, 6), column)
    end

    for k <- 170..999, t = k / 1000, Enum.all?(edges, &(abs(&1 - t) > 1.0e-3)) do
      assert colour.(t * 2 / 3) == colour.(t) or t * 2 / 3 < List.last(edges)
      assert colour.(t * :math.sqrt(2 / 3)) == 1 - colour.(t)
    end
  end

  test "each id is read from its picture, and no other word is an id" do
    for id <- 0..15, do: assert(Pattern.id(Pattern.code(id)) == id)
    assert Pattern.id([1, 0, 0, 0, 0, 0, 0, 0]) == nil
    assert Marks.picture(:similar, 16) == nil

    for id <- [0, 6, 15], format <- [:i420, :yuyv] do
      assert {:ok, [mark]} = find(frame([{id, 30.0, 40.0, 44.0, 0.0}], format: format))
      assert %{family: :similar, id: ^id, at_ms: 7} = mark

      for {{x, y}, {u, v}} <-
            Enum.zip(mark.corners, [{30, 40}, {74, 40}, {74, 84}, {30, 84}]) do
        assert_in_delta x, u, 0.4
        assert_in_delta y, v, 0.4
      end

      # 173.2 px of focal length; the range is along the floor.
      aside = 99.5 - 52.0
      assert_in_delta mark.range, :math.sqrt(173.2 * 173.2 + aside * aside) * 0.16 / 44, 0.02
      assert_in_delta mark.bearing, :math.atan2(aside, 173.2), 0.003
    end
  end

  test "what is upside down, mirrored, or has a part of its height or its barcode hidden is not read" do
    whole = frame([{6, 30.0, 40.0, 44.0, 0.0}])
    assert {:ok, [_mark]} = find(whole)

    rows =
      for <<row::binary-size(@width) <- binary_part(whole.bytes, 0, @width * @height)>>, do: row

    chroma = :binary.copy(<<128>>, div(@width * @height, 2))
    changed = fn rows -> %{whole | bytes: IO.iodata_to_binary([rows, chroma])} end
    mirror = fn row -> row |> :binary.bin_to_list() |> Enum.reverse() |> :binary.list_to_bin() end
    assert {:ok, [_mark]} = find(changed.(rows))
    assert find(changed.(Enum.reverse(Enum.map(rows, mirror)))) == {:ok, []}
    assert find(changed.(Enum.map(rows, mirror))) == {:ok, []}

    hide = fn rows, left, right, from, to ->
      for {row, y} <- Enum.with_index(rows) do
        if y in from..to do
          <<before::binary-size(left), _::binary-size(right - left), rest::binary>> = row
          before <> :binary.copy(<<20>>, right - left) <> rest
        else
          row
        end
      end
    end

    assert find(changed.(hide.(rows, 0, @width, 65, 119))) == {:ok, []}
    assert find(changed.(hide.(rows, 0, @width, 0, 50))) == {:ok, []}
    assert find(changed.(hide.(rows, 100, 140, 0, 119))) == {:ok, []}
    # A few rows of it do no harm.
    assert {:ok, [%{id: 6}]} = find(changed.(hide.(rows, 0, @width, 60, 64)))
  end

  test "two marks in one frame are both read, from the left" do
    frame = frame([{9, 106.0, 12.0, 36.0, 0.0}, {9, 8.0, 66.0, 40.0, 0.0}])
    assert {:ok, [%{id: 9, x: left}, %{id: 9, x: right}]} = find(frame)
    assert left < right
  end

  test "it is found again where it was, with its barcode" do
    {:ok, marks} = Marks.new(family: :similar, size: 0.16)
    {:ok, detector} = Marks.detector(marks)
    first = frame([{6, 20.0, 40.0, 44.0, 0.0}])
    {:ok, [%{id: 6}], schedule} = Marks.look(marks, detector, %Marks.Schedule{}, first)
    next = %{frame([{6, 26.0, 38.0, 44.0, 0.0}]) | at_ms: first.at_ms + 100}
    assert {:boxes, [_box]} = Marks.Schedule.plan(schedule, next.at_ms, {@width, @height})
    assert {:ok, [%{id: 6, at_ms: 107}], _schedule} = Marks.look(marks, detector, schedule, next)
  end

  test "C and Elixir find the same, to the bit" do
    found =
      for n <- 1..16 do
        size = 20.0 + 2.5 * n
        aside = rem(n, 5) / 20 - 0.1
        place = {rem(n, 16), 14.0 + rem(n, 3) / 3, 10.0 + rem(n, 4) / 4, size, aside}
        format = Enum.at([:i420, :nv12, :yuyv], rem(n, 3))
        frame = frame([place], noise: 6.0 * rem(n, 4), seed: n, format: format)

        for box <- [{0, 0, @width, @height}, {3, 5, 171, 104}, {40, 0, 60, 19}] do
          {:ok, found} = Native.find(frame, box)
          assert Reference.find(frame, box) === {:ok, found}
          length(found)
        end
      end

    assert found |> List.flatten() |> Enum.sum() > 16
  end

  test "the C code refuses what does not fit together" do
    frame = frame([])
    wrong = &assert_raise(ArgumentError, fn -> Native.find(&1, &2) end)
    wrong.(%{frame | bytes: <<0>>}, {0, 0, @width, @height})
    wrong.(%{frame | width: @width + 2}, {0, 0, @width, @height})
    wrong.(frame, {0, 0, @width + 1, @height})
    wrong.(frame, {0, -1, @width, @height})
    {:ok, tiny} = Frame.new(:yuyv, 2, 1, <<0, 0, 0, 0>>, 0)
    assert find(tiny) == {:ok, []}
  end
end
