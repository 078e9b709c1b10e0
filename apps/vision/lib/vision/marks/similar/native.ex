defmodule Vision.Marks.Similar.Native do
  @moduledoc false
  # Finds self-similar marks in C, on a dirty scheduler.
  use Hal.Nif, app: :vision, library: "similar"
  alias Hal.Frame

  @formats %{yuyv: 0, i420: 1, nv12: 2}

  @doc "As `Vision.Marks.Similar.Reference.find/2`, or `{:error, :memory}`."
  @spec find(Frame.t(), Vision.Marks.Schedule.box()) ::
          {:ok, [Vision.Marks.Native.found()]} | {:error, :memory}
  def find(%Frame{format: format} = frame, box),
    do: find(@formats[format], frame.width, frame.height, frame.bytes, box)

  defp find(_format, _width, _height, _bytes, _box), do: :erlang.nif_error(:nif_not_loaded)
end
