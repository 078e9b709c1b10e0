defmodule Robot.Localiser.Frame do
  @moduledoc """
  Transforms a belief into another robot's frame, whose own pose may be uncertain or drifting.
  Pure.
  """
  alias Hal.Pose
  alias Robot.Localiser.{Belief, Covariance}

  # Beyond these nobody knows anything, and linear algebra less: metres, radians.
  @lost_position 5.0
  @lost_heading 1.0
  @far 100.0
  # Where one is that nobody saw go, in metres and per metre, and how it is turned: by what slips in a whole turn.
  @lost_sd 0.5
  @lost_share 0.4
  @lost_turn 0.6
  # A leader that is said to have turned by more since it was last heard, in radians.
  @turned_at_once 100.0
  # The state of a belief that is its leader's slip, and how much that changes in a radian turned.
  @leader_slip 6
  @slip_change 0.005

  @doc """
  The same pose in the frame of somebody at `at` who is sure of its own pose by these variances only (m2, rad2):
  its frame may have moved, and turned about it.
  """
  @spec reframe(
          Belief.t(),
          at :: Pose.point(),
          position :: float(),
          heading :: float()
        ) :: Belief.t()
  def reframe(belief, at, position, heading) do
    position = min(position, @lost_position * @lost_position)
    heading = min(heading, @lost_heading * @lost_heading)
    turn = swing(belief.pose, at)
    [a, b, c | rest] = belief.covariance

    rows =
      for {row, g} <- Enum.zip([a, b, c], turn) do
        {own, others} = Enum.split(row, 3)
        for({p, k} <- Enum.zip(own, turn), do: p + heading * g * k) ++ others
      end

    # An arc is no line: by how much it bends is unsure, too (second order of the turn; a mean that is left
    # where it was counts as variance).
    {dx, dy, 1.0} = List.to_tuple(turn)
    bend = 0.75 * heading * heading * (dx * dx + dy * dy)
    more = position + bend
    %{belief | covariance: Covariance.add(rows ++ rest, [more, more])}
  end

  @doc "In the frame of another leader, whose slip is known by this standard deviation."
  @spec led(Belief.t(), slip_sd :: float()) :: Belief.t()
  def led(belief, sd),
    do: %{
      belief
      | leader_slip: 0.0,
        covariance: Covariance.replace(belief.covariance, @leader_slip, min(sd, @lost_heading))
    }

  @doc """
  After the leader, at `at`, has turned by so many radians, to whichever side: where it slips in each of them alike, all
  that it tells is turned about it by as much the other way.
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
      |> Covariance.carry(&swung(&1, -turned * gx, -turned * gy, -turned))
      |> Covariance.add(slips)

    %{belief | pose: pose, covariance: covariance}
  end

  defp swung([x, y, heading | rest], a, b, c) do
    slip = Enum.at(rest, @leader_slip - 3)
    [plus(x, a, slip), plus(y, b, slip), plus(heading, c, slip) | rest]
  end

  defp plus([], _k, []), do: []
  defp plus([a | as], k, [b | bs]), do: [a + k * b | plus(as, k, bs)]

  # How x, y and heading change with an angle about somebody there.
  defp swing(pose, at) do
    {x, y} = near(pose, at)
    [y - pose.y, pose.x - x, 1.0]
  end

  # What turns about somebody so far away is lost anyway.
  defp near(pose, {x, y} = at) do
    distance = Pose.distance(pose, at)
    share = if distance > @far, do: @far / distance, else: 1.0
    {pose.x + share * (x - pose.x), pose.y + share * (y - pose.y)}
  end

  @doc """
  The same pose, of a robot that was started when its odometry had counted already: so many metres as the crow flies, in
  how many turns nobody knows.
  """
  @spec lost(Belief.t(), way :: float()) :: Belief.t()
  def lost(%Belief{} = belief, way) do
    position = :math.pow(min(@lost_sd + @lost_share * way, @lost_position), 2)
    variances = [position, position, @lost_turn * @lost_turn]
    %{belief | covariance: Covariance.add(belief.covariance, variances)}
  end
end
