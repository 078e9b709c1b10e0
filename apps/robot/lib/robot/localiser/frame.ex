defmodule Robot.Localiser.Frame do
  @moduledoc false
  # Transforms a belief into the frame of another robot, whose own pose may be uncertain or drift.
  # Pure.
  alias Hal.Pose
  alias Robot.Localiser.{Anchors, Belief, Covariance}

  # Greater standard deviations mean that the pose is unknown, and the linear model would not
  # hold: metres, radians. Distances from the leader are limited to the last value (metres).
  @lost_position 5.0
  @lost_heading 1.0
  @far 100.0
  # The uncertainty of a robot that was started again on its way: of its position, in metres and
  # per metre from its start, and of its heading, in radians, to allow for the slip of whole
  # turns.
  @lost_sd 0.5
  @lost_share 0.4
  @lost_turn 0.6
  # The greatest turn of a leader between two of its reports that is taken into account, in
  # radians.
  @turned_at_once 100.0
  # The index of the leader's slip among the states of a belief, and the standard deviation of its
  # change in a radian turned.
  @leader_slip 6
  @slip_change 0.005
  # The index of the error that the places of all robots share.
  @common 7

  @doc "A localiser whose estimate has jumped: its frame is another one from now on, for all that stand by it."
  @spec renumber(localiser) :: localiser when localiser: map()
  def renumber(%{frame_no: nil} = localiser), do: localiser
  def renumber(%{frame_no: number} = localiser), do: %{localiser | frame_no: number + 1}

  @doc """
  The pose of a robot that comes into the frame of a leader at `at` whose own pose has these
  variances (m2, rad2). The frame is turned about the leader by the same unknown angle for all
  robots that come into it: if one is off to the left, all are, and none is an independent witness
  of the others' places. So a share of the turn is the error that all robots have in common
  (`Robot.Localiser.Anchors.common/3`).
  """
  @spec joined(Belief.t(), at :: Pose.point(), position :: float(), heading :: float()) ::
          Belief.t()
  def joined(belief, at, position, heading),
    do: reframe(belief, at, position, heading, Anchors.common_share())

  @doc """
  The same pose in the frame of a leader at `at` whose own pose has got these variances (m2, rad2)
  more: its frame may have moved, and turned about the leader.
  """
  @spec reframe(Belief.t(), at :: Pose.point(), position :: float(), heading :: float()) ::
          Belief.t()
  def reframe(belief, at, position, heading), do: reframe(belief, at, position, heading, 0.0)

  defp reframe(belief, at, position, heading, share) do
    position = min(position, @lost_position * @lost_position)
    heading = min(heading, @lost_heading * @lost_heading)
    [dx, dy, 1.0] = turn = swing(belief.pose, at)
    angle = share * :math.sqrt(heading)
    alone = (1 - share * share) * heading

    [a, b, c | rest] =
      Covariance.carry(belief.covariance, &swung(&1, @common, dx * angle, dy * angle, angle))

    rows =
      for {row, g} <- Enum.zip([a, b, c], turn) do
        {own, others} = Enum.split(row, 3)
        for({p, k} <- Enum.zip(own, turn), do: p + alone * g * k) ++ others
      end

    # The second-order term of the turn, because an arc is not a line; the mean is not moved, so
    # its error counts as variance.
    bend = 0.75 * heading * heading * (dx * dx + dy * dy)
    more = position + bend
    %{belief | covariance: Covariance.add(rows ++ rest, [more, more])}
  end

  @doc "The belief in the frame of another leader, whose slip has this standard deviation."
  @spec led(Belief.t(), slip_sd :: float()) :: Belief.t()
  def led(belief, sd),
    do: %{
      belief
      | leader_slip: 0.0,
        covariance: Covariance.replace(belief.covariance, @leader_slip, min(sd, @lost_heading))
    }

  @doc """
  The belief after the leader, at `at`, has turned by this sum of angles (radians), left and right
  alike: if the leader's slip is the same in each radian, all places that it reports are rotated
  about it by the same angle in the opposite direction.
  """
  @spec slipped(Belief.t(), at :: Pose.point(), turned :: float()) :: Belief.t()
  def slipped(belief, _at, turned) when turned <= 0.0, do: belief

  def slipped(belief, at, turned) do
    turned = min(turned, @turned_at_once)
    [gx, gy, 1.0] = swing(belief.pose, at)
    angle = -turned * belief.leader_slip
    pose = belief.pose
    pose = Pose.new(pose.x + gx * angle, pose.y + gy * angle, pose.heading + angle)
    slips = List.duplicate(0.0, @leader_slip) ++ [@slip_change * @slip_change * turned]

    covariance =
      belief.covariance
      |> Covariance.carry(&swung(&1, @leader_slip, -turned * gx, -turned * gy, -turned))
      |> Covariance.add(slips)

    %{belief | pose: pose, covariance: covariance}
  end

  # Adds multiples of the row of a state to those of the pose.
  defp swung([x, y, heading | rest], index, a, b, c) do
    row = Enum.at(rest, index - 3)
    [plus(x, a, row), plus(y, b, row), plus(heading, c, row) | rest]
  end

  defp plus([], _k, []), do: []
  defp plus([a | as], k, [b | bs]), do: [a + k * b | plus(as, k, bs)]

  # The derivatives of x, y and heading by an angle of rotation about a place.
  defp swing(pose, at) do
    {x, y} = near(pose, at)
    [y - pose.y, pose.x - x, 1.0]
  end

  # A greater distance would give no more information: the robot is lost anyway.
  defp near(pose, {x, y} = at) do
    distance = Pose.distance(pose, at)
    share = if distance > @far, do: @far / distance, else: 1.0
    {pose.x + share * (x - pose.x), pose.y + share * (y - pose.y)}
  end

  @doc "The same pose with the uncertainty of a robot that could be anywhere."
  @spec lost(Belief.t()) :: Belief.t()
  def lost(%Belief{} = belief) do
    position = @lost_position * @lost_position
    variances = [position, position, @lost_heading * @lost_heading]
    %{belief | covariance: Covariance.add(belief.covariance, variances)}
  end

  @doc """
  The same pose with the uncertainty of a robot that was started when its odometry had already
  counted `way` metres, in a straight line from its zero; the turns on this way are unknown.
  """
  @spec lost(Belief.t(), way :: float()) :: Belief.t()
  def lost(%Belief{} = belief, way) do
    position = :math.pow(min(@lost_sd + @lost_share * way, @lost_position), 2)
    variances = [position, position, @lost_turn * @lost_turn]
    %{belief | covariance: Covariance.add(belief.covariance, variances)}
  end
end
