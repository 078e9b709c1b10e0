defmodule Vision.BackendTest do
  @moduledoc """
  Every backend gives the reference's answer, on frames made to be difficult. No case is left out for any of them:
  overlapping classes and ties are among the cases, as OpenCV alone would answer them differently. What a backend
  does not read is left out: `rgb24` by all but the reference and `Vision.Runs`, `yuv444` by the native one.
  """
  use ExUnit.Case, async: true
  alias Hal.Frame
  alias Vision.{Backend, Colours, HardFrames}
  alias Vision.Backend.Reference

  @backends [
    {Backend.Native, []},
    {Vision.ByTables, []},
    {Backend.Nx, adapter: :nx},
    {Backend.Evision, adapter: :evision}
  ]

  for {backend, tags} <- @backends do
    describe inspect(backend) do
      @describetag backend: backend
      for tag <- tags, do: @describetag([tag])

      unless Code.ensure_loaded?(backend),
        do: @describetag(skip: "#{tags[:adapter]} is not installed")

      test("hundreds of random frames", %{backend: backend}, do: random_frames(backend, 200))

      @tag :long
      test("thousands of random frames", %{backend: backend}, do: random_frames(backend, 2_000))

      test "spirals and combs, whose arms meet late", %{backend: backend} do
        colours = HardFrames.luma([{100, 255}])

        comb = fn x, y -> rem(x, 2) == 0 or y == 15 end
        rings = fn x, y -> rem(max(abs(x - 16), abs(y - 8)), 2) == 0 end
        stairs = fn x, y -> rem(x + y, 3) == 0 end
        spiral = fn x, y -> rem(x + 2 * y, 7) < 4 or x == 31 end

        for shape <- [comb, rings, stairs, spiral] do
          rows = for y <- 0..15, do: for(x <- 0..31, into: "", do: digit(shape.(x, y)))
          compare(backend, HardFrames.drawn(rows), colours)
        end
      end

      test "two classes that overlap", %{backend: backend} do
        frame = HardFrames.drawn(["111222", "110222", "111110"] ++ ["000000"])
        colours = HardFrames.luma([{50, 250}, {150, 250}])

        # 2 is of both classes: a region of its own, though a class of OpenCV's would join it to 1.
        assert {:ok, [{0, 10, _, _, 0, 0, 4, 2}, {0, 6, _, _, 3, 0, 5, 1}]} =
                 backend.regions(frame, colours)

        compare(backend, frame, colours)
      end

      test "regions that share class, area and corner come by their first pixel", %{
        backend: backend
      } do
        # A square of nine, and a hook of nine round it.
        square_and_hook = ["111020", "111020", "111020", "000020", "222220", "000000"]

        for limits <- [[{50, 250}], [{50, 250}, {150, 250}], [{50, 250}, {50, 150}]] do
          frame = HardFrames.drawn(square_and_hook)
          colours = HardFrames.luma(limits)

          assert {:ok, [{0, 9, 9, _, 0, 0, 2, 2}, {0, 9, _, _, 0, 0, 4, 4}]} =
                   backend.regions(frame, colours)

          compare(backend, frame, colours)
        end
      end

      test "a frame of more runs than CMVision could hold", %{backend: backend} do
        luma = for _y <- 0..239, x <- 0..319, into: <<>>, do: <<rem(x, 2) * 200>>
        {:ok, frame} = Frame.new(:i420, 320, 240, luma <> :binary.copy(<<128>>, 38_400), 0)
        {:ok, blobs} = Vision.blobs(frame, HardFrames.luma([{100, 255}], min_area: 20), backend)
        assert length(blobs) == 160
      end
    end
  end

  defp random_frames(backend, count) do
    read = Enum.filter(Frame.formats(), &backend.reads?/1)
    assert :yuyv in read

    for format <- read, _ <- 1..count do
      compare(backend, HardFrames.random_frame(format), HardFrames.random_colours())
    end
  end

  defp compare(backend, frame, %Colours{} = colours) do
    assert backend.regions(frame, colours) == Reference.regions(frame, colours)
  end

  defp digit(true), do: "2"
  defp digit(false), do: "0"
end
