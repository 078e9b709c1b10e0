defmodule Robot.Localiser.Anchors do
  @moduledoc """
  What a mission tells the localiser to correct the pose by: the frame, and the places of known
  objects. Pure data.

  The frame is that of a robot that nobody corrects, the leader: what it believes of its own pose is so by definition,
  and what it is unsure of, all others are unsure of: when they come into its frame, of its pose in the one that it was in
  before it led (`base`), and from then on, of what its odometry adds.
  """
  alias Hal.Pose

  defstruct frame: nil, marks: []

  # Nothing is known better than to a millimetre, and nothing nearer than a centimetre is beside another; in metres.
  @least_sd 0.001
  @same_place 0.01

  @typedoc """
  `key` tells one frame from another, `base` is the key of the one that its variances (`position`, `heading`: m2, rad2) are in,
  `nil` for that of the start poses; `start` are the variances in the latter. `at` is where its robot believes itself to be. `drift` is
  by what its odometry has drifted since it was started: variances of way and turn, and all angles turned (radians); `slip`
  (a standard deviation) how well it knows what slips in each of them alike.
  """
  @type frame :: %{
          key: term(),
          base: term(),
          at: Pose.point(),
          position: float(),
          heading: float(),
          start: {position :: float(), heading :: float()},
          drift: {way :: float(), turn :: float(), turned :: float()},
          slip: float()
        }

  @typedoc """
  Standard deviations of a place, in metres: in the direction (radians, in the frame) in which it is known worst, and
  across.
  """
  @type spread :: {worst :: float(), least :: float(), direction :: float()}

  @typedoc """
  Something of a colour at a place (metres, in the frame), and how well that is known. One that is no `reference?` may be
  seen and taken for another, but nothing is measured by it. A `:landmark` is the only thing of
  its colour; of robots there are many, and only a blob as wide as a cylinder of the `radius` (metres) is one.
  `common` is the part of its error that all robots have alike (`common/3`).
  """
  @type mark :: %{
          key: term(),
          kind: :landmark | :robot,
          colour: String.t(),
          at: Pose.point(),
          sd: spread(),
          common: Pose.point(),
          reference?: boolean(),
          radius: float()
        }

  @doc """
  The variance of a place in the direction of a unit vector, in m2.

      iex> Robot.Localiser.Anchors.variance({0.2, 0.1, 0.0}, {0.0, 1.0})
      0.010000000000000002
  """
  @spec variance(spread(), {float(), float()}) :: float()
  def variance({worst, least, direction}, {x, y}) do
    along = x * :math.cos(direction) + y * :math.sin(direction)
    across = y * :math.cos(direction) - x * :math.sin(direction)
    worst * worst * along * along + least * least * across * across
  end

  @doc """
  Its covariance: variances of x and y, and between them that of both.

      iex> Robot.Localiser.Anchors.covariance({0.5, 0.25, 0.0})
      {0.25, 0.0, 0.0625}
  """
  @spec covariance(spread()) :: {xx :: float(), xy :: float(), yy :: float()}
  def covariance({worst, least, direction}) do
    {c, s} = {:math.cos(direction), :math.sin(direction)}
    {w, l} = {worst * worst, least * least}
    {w * c * c + l * s * s, (w - l) * c * s, w * s * s + l * c * c}
  end

  # The coefficient of correlation of two robots' errors across is the square of it.
  @common_share 0.8

  @doc """
  The part of a robot's error that the robots ahead have in common with it, one standard deviation of it as a vector
  (metres). All of them hang from the leader at `leader`: where one is turned about it, those that found their places by
  it are turned with it. So it points across the line from the leader; what is at the leader's place has none.

      iex> Robot.Localiser.Anchors.common({0.1, 0.1, 0.0}, {-5.0, 0.0}, {0.0, 0.0})
      {0.0, -0.08}
      iex> Robot.Localiser.Anchors.common({0.1, 0.1, 0.0}, {0.0, 0.0}, {0.0, 0.0})
      {0.0, 0.0}
  """
  @spec common(spread(), at :: Pose.point(), leader :: Pose.point()) :: Pose.point()
  def common(spread, {x, y} = at, {leader_x, leader_y} = leader) do
    distance = Pose.distance(at, leader)

    if distance < @same_place,
      do: {0.0, 0.0},
      else: common(spread, {(leader_y - y) / distance, (x - leader_x) / distance})
  end

  defp common({worst, least, direction}, {ux, uy}) do
    along = (ux * :math.cos(direction) + uy * :math.sin(direction)) / max(worst, @least_sd)
    across = (uy * :math.cos(direction) - ux * :math.sin(direction)) / max(least, @least_sd)

    # The longest vector in this direction that the ellipse holds: what is left of it is a covariance, too.
    size = @common_share / :math.sqrt(along * along + across * across)
    {ux * size, uy * size}
  end

  @type t :: %__MODULE__{frame: frame() | nil, marks: [mark()]}
end
