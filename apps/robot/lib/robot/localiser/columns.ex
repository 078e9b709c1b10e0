defmodule Robot.Localiser.Columns do
  @moduledoc false
  # Reckons with sets of columns of a camera picture, which is divided into 59 columns of equal width. Pure.
  #
  # A set is an integer, one bit for each column; bit 0 is the leftmost.
  # A robot that is unsure tries thousands of spans a tick. Up to OTP 25, `max` and `min` are calls; comparisons are not.
  import Bitwise
  alias Hal.Pose
  alias Robot.Percept
  alias Robot.Percept.Sighting
  alias Vision.Blob

  # A non-negative small integer of a 64-bit virtual machine has this many bits.
  @columns 59
  # Directions farther than this (radians) from the camera's axis count as outside the picture.
  @aside 1.3

  @type t :: non_neg_integer()

  @typedoc "The camera's direction (radians, from the robot's heading), and its focal length in columns."
  @type camera :: {pan :: float(), focal :: float()}

  @doc "The camera with which the percept's picture was taken."
  @spec camera(Percept.t()) :: camera()
  def camera(%Percept{} = percept) do
    view = Sighting.field_of_view(percept)
    {percept.detections.pan, @columns / 2 / :math.tan(view / 2)}
  end

  @doc """
  The columns that a disc fills whose middle is in direction `bearing` (radians, from the robot's
  heading) and whose apparent width is twice `half` (radians).

      iex> picture = %Vision.Detections{at_ms: 0, blobs: []}
      iex> percept = %Robot.Percept{profile: Hal.Profile.magellan(), at_ms: 0, detections: picture}
      iex> camera = Robot.Localiser.Columns.camera(percept)
      iex> Robot.Localiser.Columns.count(Robot.Localiser.Columns.span(0.0, 0.1, camera))
      11
  """
  @spec span(bearing :: float(), half :: float(), camera()) :: t()
  def span(bearing, half, {pan, focal}) do
    bearing = Pose.wrap(bearing - pan)

    if abs(bearing) - half > @aside,
      do: 0,
      else: project(bearing + half, bearing - half, focal)
  end

  # The left border has the greater bearing.
  defp project(left, right, focal) do
    left = if left < @aside, do: left, else: @aside
    right = if right > -@aside, do: right, else: -@aside
    left = round(@columns / 2 - focal * :math.tan(left))
    between(left, round(@columns / 2 - focal * :math.tan(right)) - 1)
  end

  @doc "The columns that the blobs of these colours fill."
  @spec seen([Blob.t()], colours :: [String.t()]) :: t()
  def seen(blobs, colours) do
    for blob <- blobs, blob.colour in colours, reduce: 0 do
      set -> set ||| blob(blob)
    end
  end

  defp blob(%{left: left, right: right, width: width}),
    do: between(round(left * @columns / width), round((right + 1) * @columns / width) - 1)

  defp between(left, right) do
    left = if left < 0, do: 0, else: left
    right = if right > @columns - 1, do: @columns - 1, else: right
    if right < left, do: 0, else: (1 <<< (right + 1)) - (1 <<< left)
  end

  @doc "The columns of either set."
  @spec union(t(), t()) :: t()
  def union(a, b), do: a ||| b

  @doc "The columns of the first set that are not in the second."
  @spec without(t(), t()) :: t()
  def without(a, b), do: a &&& bnot(b)

  @doc "The columns that are in exactly one of the two sets."
  @spec difference(t(), t()) :: t()
  def difference(a, b), do: bxor(a, b)

  @doc "Whether two sets have no column in common."
  @spec disjoint?(t(), t()) :: boolean()
  def disjoint?(a, b), do: (a &&& b) == 0

  @doc "Whether a set has no column."
  @spec empty?(t()) :: boolean()
  def empty?(set), do: set == 0

  @doc "How many columns a set has."
  @spec count(t()) :: non_neg_integer()
  # By twos, fours, eights and so on, in small integers throughout.
  def count(set) do
    set = set - (set >>> 1 &&& 0x555555555555555)
    set = (set &&& 0x333333333333333) + (set >>> 2 &&& 0x333333333333333)
    set = set + (set >>> 4) &&& 0xF0F0F0F0F0F0F0F
    set = set + (set >>> 8)
    set = set + (set >>> 16)
    set + (set >>> 32) &&& 0x7F
  end
end
