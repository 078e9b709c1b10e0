defmodule Vision.Backend do
  @moduledoc """
  A way to find the regions of a frame. `Vision.Backend.Reference` defines the answer, in plain
  Elixir; `Vision.Backend.Native` gives the same answer, faster.

  One of your own may give this answer in yet another way, or find something else, such as lamps. The option `:backend` of
  `Vision.Colours` selects it. The colours then name what it finds: a region of class 0 becomes a blob with the name and the
  distance of the first colour.

  ## The answer of the reference

  A pixel's mask has bit k set where class k allows it. A region is a greatest set of pixels with
  exactly the same mask, not 0, joined by their sides (corners do not join). Its class is the
  lowest bit of its mask. Regions below `min_area` or above `max_area` are left out.

  Order: by class, then largest first, then topmost, then leftmost box, then the region whose
  first pixel comes first. There is no limit on regions or runs.
  """

  @typedoc "Pixels; `right` and `bottom` are the last inside. The centroid is `sum_x / area`, `sum_y / area`."
  @type region ::
          {class :: 0..31, area :: pos_integer(), sum_x :: non_neg_integer(),
           sum_y :: non_neg_integer(), left :: non_neg_integer(), top :: non_neg_integer(),
           right :: non_neg_integer(), bottom :: non_neg_integer()}

  @doc "Whether this backend runs on this machine and reads this format."
  @callback reads?(Hal.Frame.format()) :: boolean()

  @doc "The regions of a frame whose byte count has been checked."
  @callback regions(Hal.Frame.t(), Vision.Colours.t()) ::
              {:ok, [region()]} | {:error, :memory | {:size, {pos_integer(), pos_integer()}}}
end
