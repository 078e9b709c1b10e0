defmodule Robot.Localiser.Anchors do
  @moduledoc """
  The references by which the localiser corrects the pose, as a mission gives them: the frame, and
  the places of known objects. Pure data and functions on it.

  The frame is that of the leader, whose pose nobody corrects: its own estimate defines the frame.
  Its uncertainty is therefore part of the uncertainty of every robot in its frame. A robot that
  joins the frame takes over the uncertainty of the leader's pose in the frame that the leader was
  in before (`base`), and from then on what the leader's odometry adds.
  """
  alias Hal.Pose

  defstruct frame: nil, marks: [], standing: nil

  # Standard deviations count as at least this much, and places nearer to each other than this as
  # the same; in metres.
  @least_sd 0.001
  @same_place 0.01

  @typedoc """
  The frame of a leader. `key` identifies it. `position` and `heading` are the variances (m2,
  rad2) of the leader's pose in the frame whose key is `base` (`nil`: the frame of the start
  poses), `start` those in the frame of the start poses. `at` is the leader's estimate of its own
  place. `drift` is what its odometry has added since its start: the variances of way and turn
  (m2, rad2), and the sum of all angles turned (radians). `slip` is the standard deviation of the
  leader's slip, which is the same in each radian turned.
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
  Standard deviations of a place, in metres: along the direction (radians, in the frame) of its
  greatest uncertainty, and across it.
  """
  @type spread :: {worst :: float(), least :: float(), direction :: float()}

  @typedoc """
  An object of a colour at a place (metres, in the frame), and the uncertainty of that place. A
  mark that is not a `reference?` may be seen and mistaken for another one, but is not used for
  measurements. A `:landmark` is taken to be the only object of its colour. There may be many
  robots; a blob can be one of them if it is about as wide as a cylinder of this `radius`
  (metres). `common` is the part of the place's error that all robots share (`common/3`).
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
  The covariance of a place: the variance of x, the covariance of x and y, the variance of y.

      iex> Robot.Localiser.Anchors.covariance({0.5, 0.25, 0.0})
      {0.25, 0.0, 0.0625}
  """
  @spec covariance(spread()) :: {xx :: float(), xy :: float(), yy :: float()}
  def covariance({worst, least, direction}) do
    {c, s} = {:math.cos(direction), :math.sin(direction)}
    {w, l} = {worst * worst, least * least}
    {w * c * c + l * s * s, (w - l) * c * s, w * s * s + l * c * c}
  end

  # The square of this is the coefficient of correlation between the errors of two robots across
  # the line from the leader.
  @common_share 0.8

  @doc """
  The part of a robot's position error that the robots ahead share, as a vector of one standard
  deviation (metres). The poses of all of them derive from the leader at `leader`: if one is
  rotated about the leader, those that found their places by it are rotated too. So the vector
  points across the line from the leader; a robot at the leader's place has none.

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

    # A share of the longest vector in this direction within the ellipse, so that the remainder is
    # still a covariance.
    size = @common_share / :math.sqrt(along * along + across * across)
    {ux * size, uy * size}
  end

  @typedoc """
  `standing` is the colour of the one object that a robot in its own frame may take for standing
  still at a place that nobody knows (`Robot.Localiser.TurnCheck`).
  """
  @type t :: %__MODULE__{
          frame: frame() | nil,
          marks: [mark()],
          standing: String.t() | nil
        }
end
