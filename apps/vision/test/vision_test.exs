defmodule VisionTest do
  use ExUnit.Case, async: true
  doctest Vision
  doctest Vision.Detections
  doctest Vision.Rgb
  doctest Vision.Pixels
  alias Hal.Frame
  alias Vision.Backend.{Native, Reference}
  alias Vision.{Colours, Rgb}

  @yellow %{name: "YellowLandmark", y: {170, 240}, u: {60, 90}, v: {130, 145}}

  # Drawn in RGB (220, 205, 90) on black; what the original CMVision makes of it was recorded.
  @shapes [
    {100..139, 50..79},
    {140..149, 80..89},
    {10..13, 10..14},
    {20..22, 10..15},
    {201..210, 100..100},
    {201..203, 101..120},
    {208..210, 101..120}
  ]
  @recorded [
    {1200, 100, 139, 50, 79, {119.5, 64.5}},
    {100, 140, 149, 80, 89, {144.5, 84.5}},
    {88, 202, 209, 100, 120, {205.5, 109.545}},
    {20, 10, 13, 10, 14, {11.5, 12.0}}
  ]

  setup_all do
    assert Native.loaded?()
    {:ok, colours} = Colours.new([@yellow], distance: %{"YellowLandmark" => 0.0651})
    %{colours: colours}
  end

  defmodule Corner do
    @moduledoc "Sees one pixel, whatever the picture shows."
    @behaviour Vision.Backend

    @impl Vision.Backend
    def reads?(format), do: format == :rgb24

    @impl Vision.Backend
    def regions(_frame, _colours), do: {:ok, [{0, 1, 0, 0, 0, 0, 0, 0}]}
  end

  test "colours may name their backend, and a backend that is given goes before it" do
    {:ok, colours} = Colours.new([@yellow], backend: Corner)
    {:ok, frame} = Frame.new(:rgb24, 2, 1, <<0::48>>, 0)
    assert {:ok, [%{colour: "YellowLandmark", area: 1}]} = Vision.blobs(frame, colours)
    assert Vision.blobs(frame, colours, Reference) == {:ok, []}
    {:ok, other} = Frame.new(:yuyv, 2, 1, <<0::32>>, 0)
    assert Vision.blobs(other, colours) == {:error, {:format, :yuyv}}
  end

  defmodule Remembering do
    @moduledoc "Finds as many regions as it has searched frames with its scratch."
    @behaviour Vision.Backend

    @impl Vision.Backend
    def reads?(_format), do: true

    @impl Vision.Backend
    def regions(_frame, _colours), do: {:ok, []}

    @impl Vision.Backend
    def scratch, do: :counters.new(1, [])

    @impl Vision.Backend
    def regions(_frame, _colours, counter) do
      :counters.add(counter, 1, 1)
      {:ok, List.duplicate({0, 1, 0, 0, 0, 0, 0, 0}, :counters.get(counter, 1))}
    end
  end

  test "a backend gets its own scratch, frame after frame, and never another's" do
    {:ok, frame} = Frame.new(:yuyv, 2, 1, <<0::32>>, 0)
    {:ok, colours} = Colours.new([@yellow], backend: Remembering)
    scratch = Vision.scratch(colours)
    assert {:ok, [_]} = Vision.blobs(frame, colours, nil, scratch)
    assert {:ok, [_, _]} = Vision.blobs(frame, colours, nil, scratch)
    assert {:ok, []} = Vision.blobs(frame, colours)
    assert {:ok, []} = Vision.blobs(frame, colours, nil, Vision.scratch(colours, Native))
    assert {:ok, []} = Vision.blobs(frame, colours, Reference, scratch)
    assert Vision.scratch(colours, Reference) == nil
    assert Vision.scratch(colours, Corner) == nil
  end

  defp drawing do
    for y <- 0..239 do
      for x <- 0..319 do
        if Enum.any?(@shapes, fn {xs, ys} -> x in xs and y in ys end),
          do: {220, 205, 90},
          else: {0, 0, 0}
      end
    end
  end

  defp yuyv(rows) do
    for row <- rows, [{y0, u, v}, {y1, _, _}] <- Enum.chunk_every(Rgb.row(row), 2), into: <<>> do
      <<y0, u, y1, v>>
    end
  end

  test "the recorded drawing, by both backends and from RGB", %{colours: colours} do
    rows = drawing()
    rgb = for row <- rows, {r, g, b} <- row, into: <<>>, do: <<r, g, b>>
    {:ok, rgb} = Frame.new(:rgb24, 320, 240, rgb, 0)
    {:ok, yuyv} = Frame.new(:yuyv, 320, 240, yuyv(rows), 0)

    for {frame, backend} <- [{rgb, nil}, {yuyv, Reference}, {yuyv, Native}] do
      assert {:ok, blobs} = Vision.blobs(frame, colours, backend)

      assert @recorded ==
               for(
                 b <- blobs,
                 do: {b.area, b.left, b.right, b.top, b.bottom, {b.x, Float.round(b.y, 3)}}
               )

      assert [%{colour: "YellowLandmark", share: share, clipped?: false, distance: metres} | _] =
               blobs

      assert_in_delta share, 1200 / 76_800, 1.0e-12
      assert_in_delta metres, :math.sqrt(0.0651 / share), 1.0e-12
    end
  end

  test "a blob at the border is clipped, one that fills the frame has no distance", %{
    colours: colours
  } do
    {:ok, frame} = Frame.new(:yuyv, 8, 6, String.duplicate(<<200, 70, 200, 140>>, 24), 0)
    assert {:ok, [%{clipped?: true, distance: nil, share: 1.0}]} = Vision.blobs(frame, colours)
  end

  test "one side at the border is enough to be clipped", %{colours: colours} do
    for {columns, rows, clipped?} <- [
          {0..5, 4..9, true},
          {10..15, 4..9, true},
          {4..9, 0..5, true},
          {4..9, 6..11, true},
          {4..9, 4..9, false}
        ] do
      bytes =
        for y <- 0..11, x <- 0..15, into: <<>> do
          if x in columns and y in rows, do: <<220, 205, 90>>, else: <<0, 0, 0>>
        end

      {:ok, frame} = Frame.new(:rgb24, 16, 12, bytes, 0)
      assert {:ok, [%{clipped?: ^clipped?}]} = Vision.blobs(frame, colours)
    end
  end

  test "a frame whose bytes do not fit is an error in each backend", %{colours: colours} do
    frame = %Frame{format: :yuyv, width: 4, height: 2, bytes: <<1, 2, 3>>, at_ms: 0}

    for backend <- [nil, Reference, Native] do
      assert Vision.blobs(frame, colours, backend) == {:error, {:bytes, 3, :expected, 16}}
      assert {:error, {:size, {3, 2}}} = Vision.blobs(%{frame | width: 3}, colours, backend)
      assert {:error, {:size, {0, 2}}} = Vision.blobs(%{frame | width: 0}, colours, backend)
    end
  end

  test "a format that the backend does not read is an error", %{colours: colours} do
    {:ok, frame} = Frame.new(:rgb24, 1, 1, <<1, 2, 3>>, 0)
    assert Vision.blobs(frame, colours, Native) == {:error, {:format, :rgb24}}
    assert Vision.blobs(frame, colours) == {:ok, []}
  end

  test "a frame too large for the native backend is an error", %{colours: colours} do
    bytes = :binary.copy(<<0>>, 2 * 40_000)
    {:ok, frame} = Frame.new(:yuyv, 40_000, 1, bytes, 0)
    assert Vision.blobs(frame, colours, Native) == {:error, {:size, {40_000, 1}}}
  end
end
