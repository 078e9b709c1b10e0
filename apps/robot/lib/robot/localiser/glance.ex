defmodule Robot.Localiser.Glance do
  @moduledoc """
  Decides whether a robot can concern a picture at all, by a bound that costs little. Pure.

  In a large fleet most robots stand beside the picture or behind the camera. What a picture says of one depends on its
  direction and on how uncertain that is, whose exact value takes two products with a covariance matrix. The bound takes
  the greatest standard deviations of both places instead (Cauchy and Schwarz), so that no robot is passed over that the
  exact value would let through.
  """
  alias Hal.Pose
  alias Robot.Localiser.{Anchors, Belief}

  @enforce_keys [:pose, :pan, :side, :worst, :heading]
  defstruct @enforce_keys

  @typedoc """
  The pose at exposure, the camera's direction and half its field of view (radians), and the greatest standard deviations
  of the position (metres) and of the heading (radians).
  """
  @type t :: %__MODULE__{
          pose: Pose.t(),
          pan: float(),
          side: float(),
          worst: float(),
          heading: float()
        }

  # For rounding, and for the breadth of a column (radians).
  @spare 0.05
  # Nearer than this (metres), a direction is no more uncertain than here (`Robot.Localiser.Matching`).
  @near 0.3

  @doc "The glance at a picture that was taken at the pose `exposed`."
  @spec new(Belief.t(), exposed :: Pose.t(), pan :: float(), field_of_view :: float()) :: t()
  def new(belief, exposed, pan, view) do
    {worst, _least, heading} = Belief.sd(belief)
    %__MODULE__{pose: exposed, pan: pan, side: view / 2, worst: worst, heading: heading}
  end

  @doc "How far a place is beside the picture (radians), zero or less within it."
  @spec aside(t(), Pose.point()) :: float()
  def aside(%__MODULE__{pose: pose, pan: pan, side: side}, at),
    do: abs(Pose.wrap(Pose.bearing(pose, at) - pan)) - side - @spare

  @doc "At least the standard deviation of the direction (radians) of a mark at this distance (metres)."
  @spec most_sd(t(), Anchors.mark(), distance :: float()) :: float()
  def most_sd(%__MODULE__{worst: worst, heading: heading}, %{sd: {sd, _, _}} = mark, distance) do
    {x, y} = mark.common
    distance = if distance > @near, do: distance, else: @near
    (worst + sd + :math.sqrt(x * x + y * y)) / distance + heading
  end
end
