defmodule Vision.HardFrames do
  @moduledoc "Frames and colours made to be difficult, for every `Vision.Backend`. By ExUnit's seed."
  alias Hal.Frame
  alias Vision.Colours

  @doc "A small frame of noise, of large regions or of long runs."
  @spec random_frame(Frame.format()) :: Frame.t()
  def random_frame(format) do
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

  @doc "Up to 32 classes, many of which overlap."
  @spec random_colours() :: Colours.t()
  def random_colours do
    count = Enum.random([1, 2, 3, 8, 32])
    classes = for k <- 1..count, do: %{name: "c#{k}", y: limits(), u: limits(), v: limits()}

    {:ok, colours} =
      Colours.new(classes, min_area: :rand.uniform(4), max_area: Enum.random([0, 0, 30]))

    colours
  end

  defp limits do
    case :rand.uniform(4) do
      1 -> {0, 255}
      _ -> Enum.min_max([:rand.uniform(256) - 1, :rand.uniform(256) - 1])
    end
  end

  @doc "An i420 frame with the Y of each pixel, in rows of text: a digit is that many hundreds."
  @spec drawn([String.t()]) :: Frame.t()
  def drawn(rows) do
    {width, height} = {byte_size(hd(rows)), length(rows)}
    luma = for row <- rows, <<digit <- row>>, into: <<>>, do: <<100 * (digit - ?0)>>
    chroma = :binary.copy(<<128>>, div(width * height, 2))
    {:ok, frame} = Frame.new(:i420, width, height, luma <> chroma, 0)
    frame
  end

  @doc "Classes by their limits of Y, with any chroma; options as `Vision.Colours.new/2` has them."
  @spec luma([Colours.limits()], keyword()) :: Colours.t()
  def luma(limits, options \\ [min_area: 1]) do
    classes = for y <- limits, do: %{name: inspect(y), y: y, u: {0, 255}, v: {0, 255}}
    {:ok, colours} = Colours.new(classes, options)
    colours
  end
end
