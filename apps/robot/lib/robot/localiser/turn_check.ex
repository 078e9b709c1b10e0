defmodule Robot.Localiser.TurnCheck do
  @moduledoc """
  Measures the slip of a robot's wheels by an object that stands still at an unknown place: while
  the robot turns on the spot, the object crosses the picture, and its bearing changes by as much
  as the robot has truly turned. Pure.

  The picture in which the object appeared and one after the turn make one measurement of the
  belief's slip. Because the slip correlates with the heading, the correction also takes back what
  earlier turns have made wrong.

  An object that moves would be taken for slip. So the measurement counts only once the robot has
  stood for 0.8 s and has seen that the object stands, too. If the object moved before, and stopped
  together with the robot, the measurement is wrong; the belief's gate refuses it if that was by
  much.
  """
  alias Hal.Pose
  alias Robot.Localiser.Belief
  alias Robot.Percept
  alias Robot.Percept.Sighting

  # A turn of less than this (radians) says too little.
  @least_turn 0.12
  # A robot that moves farther than this (metres) sees the object from another place.
  @same_place 0.02
  # A robot that turns less than this (radians) between two pictures stands; an object whose
  # direction changes less than this (radians) in so many milliseconds stands, too.
  @standing 0.005
  @still 0.01
  @still_ms 800
  # Pictures farther apart than this (milliseconds) may show another object.
  @gap_ms 500
  # The standard deviation of the difference of two bearings: in radians (in painted pictures of 320
  # columns it is 0.002), and as a share of the difference, because a camera's field of view is known
  # to some two per cent only.
  @bearing_sd 0.005
  @lens_share 0.02

  @typedoc """
  A picture that shows the object: its time, the pose by odometry at that time, the sum of all
  angles turned until then, and the bearing of the object (radians).
  """
  @type look :: %{at_ms: integer(), pose: Pose.t(), turned: float(), bearing: float()}
  @typedoc "The first and the last picture of the object, and the first since the robot stands."
  @type t :: %{first: look(), last: look(), stood: look() | nil} | nil

  @doc """
  The check and the belief after one picture. `colour` is that of the object, `nil` without one;
  `odometry` is the present pose by odometry, and `back` the one at exposure, relative to it.
  """
  @spec see(t(), Belief.t(), Percept.t(), colour :: String.t() | nil, Pose.t(), back :: Pose.t()) ::
          {t(), Belief.t()}
  def see(_check, belief, _percept, nil, _odometry, _back), do: {nil, belief}

  def see(check, belief, percept, colour, odometry, back) do
    case look(belief, percept, colour, odometry, back) do
      nil -> {nil, belief}
      look -> see(check, belief, look)
    end
  end

  defp see(nil, belief, look), do: {begin(look), belief}

  defp see(%{first: first, last: last, stood: stood} = check, belief, look) do
    cond do
      look.at_ms - last.at_ms > @gap_ms or Pose.distance(first.pose, look.pose) > @same_place ->
        {begin(look), belief}

      look.turned - last.turned >= @standing ->
        {%{check | last: look, stood: nil}, belief}

      stood == nil ->
        {%{check | last: look, stood: look}, belief}

      abs(unexplained(stood, look)) > @still ->
        {begin(look), belief}

      look.at_ms - stood.at_ms >= @still_ms ->
        {begin(look), measure(belief, first, look)}

      true ->
        {%{check | last: look}, belief}
    end
  end

  defp begin(look), do: %{first: look, last: look, stood: nil}

  defp measure(belief, first, last) do
    turned = last.turned - first.turned
    lens = @lens_share * Pose.wrap(last.bearing - first.bearing)
    noise = @bearing_sd * @bearing_sd + lens * lens

    if turned >= @least_turn,
      do: Belief.turned(belief, unexplained(first, last), turned, noise),
      else: belief
  end

  # How much farther left the robot has turned between two pictures than odometry says.
  defp unexplained(first, last) do
    counted = Pose.wrap(last.pose.heading - first.pose.heading)
    Pose.wrap(first.bearing - last.bearing - counted)
  end

  # There is only one object of the colour: the largest blob is taken for it. One that the left or
  # the right border cuts off has its centre elsewhere; top and bottom do not matter.
  defp look(belief, percept, colour, odometry, back) do
    with %{blob: blob, bearing: bearing} <- Sighting.largest(percept, colour),
         true <- blob.left > 0 and blob.right < blob.width - 1 do
      {_way, _turn, turned} = belief.drift

      %{
        at_ms: percept.detections.at_ms,
        pose: Pose.compose(odometry, back),
        turned: turned - abs(back.heading),
        bearing: bearing
      }
    else
      _not_whole -> nil
    end
  end
end
