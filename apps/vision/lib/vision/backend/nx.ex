if Code.ensure_loaded?(Nx) do
  defmodule Vision.Backend.Nx do
    @moduledoc """
    Regions by Nx: a numerical definition computes the masks of all pixels, three look-ups and two
    ANDs each, and `Vision.Runs` joins them in Elixir. That part follows contours from row to row, so
    it stays where it is whatever compiles the first.

    Nx chooses where the masks are computed: in Elixir (`Nx.BinaryBackend`, slow, always there), or
    by EXLA with

        config :nx, default_defn_options: [compiler: EXLA]

    It is for programs that go on with tensors of their own: `masks/3` is the first step of a detector
    in Nx. As a mere blob finder it is far slower than `Vision.Backend.Native` (docs/packages.md).
    """
    @behaviour Vision.Backend
    import Nx.Defn
    alias Hal.Frame
    alias Vision.{Colours, Runs}

    @formats [:yuyv, :i420, :nv12, :yuv444]

    @impl Vision.Backend
    def reads?(format), do: format in @formats

    @impl Vision.Backend
    def regions(%Frame{width: width, height: height} = frame, %Colours{} = colours) do
      tables = colours.tables |> Nx.from_binary(:u32) |> Nx.reshape({3, 256})

      masks =
        frame.bytes
        |> Nx.from_binary(:u8)
        |> masks(tables, format: frame.format, width: width, height: height)
        |> Nx.to_binary()

      {:ok, Runs.regions(masks, width, colours)}
    end

    @doc """
    The mask of each pixel, a tensor `{height, width}` of `u32`, from the bytes of a frame (`u8`) and
    `Vision.Colours`' tables (`u32`, `{3, 256}`). Options: `:format`, `:width`, `:height`.
    """
    @spec masks(Nx.Tensor.t(), Nx.Tensor.t(), keyword()) :: Nx.Tensor.t()
    defn masks(bytes, tables, opts \\ []) do
      opts = keyword!(opts, [:format, :width, :height])
      {y, u, v} = planes(bytes, opts)
      chroma = Nx.take(tables[1], u) &&& Nx.take(tables[2], v)
      Nx.take(tables[0], y) &&& spread(chroma, opts)
    end

    # Y of all pixels, U and V as the format shares them.
    deftransformp planes(bytes, opts) do
      {w, h} = {opts[:width], opts[:height]}
      planes(opts[:format], bytes, w, h)
    end

    defp planes(:yuyv, bytes, w, h) do
      pairs = Nx.reshape(bytes, {h, div(w, 2), 4})
      {every(pairs, 0, 2), every(pairs, 1, 4), every(pairs, 3, 4)}
    end

    defp planes(:i420, bytes, w, h) do
      quarter = div(w * h, 4)
      {part(bytes, 0, w * h), part(bytes, w * h, quarter), part(bytes, w * h + quarter, quarter)}
    end

    defp planes(:nv12, bytes, w, h) do
      chroma = bytes |> part(w * h, div(w * h, 2)) |> Nx.reshape({div(w * h, 4), 2})
      {part(bytes, 0, w * h), every(chroma, 0, 2), every(chroma, 1, 2)}
    end

    defp planes(:yuv444, bytes, w, h) do
      {part(bytes, 0, w * h), part(bytes, w * h, w * h), part(bytes, 2 * w * h, w * h)}
    end

    defp part(bytes, from, length), do: Nx.slice(bytes, [from], [length])

    # Every `step`th value of the last axis, as one row.
    defp every(tensor, from, step) do
      tensor |> Nx.flatten() |> then(&Nx.slice(&1, [from], [Nx.size(&1) - from], strides: [step]))
    end

    # From one value a block to one a pixel.
    deftransformp spread(chroma, opts) do
      {w, h} = {opts[:width], opts[:height]}
      {across, down} = block(opts[:format])

      chroma
      |> Nx.reshape({div(h, down), 1, div(w, across), 1})
      |> Nx.broadcast({div(h, down), down, div(w, across), across})
      |> Nx.reshape({h * w})
    end

    defp block(:yuyv), do: {2, 1}
    defp block(:yuv444), do: {1, 1}
    defp block(_planar), do: {2, 2}
  end
end
