defmodule Vision.Blob do
  @moduledoc """
  Describes one coloured region of a frame, after CMVision and Player's blobfinder.

  Pixels are counted from the top left; `left` and `top` are the first pixel inside, `right` and
  `bottom` the last one **inside**. `x`, `y` are the centroid, with pixel centres at whole
  numbers. `width` and `height` are those of the frame, and `share` is the area as a part of the
  frame's. `clipped?` says that the box touches the border of the frame, so that area and
  distance mean little. `distance` (metres) is `nil` if the colour has no distance constant,
  or if the blob fills more than half of the frame.
  """

  @enforce_keys [:colour, :area, :share, :x, :y, :left, :top, :right, :bottom, :width, :height]
  defstruct @enforce_keys ++ [distance: nil, clipped?: false]

  @type t :: %__MODULE__{
          colour: String.t(),
          area: pos_integer(),
          share: float(),
          x: float(),
          y: float(),
          left: non_neg_integer(),
          top: non_neg_integer(),
          right: non_neg_integer(),
          bottom: non_neg_integer(),
          width: pos_integer(),
          height: pos_integer(),
          distance: float() | nil,
          clipped?: boolean()
        }
end
