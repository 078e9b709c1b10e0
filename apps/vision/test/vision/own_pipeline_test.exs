defmodule Vision.OwnPipelineTest do
  @moduledoc "The pipeline of OpenCV's functions that the documents show, as it is written there."
  use ExUnit.Case, async: true
  alias Hal.Frame
  alias Vision.HardFrames

  @moduletag adapter: :evision
  unless Code.ensure_loaded?(Evision), do: @moduletag(skip: "evision is not installed")

  @docs Path.expand("../../../../docs", __DIR__)

  setup_all do
    [text] =
      for path <- Path.wildcard(Path.join(@docs, "*.md")),
          [_all, text] <-
            Regex.scan(~r/^```elixir \S+bright\.ex\n(.*?)^```$/ms, File.read!(path)),
          do: text

    [{module, _code}] = Code.compile_string(text, "bright.ex")
    %{backend: module}
  end

  test "finds what is bright in any light, and no speck", %{backend: backend} do
    colours = HardFrames.luma([{0, 255}], min_area: 20)

    for {dark, light} <- [{20, 90}, {120, 250}] do
      frame = frame(fn x, y -> if lamp?(x, y) or {x, y} == {5, 5}, do: light, else: dark end)
      assert {:ok, [blob]} = Vision.blobs(frame, colours, backend)
      assert {blob.left, blob.right, blob.top, blob.bottom} == {30, 49, 12, 31}
      assert_in_delta blob.x, 39.5, 0.2
      assert_in_delta blob.y, 21.5, 0.2
    end
  end

  defp lamp?(x, y), do: (x - 39.5) * (x - 39.5) + (y - 21.5) * (y - 21.5) < 100

  defp frame(luma) do
    bytes = for y <- 0..47, x <- 0..63, into: <<>>, do: <<luma.(x, y), 128>>
    {:ok, frame} = Frame.new(:yuyv, 64, 48, bytes, 0)
    frame
  end
end
