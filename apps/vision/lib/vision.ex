defmodule Vision do
  @moduledoc """
  Finds coloured regions in camera frames: `blobs/2`. `Vision.Colours` defines colours,
  `Vision.Backend` regions; `Vision.Filter` selects blobs.
  """
  alias Hal.Frame
  alias Vision.{Backend, Blob, Colours}

  @typedoc "The scratch memory of a backend; `nil` is none."
  @type scratch :: {module(), term()} | nil

  @doc """
  The blobs of a frame: by colour, in the order of the colour file, and largest first, unless a
  backend of your own orders them otherwise.

  The backend is the one given, or that of the colours, or else `Vision.Backend.Native` if it
  reads the format, and `Vision.Backend.Reference` if not. The error is that of the frame
  (`{:bytes, got, :expected, n}`, `{:size, {w, h}}`), `{:format, format}` if the backend does not
  read it, or `:memory`.

  A process that looks at many frames passes a `scratch/2` of its own, which makes it faster.

      iex> yellow = %{name: "Yellow", y: {170, 240}, u: {60, 90}, v: {130, 145}}
      iex> {:ok, colours} = Vision.Colours.new([yellow], min_area: 2)
      iex> {:ok, frame} = Hal.Frame.new(:yuyv, 4, 1, <<200, 70, 200, 140, 0, 128, 0, 128>>, 0)
      iex> {:ok, [blob]} = Vision.blobs(frame, colours)
      iex> {blob.colour, blob.area, blob.x, blob.left, blob.right, blob.share, blob.clipped?}
      {"Yellow", 2, 0.5, 0, 1, 0.5, true}
  """
  @spec blobs(Frame.t(), Colours.t(), module() | nil, scratch()) ::
          {:ok, [Blob.t()]} | {:error, term()}
  def blobs(%Frame{} = frame, %Colours{} = colours, backend \\ nil, scratch \\ nil) do
    with :ok <- check(frame),
         {:ok, backend} <- backend(frame.format, backend || colours.backend),
         {:ok, regions} <- regions(backend, frame, colours, scratch) do
      classes = List.to_tuple(colours.classes)
      {:ok, Enum.map(regions, &blob(&1, classes, frame))}
    end
  end

  @doc """
  Memory that the search with these colours and this backend uses again from frame to frame: for
  `blobs/4`. It belongs to the process that makes it, and is freed with it. Two processes that
  share one both get their answers, one of them more slowly.

      iex> {:ok, colours} = Vision.Colours.new([%{name: "Any", y: {0, 255}, u: {0, 255}, v: {0, 255}}])
      iex> scratch = Vision.scratch(colours)
      iex> {:ok, frame} = Hal.Frame.new(:yuyv, 4, 8, String.duplicate(<<0>>, 64), 0)
      iex> for _ <- 1..2, do: Vision.blobs(frame, colours, nil, scratch) == Vision.blobs(frame, colours)
      [true, true]
  """
  @spec scratch(Colours.t(), module() | nil) :: scratch()
  def scratch(%Colours{} = colours, backend \\ nil) do
    backend = backend || colours.backend || Backend.Native

    if Code.ensure_loaded?(backend) and function_exported?(backend, :scratch, 0),
      do: {backend, backend.scratch()}
  end

  @doc """
  The distance in metres of a blob that fills this share of the frame, by the constant of its
  colour.

  The share decreases with the square of the distance. A share above one half only shows that the
  blob is near, and gives `nil`.

      iex> Vision.distance(0.0651, 0.0651)
      1.0
      iex> Vision.distance(0.0651, 0.6)
      nil
      iex> Vision.distance(nil, 0.01)
      nil
  """
  @spec distance(constant :: number() | nil, share :: float()) :: float() | nil
  def distance(nil, _share), do: nil
  def distance(_constant, share) when share > 0.5, do: nil
  def distance(constant, share), do: :math.sqrt(constant / share)

  defp check(%Frame{format: format, width: width, height: height, bytes: bytes}) do
    case Frame.byte_size(format, width, height) do
      {:ok, size} when byte_size(bytes) == size -> :ok
      {:ok, size} -> {:error, {:bytes, byte_size(bytes), :expected, size}}
      {:error, reason} -> {:error, reason}
    end
  end

  defp backend(format, nil),
    do: {:ok, if(Backend.Native.reads?(format), do: Backend.Native, else: Backend.Reference)}

  defp backend(format, backend),
    do: if(backend.reads?(format), do: {:ok, backend}, else: {:error, {:format, format}})

  defp regions(backend, frame, colours, {backend, scratch}),
    do: backend.regions(frame, colours, scratch)

  defp regions(backend, frame, colours, _of_another), do: backend.regions(frame, colours)

  defp blob({k, area, sum_x, sum_y, left, top, right, bottom}, classes, %Frame{
         width: w,
         height: h
       }) do
    class = elem(classes, k)
    share = area / (w * h)

    %Blob{
      colour: class.name,
      area: area,
      share: share,
      x: sum_x / area,
      y: sum_y / area,
      left: left,
      top: top,
      right: right,
      bottom: bottom,
      width: w,
      height: h,
      distance: distance(class.distance, share),
      clipped?: left == 0 or top == 0 or right == w - 1 or bottom == h - 1
    }
  end
end
