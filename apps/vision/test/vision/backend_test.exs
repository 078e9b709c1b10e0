defmodule Vision.BackendTest do
  @moduledoc "The native backend gives the reference's answer, on frames made to be difficult."
  use ExUnit.Case, async: true
  alias Hal.Frame
  alias Vision.Backend.{Native, Reference}
  alias Vision.Colours

  for format <- [:yuyv, :i420, :nv12] do
    test "hundreds of random #{format} frames", do: random_frames(unquote(format), 200)

    @tag :long
    test "thousands of random #{format} frames", do: random_frames(unquote(format), 2_000)
  end

  test "spirals and combs, whose arms meet late" do
    colours = colours([%{name: "a", y: {100, 255}, u: {0, 255}, v: {0, 255}}])

    comb = fn x, y -> rem(x, 2) == 0 or y == 15 end
    rings = fn x, y -> rem(max(abs(x - 16), abs(y - 8)), 2) == 0 end
    stairs = fn x, y -> rem(x + y, 3) == 0 end
    spiral = fn x, y -> rem(x + 2 * y, 7) < 4 or x == 31 end

    for shape <- [comb, rings, stairs, spiral] do
      luma = for y <- 0..15, x <- 0..31, into: <<>>, do: <<if(shape.(x, y), do: 200, else: 0)>>
      {:ok, frame} = Frame.new(:i420, 32, 16, luma <> :binary.copy(<<128>>, 256), 0)
      compare(frame, colours)
    end
  end

  test "a frame of more runs than CMVision could hold" do
    luma = for _y <- 0..239, x <- 0..319, into: <<>>, do: <<rem(x, 2) * 200>>
    {:ok, frame} = Frame.new(:i420, 320, 240, luma <> :binary.copy(<<128>>, 38_400), 0)
    class = %{name: "a", y: {100, 255}, u: {0, 255}, v: {0, 255}}
    {:ok, colours} = Colours.new([class])
    {:ok, blobs} = Vision.blobs(frame, colours, Native)
    assert length(blobs) == 160
  end

  defp random_frames(format, count) do
    for _ <- 1..count, do: compare(random_frame(format), random_colours())
  end

  defp compare(frame, colours) do
    assert Native.regions(frame, colours) == Reference.regions(frame, colours)
  end

  defp random_frame(format) do
    width = 2 * :rand.uniform(20)
    height = if format == :yuyv, do: :rand.uniform(16), else: 2 * :rand.uniform(8)
    {:ok, size} = Frame.byte_size(format, width, height)
    {:ok, frame} = Frame.new(format, width, height, random_bytes(:rand.uniform(3), size), 0)
    frame
  end

  # Noise gives single pixels, few levels give large regions, stretches give long runs.
  defp random_bytes(1, size), do: for(_ <- 1..size, into: <<>>, do: <<:rand.uniform(256) - 1>>)
  defp random_bytes(2, size), do: for(_ <- 1..size, into: <<>>, do: <<100 * :rand.uniform(2)>>)

  defp random_bytes(3, size) do
    stretches = for _ <- 1..size, do: :binary.copy(<<50 * :rand.uniform(4)>>, :rand.uniform(9))
    stretches |> IO.iodata_to_binary() |> binary_part(0, size)
  end

  defp random_colours do
    count = Enum.random([1, 2, 3, 8, 32])
    colours(for k <- 1..count, do: %{name: "c#{k}", y: limits(), u: limits(), v: limits()})
  end

  defp limits do
    case :rand.uniform(4) do
      1 -> {0, 255}
      _ -> Enum.min_max([:rand.uniform(256) - 1, :rand.uniform(256) - 1])
    end
  end

  defp colours(classes) do
    {:ok, colours} =
      Colours.new(classes, min_area: :rand.uniform(4), max_area: Enum.random([0, 0, 30]))

    colours
  end
end
