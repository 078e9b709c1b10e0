defmodule Vision.Mark do
  @moduledoc """
  Describes one printed mark with an id (`Vision.Marks`) in a frame: where it is in the picture, and where from the robot.

    * `family`, `id` - what it is
    * `at_ms` - when the frame was taken, by the robot's clock
    * `x`, `y` - its centre, and `corners` those of its square, in pixels with their centres at whole numbers: upper left, upper
      right, lower right, lower left of the mark as it is printed
    * `range` - metres along the floor from the camera to its centre
    * `bearing` - radians from the robot's heading, left positive
    * `yaw` - radians by which the robot would turn to the left to stand square to the mark, its face before it; `nil` where two
      poses fit what is seen, as from straight ahead or from afar
    * `range_sd`, `bearing_sd`, `yaw_sd` - their standard deviations

  `width` and `height` are those of the frame. `range` and all after it are `nil` if the camera's field of view is not known.
  """

  @enforce_keys [:family, :id, :at_ms, :x, :y, :corners, :width, :height]
  defstruct @enforce_keys ++
              [range: nil, bearing: nil, yaw: nil, range_sd: nil, bearing_sd: nil, yaw_sd: nil]

  @type id :: non_neg_integer()
  @type family :: :tag36h11 | :tagStandard41h12 | :similar
  @type point :: {x :: float(), y :: float()}
  @type t :: %__MODULE__{
          family: family(),
          id: id(),
          at_ms: integer(),
          x: float(),
          y: float(),
          corners: [point(), ...],
          width: pos_integer(),
          height: pos_integer(),
          range: float() | nil,
          bearing: float() | nil,
          yaw: float() | nil,
          range_sd: float() | nil,
          bearing_sd: float() | nil,
          yaw_sd: float() | nil
        }

  @doc """
  The pixels that its border touches: the first and the last column and row inside the frame.

      iex> corners = [{10.2, 5.0}, {20.7, 5.5}, {20.5, 15.9}, {10.0, 15.0}]
      iex> mark = %Vision.Mark{family: :tag36h11, id: 1, at_ms: 0, x: 15.0, y: 10.0, corners: corners, width: 20, height: 20}
      iex> Vision.Mark.box(mark)
      {10, 5, 19, 16}
  """
  @spec box(t()) :: {left :: integer(), top :: integer(), right :: integer(), bottom :: integer()}
  def box(%__MODULE__{corners: corners, width: width, height: height}) do
    {{left, right}, {top, bottom}} = bounds(corners)

    {max(floor(left), 0), max(floor(top), 0), min(ceil(right), width - 1),
     min(ceil(bottom), height - 1)}
  end

  @doc """
  What people call it.

      iex> corners = List.duplicate({0.0, 0.0}, 4)
      iex> Vision.Mark.name(%Vision.Mark{family: :tag36h11, id: 7, at_ms: 0, x: 0.0, y: 0.0, corners: corners, width: 2, height: 2})
      "tag36h11 7"
  """
  @spec name(t()) :: String.t()
  def name(%__MODULE__{family: family, id: id}), do: "#{family} #{id}"

  @doc """
  How far a mark's code reaches to the right of its centre, in sides of its square: that of a self-similar mark stands beside the
  square.
  """
  @spec code_end(family()) :: float()
  def code_end(:similar), do: 1.5
  def code_end(_apriltag), do: 0.5

  @doc "The least and the greatest x, and the same of y."
  @spec bounds([point(), ...]) :: {{float(), float()}, {float(), float()}}
  def bounds(corners) do
    {xs, ys} = Enum.unzip(corners)
    {Enum.min_max(xs), Enum.min_max(ys)}
  end
end
