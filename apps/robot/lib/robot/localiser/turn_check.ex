defmodule Robot.Localiser.TurnCheck do
  @moduledoc """
  Measures the slip of a robot's wheels by an object that stands still at an unknown place: while
  the robot turns on the spot, the object crosses the picture, and its bearing changes by as much
  as the robot has truly turned. Pure.

  Two pictures make one measurement of the belief's slip. Because the slip correlates with the
  heading, the correction also takes back what earlier turns have made wrong. The measurement is
  taken when the robot stands or the object leaves the picture, so that its base is as long as
  the turn allows, and at the latest after 0.5 rad.
  """
  alias Hal.Pose
  alias Robot.Localiser.Belief
  alias Robot.Percept
  alias Robot.Percept.Sighting

  # A turn of less than this (radians) says too little, and one of this much is enough.
  @least_turn 0.12
  @whole_turn 0.5
  # A robot that moves farther than this (metres) sees the object from another place.
  @same_place 0.02
  # A robot that turns less than this (radians) between two pictures stands.
  @stands 0.005
  # Pictures farther apart than this (milliseconds) may show an object that was moved.
  @gap_ms 500
  # The standard deviation of a bearing's change, in radians.
  @bearing_sd 0.005

  @typedoc """
  A picture that shows the object: its time, the odometry's pose when it was taken, the sum of all
  angles turned until then, and the bearing of the object.
  """
  @type look :: %{at_ms: integer(), pose: Pose.t(), turned: float(), bearing: float()}
  @typedoc "The first and the last picture of the object since the last measurement."
  @type t :: nil | {look(), look()}

  @doc """
  The check and the belief after one picture. `back` is the odometry's pose at exposure, relative
  to `odometry`, the present one; `colour` is that of the object, `nil` without one.
  """
  @spec see(
          t(),
          Belief.t(),
          Percept.t(),
          String.t() | nil,
          odometry :: Pose.t(),
          back :: Pose.t()
        ) ::
          {t(), Belief.t()}
  def see(_check, belief, _percept, nil, _odometry, _back), do: {nil, belief}

  def see(check, belief, percept, colour, odometry, back) do
    case look(belief, percept, colour, odometry, back) do
      nil -> {nil, measure(belief, check)}
      look -> go_on(check, look, belief)
    end
  end

  defp go_on(nil, look, belief), do: {{look, look}, belief}

  defp go_on({first, last} = check, look, belief) do
    cond do
      look.at_ms - last.at_ms > @gap_ms ->
        {{look, look}, measure(belief, check)}

      Pose.distance(first.pose, look.pose) > @same_place ->
        {{look, look}, measure(belief, check)}

      look.turned - first.turned >= @whole_turn or look.turned - last.turned < @stands ->
        {restart({first, look}), measure(belief, {first, look})}

      true ->
        {{first, look}, belief}
    end
  end

  # A robot that stands waits with its first picture until it has turned enough.
  defp restart({first, look}),
    do: if(look.turned - first.turned >= @least_turn, do: {look, look}, else: {first, look})

  defp measure(belief, nil), do: belief

  defp measure(belief, {first, last}) do
    turned = last.turned - first.turned

    if turned >= @least_turn do
      counted = Pose.wrap(last.pose.heading - first.pose.heading)
      seen = Pose.wrap(first.bearing - last.bearing)
      Belief.turned(belief, Pose.wrap(seen - counted), turned, @bearing_sd * @bearing_sd)
    else
      belief
    end
  end

  # There is only one object of the colour: the largest blob is taken for it. One that the left or
  # right border cuts off has its centre elsewhere; top and bottom do not matter.
  defp look(belief, percept, colour, odometry, back) do
    with %{} = blob <- Sighting.largest(percept, colour),
         true <- blob.left > 0 and blob.right < blob.width - 1 do
      {_way, _turn, turned} = belief.drift

      %{
        at_ms: percept.detections.at_ms,
        pose: Pose.compose(odometry, back),
        turned: turned - abs(back.heading),
        bearing: Sighting.bearing(blob, percept.detections.pan, Sighting.field_of_view(percept))
      }
    else
      _nothing_whole -> nil
    end
  end
end
