defmodule Vision.ByTables do
  @moduledoc "A backend of `Vision.Runs` and the colours' tables, in plain Elixir: what other backends share."
  @behaviour Vision.Backend
  alias Vision.{Colours, Pixels, Runs}

  @impl Vision.Backend
  def reads?(format), do: format in Hal.Frame.formats()

  @impl Vision.Backend
  def regions(frame, colours) do
    masks =
      for pixel <- Pixels.yuv(frame), into: <<>>, do: <<Colours.mask(colours, pixel)::32-native>>

    {:ok, Runs.regions(masks, frame.width, colours)}
  end
end
