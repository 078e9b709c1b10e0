defmodule Robot.Localiser.Anchors do
  @moduledoc """
  Holds the references by which the localiser corrects the pose, as a mission gives them: the frame, and
  the places of known objects. Pure data and functions on it.

  The frame is that of the leader, whose pose is not corrected: its own estimate defines the frame.
  Its uncertainty is therefore part of the uncertainty of every robot in its frame. A robot that
  joins the frame takes over the uncertainty of the leader's pose in the frame that the leader was
  in before (`base`), and from then on what the leader's odometry adds.

  `standing` is the colour of a standing object whose place is unknown (`Robot.Localiser.TurnCheck`). `walls?` tells whether the
  walls of a floor plan may correct the pose, too (`Robot.Localiser.Walls`), in a leader's frame only while that leader knows its own
  place by the plan: not that of a leader itself, because a correction of it would have to move them all. `told` is where
  another robot sees this one stand (metres, in the frame), with the standard deviation of that place, if this robot needs it.
  """
  alias Hal.Pose

  defstruct frame: nil, marks: [], standing: nil, walls?: true, told: nil

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

  @doc """
  The spread of a place with this covariance: the inverse of `covariance/1`.

      iex> Robot.Localiser.Anchors.spread({0.25, 0.0, 0.0625})
      {0.5, 0.25, 0.0}
  """
  @spec spread({xx :: float(), xy :: float(), yy :: float()}) :: spread()
  def spread({xx, xy, yy}) do
    half = (xx + yy) / 2
    root = :math.sqrt((xx - yy) * (xx - yy) / 4 + xy * xy)
    {root(half + root), root(half - root), :math.atan2(2 * xy, xx - yy) / 2}
  end

  @doc """
  The radius (metres) round a place within which the object is in 95 of 100 cases: 1.96 standard
  deviations if the error has one direction only, 2.45 if it is equal in all directions, and in
  between a fit to the table of circular errors.

      iex> Float.round(Robot.Localiser.Anchors.radius({0.03, 0.03, 0.0}), 3)
      0.073
  """
  @spec radius(spread()) :: float()
  def radius({worst, least, _direction}) do
    roundness = if worst > 0.0, do: least / worst, else: 1.0
    worst * (1.96 + 0.488 * :math.pow(roundness, 2.5))
  end

  # Rounding may make a variance of zero negative.
  defp root(variance), do: :math.sqrt(max(variance, 0.0))

  @common_share 0.8

  @doc """
  The share of a robot's standard deviation across the line from the leader that all robots have
  in common; its square is the coefficient of correlation of two robots' errors.
  """
  @spec common_share() :: float()
  def common_share, do: @common_share

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

  @doc """
  The spread of a place at `at`, with at least this standard deviation (radians) of its direction
  from the leader.

      iex> Robot.Localiser.Anchors.swung({0.1, 0.1, 0.0}, {-10.0, 0.0}, {0.0, 0.0}, 0.005)
      {0.1, 0.1, 0.0}
      iex> {worst, least, _} = Robot.Localiser.Anchors.swung({0.1, 0.1, 0.0}, {-10.0, 0.0}, {0.0, 0.0}, 0.02)
      iex> {Float.round(worst, 3), Float.round(least, 3)}
      {0.2, 0.1}
  """
  @spec swung(spread(), at :: Pose.point(), leader :: Pose.point(), sd :: float()) :: spread()
  def swung(spread, {x, y}, {leader_x, leader_y}, sd) do
    {dx, dy} = {leader_y - y, x - leader_x}
    square = dx * dx + dy * dy
    distance = :math.sqrt(square)

    more =
      if distance < @same_place,
        do: 0.0,
        else: sd * sd * square - variance(spread, {dx / distance, dy / distance})

    if more <= 0.0 do
      spread
    else
      {xx, xy, yy} = covariance(spread)
      k = more / square
      spread({xx + k * dx * dx, xy + k * dx * dy, yy + k * dy * dy})
    end
  end

  # What one robot knows of the direction of the column may be better than what another does by
  # this factor. Nearer than this to the leader (metres), the direction of a place is mostly that
  # of its own small errors.
  @direction_share 0.5
  @near 1.5
  # A robot that is vaguer than this (metres) shows no direction.
  @lost 2.0

  @doc """
  The standard deviation (radians) that the direction from the leader has at least for a robot that
  finds its place by these references; zero if there are none. If they are turned about the
  leader, it is, too: it may know that turn better than they do, but not by any factor.

      iex> mark = &%{kind: :robot, reference?: true, at: {&1, 0.0}, sd: {&2, 0.01, 1.5707963267948966}}
      iex> marks = [mark.(-1.0, 0.05), mark.(-2.0, 0.06), mark.(-5.0, 0.1)]
      iex> anchors = %Robot.Localiser.Anchors{frame: %{at: {0.0, 0.0}}, marks: marks}
      iex> Float.round(Robot.Localiser.Anchors.direction_sd(anchors), 3)
      0.015
      iex> lost = %{anchors | marks: [mark.(-4.0, 5.0) | marks]}
      iex> Float.round(Robot.Localiser.Anchors.direction_sd(lost), 3)
      0.015
  """
  @spec direction_sd(t()) :: float()
  def direction_sd(%__MODULE__{frame: nil}), do: 0.0

  def direction_sd(%__MODULE__{frame: %{at: {x, y} = leader}, marks: marks}) do
    sds =
      for %{kind: :robot, reference?: true, at: {mx, my} = at, sd: {worst, _, _} = spread} <-
            marks,
          worst < @lost,
          distance = Pose.distance(at, leader),
          distance > @near do
        root(variance(spread, {(y - my) / distance, (mx - x) / distance})) / distance
      end

    @direction_share * Enum.max(sds, fn -> 0.0 end)
  end

  @typedoc """
  `standing` is the colour of the one object that a robot in its own frame may take for standing
  still at an unknown place (`Robot.Localiser.TurnCheck`).
  """
  @type t :: %__MODULE__{
          frame: frame() | nil,
          marks: [mark()],
          standing: String.t() | nil,
          walls?: boolean(),
          told: %{at: Pose.point(), sd: float()} | nil
        }
end
