defmodule Vision.MarksTest do
  use ExUnit.Case, async: true
  alias Hal.Frame
  alias Vision.{BlobDetector, Colours, Marks}
  alias Vision.Marks.{Native, Schedule}
  doctest Vision.Marks
  doctest Vision.Marks.Sheet

  @why_not (case Marks.available() do
              :ok -> nil
              {:error, line} -> line
            end)
  @moduletag skip: @why_not

  # A frame of grey with marks, each cell so many pixels wide: [{id, left, top}].
  defp frame(marks, options \\ []) do
    options = Keyword.merge([family: :tag36h11, px: 5, format: :i420, at_ms: 7], options)
    pixels = for mark <- marks, pixel <- pixels(mark, options), into: %{}, do: pixel
    turn = options[:turn] || fn place -> place end
    luma = for y <- 0..239, x <- 0..319, do: Map.get(pixels, turn.({x, y}), 140)
    bytes = lay(options[:format], luma)
    {:ok, frame} = Frame.new(options[:format], 320, 240, bytes, options[:at_ms])
    %{frame | field_of_view: :math.pi() / 3}
  end

  # With a white cell round it.
  defp pixels({id, left, top}, options) do
    {cells, _border, picture} = Native.picture(options[:family], id)
    px = options[:px]

    for row <- -1..cells, column <- -1..cells, dy <- 0..(px - 1), dx <- 0..(px - 1) do
      inside? = row in 0..(cells - 1) and column in 0..(cells - 1)
      white? = not inside? or :binary.at(picture, row * cells + column) == 1
      {{left + column * px + dx, top + row * px + dy}, if(white?, do: 220, else: 25)}
    end
  end

  defp lay(:yuyv, luma), do: for(y <- luma, into: <<>>, do: <<y, 128>>)

  defp lay(format, luma) when format in [:i420, :nv12],
    do: :binary.list_to_bin(luma) <> :binary.copy(<<128>>, 320 * 120)

  defp lay(:yuv444, luma), do: :binary.list_to_bin(luma) <> :binary.copy(<<128>>, 320 * 480)

  defp detector(family \\ :tag36h11) do
    {:ok, marks} = Marks.new(family: family, size: 0.16)
    {:ok, detector} = Marks.detector(marks)
    {marks, detector}
  end

  defp find(frame, family \\ :tag36h11) do
    {marks, detector} = detector(family)
    Marks.find(marks, detector, frame)
  end

  test "a mark is found with its corners to a fraction of a pixel, in each format" do
    for format <- [:yuyv, :i420, :nv12] do
      assert {:ok, [mark]} = find(frame([{23, 100, 60}], format: format))
      assert %{family: :tag36h11, id: 23, at_ms: 7, width: 320, height: 240} = mark
      # The border begins one cell inside, where the pixels of centre 104 and 105 meet.
      {a, b, c, d} = {104.5, 64.5, 144.5, 104.5}

      for {{x, y}, {u, v}} <- Enum.zip(mark.corners, [{a, b}, {c, b}, {c, d}, {a, d}]) do
        assert_in_delta x, u, 0.3
        assert_in_delta y, v, 0.3
      end

      assert_in_delta mark.x, 124.5, 0.2
      # 277 px of focal length, 40 px wide.
      assert_in_delta mark.range, 277.1 * 0.16 / 40, 0.02
      assert_in_delta mark.bearing, :math.atan2(159.5 - 124.5, 277.1), 0.002
    end

    assert find(frame([], format: :yuv444)) == {:error, {:format, :yuv444}}
  end

  test "all marks of a picture are found, by id and from the left; of the other family none" do
    seen = [{5, 200, 20}, {5, 20, 100}, {0, 120, 150}]
    assert {:ok, [%{id: 0}, %{id: 5, x: left}, %{id: 5, x: right}]} = find(frame(seen))
    assert left < right
    assert find(frame(seen), :tagStandard41h12) == {:ok, []}
    standard = frame([{2000, 90, 60}], family: :tagStandard41h12, px: 6)
    assert {:ok, [%{id: 2000, family: :tagStandard41h12}]} = find(standard, :tagStandard41h12)
  end

  test "what is upside down is found, and its corners say so; what is mirrored is not" do
    upside_down = frame([{9, 100, 60}], turn: fn {x, y} -> {319 - x, 239 - y} end)
    assert {:ok, [%{id: 9, corners: [{x, y} | _]} = mark]} = find(upside_down)
    assert x > mark.x and y > mark.y
    assert find(frame([{9, 100, 60}], turn: fn {x, y} -> {319 - x, y} end)) == {:ok, []}
  end

  test "one wrong bit is forgiven, two are not" do
    {10, 8, picture} = Native.picture(:tag36h11, 3)
    inner = for row <- 2..7, column <- 2..7, do: row * 10 + column

    spoil = fn frame, cells ->
      for cell <- cells, reduce: frame do
        frame ->
          {row, column} = {div(cell, 10), rem(cell, 10)}
          luma = if :binary.at(picture, cell) == 1, do: 25, else: 220

          bytes =
            for dy <- 0..4, reduce: frame.bytes do
              bytes ->
                at = (60 + row * 5 + dy) * 320 + 100 + column * 5
                <<before::binary-size(at), _::binary-size(5), rest::binary>> = bytes
                before <> :binary.copy(<<luma>>, 5) <> rest
            end

          %{frame | bytes: bytes}
      end
    end

    clean = frame([{3, 100, 60}])
    assert {:ok, [%{id: 3}]} = find(spoil.(clean, Enum.take(inner, 1)))
    assert find(spoil.(clean, Enum.take(inner, 2))) == {:ok, []}
  end

  test "what is at the edge of the frame would be measured wrong, and is left out" do
    assert {:ok, [%{id: 6}]} = find(frame([{6, 100, 0}]))
    assert {:ok, [%{id: 6}]} = find(frame([{6, 270, 100}]))
    for mark <- [{6, 100, -3}, {6, 273, 100}], do: assert(find(frame([mark])) == {:ok, []})
  end

  test "between whole pictures only the surroundings of marks are searched" do
    {marks, detector} = detector()
    look = fn schedule, frame -> Marks.look(marks, detector, schedule, frame) end
    {:ok, [%{id: 1}], schedule} = look.(%Schedule{}, frame([{1, 40, 40}], at_ms: 0))
    # It has moved a little; another one has come.
    later = frame([{1, 52, 44}, {2, 220, 150}], at_ms: 100)
    assert {:ok, [%{id: 1, at_ms: 100, x: x}], schedule} = look.(schedule, later)
    assert_in_delta x, 52 + 24.5, 0.2
    # Nothing is searched, and what was seen holds.
    assert {:ok, [%{id: 1, at_ms: 100}], ^schedule} = look.(schedule, frame([], at_ms: 133))
    assert {:ok, [], schedule} = look.(schedule, frame([{2, 220, 150}], at_ms: 200))

    assert {:ok, [%{id: 2, at_ms: 500}], _schedule} =
             look.(schedule, frame([{2, 220, 150}], at_ms: 500))
  end

  test "a camera of unknown width gives no place; a picture of a few pixels shows nothing" do
    assert {:ok, [%{id: 4, range: nil, bearing: nil, yaw: nil}]} =
             find(%{frame([{4, 100, 60}]) | field_of_view: nil})

    {:ok, tiny} = Frame.new(:yuyv, 2, 1, <<0, 0, 0, 0>>, 0)
    assert find(tiny) == {:ok, []}
  end

  test "the C code refuses what does not fit together" do
    detector = Native.detector(:tag36h11)
    frame = frame([])
    wrong = &assert_raise(ArgumentError, fn -> Native.search(detector, &1, &2) end)
    wrong.(%{frame | bytes: <<0>>}, {0, 0, 320, 240})
    wrong.(%{frame | width: 322}, {0, 0, 320, 240})
    wrong.(frame, {0, 0, 321, 240})
    wrong.(frame, {0, -1, 320, 240})
    assert Native.picture(:tag36h11, 587) == nil
    assert Native.picture(:tag36h11, 1_000_000_000_000) == nil
    assert {10, 8, _} = Native.picture(:tag36h11, 586)
    assert {9, 5, _} = Native.picture(:tagStandard41h12, 2114)
  end

  test "the blob detector passes marks on with the blobs, if it is told to look for some" do
    {:ok, colours} = Colours.new([%{name: "Any", y: {0, 9}, u: {0, 255}, v: {0, 255}}])
    {:ok, marks} = Marks.new(size: 0.16)

    for {marks, expected} <- [{marks, [11]}, {nil, nil}] do
      options = [colours: colours, marks: marks, sink: {Kernel, :send, [self()]}]
      detector = start_supervised!({BlobDetector, options}, id: {:detector, marks})
      BlobDetector.frame(detector, frame([{11, 100, 60}]))
      assert_receive {:detections, detections}, 5_000
      assert (detections.marks && Enum.map(detections.marks, & &1.id)) == expected
      assert BlobDetector.status(detector).marks == if(marks, do: :ok, else: :none)
    end
  end
end
