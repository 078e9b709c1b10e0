defmodule Vision.Backend do
  @moduledoc """
  Defines a way to find the regions of a frame. `Vision.Backend.Reference` defines the answer, in plain Elixir;
  `Vision.Backend.Native` gives the same answer, faster. `Vision.Backend.Nx` and `Vision.Backend.Evision` give it where
  their packages are (docs/packages.md).

  A backend of your own may give this answer in yet another way, or find something else, such as
  lamps. The option `:backend` of `Vision.Colours` selects it. The colours then name what it
  finds: a region of class 0 becomes a blob with the name and the distance of the first colour.

  ## The answer of the reference

  In a pixel's mask, bit k is set if class k allows the pixel. A region is a largest set of pixels
  with exactly the same mask, not 0, that are connected by their sides (corners do not connect).
  Its class is the lowest bit of its mask. Regions below `min_area` or above `max_area` are left
  out.

  The regions are ordered by class, then by area (largest first), then by the top and the left
  side of their box, then by their first pixel. The number of regions and runs is not limited.

  ## From frame to frame

  A backend that takes memory for its search may also have `c:scratch/0` and `c:regions/3`. A
  process that looks at one frame after another (`Vision.BlobDetector`) then makes a scratch once
  and passes it along with each frame, so that the memory is not taken and freed each time. The
  answer does not depend on it.
  """

  @typedoc """
  In pixels; `right` and `bottom` are the last ones inside. The centroid is `sum_x / area`,
  `sum_y / area`.
  """
  @type region ::
          {class :: 0..31, area :: pos_integer(), sum_x :: non_neg_integer(),
           sum_y :: non_neg_integer(), left :: non_neg_integer(), top :: non_neg_integer(),
           right :: non_neg_integer(), bottom :: non_neg_integer()}

  @doc "Whether this backend runs on this machine and reads this format."
  @callback reads?(Hal.Frame.format()) :: boolean()

  @type answer ::
          {:ok, [region()]} | {:error, :memory | {:size, {pos_integer(), pos_integer()}}}

  @doc "Finds the regions of a frame whose byte count has been checked."
  @callback regions(Hal.Frame.t(), Vision.Colours.t()) :: answer()

  @doc "What the process that calls this keeps from frame to frame; garbage collection frees it."
  @callback scratch() :: term()

  @doc "As `c:regions/2`, in the memory of a scratch."
  @callback regions(Hal.Frame.t(), Vision.Colours.t(), scratch :: term()) :: answer()

  @optional_callbacks scratch: 0, regions: 3
end
