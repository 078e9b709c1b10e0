defmodule Vision.Marks.Similar do
  @moduledoc """
  Finds self-similar marks with a barcode (`Vision.Marks.Similar.Pattern`) in frames, without any library. For each band of four
  rows, at each place x, a score says how much the w = 24 pixels to the right look like the pattern (after D. Scharstein and
  A. Briggs, "Real-time recognition of self-similar landmarks", Image and Vision Computing 19, 2001):

      m(x) = sum over k = 1..w of |I(x + k) - I(x + sqrt(2/3) k)| - |I(x + k) - I(x + 2/3 k)|

  Lines of places where it is greatest are candidates, and those whose edges, ends, surroundings and barcode are right are marks.
  Larger ones are found in coarser copies of the picture.

  It runs in C on a dirty scheduler where that was built, else in Elixir, with the same result to the bit.
  """
  alias Hal.Frame
  alias Vision.Marks.{Native, Schedule, Similar}

  @doc "The marks in a part of a frame, as `Vision.Marks.Native.search/3` tells them, and with its errors."
  @spec search(Frame.t(), Schedule.box()) :: {:ok, [Native.found()]} | {:error, :memory}
  def search(%Frame{} = frame, box), do: kernel().find(frame, box)

  defp kernel, do: if(Similar.Native.loaded?(), do: Similar.Native, else: Similar.Reference)
end
