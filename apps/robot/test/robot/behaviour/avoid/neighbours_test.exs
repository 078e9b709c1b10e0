defmodule Robot.Behaviour.Avoid.NeighboursTest do
  use ExUnit.Case, async: true
  alias Hal.{Odometry, Pose, Profile, Twist}
  alias Robot.Behaviour.Avoid.Neighbours
  alias Robot.Percept

  @profile Profile.magellan()

  # A robot that is told to stand there, told by one that knows its place to `radius` metres and hears `echoes` (by sonar).
  defp robots(at, radius, echoes) do
    ranges = for k <- 0..15, do: Map.get(echoes, k, @profile.sonar_max)
    peer = %{pose: at, twist: Twist.zero(), radius: 0.2, mode: :parked, at_ms: 0}

    %Percept{
      robot: :mag1,
      at_ms: 0,
      profile: @profile,
      pose: Pose.new(0, 0),
      odometry: %Odometry{pose: Pose.new(0, 0), twist: Twist.zero()},
      uncertainty: %{radius: radius},
      sonar: ranges,
      peers: %{mag2: peer}
    }
    |> Neighbours.robots()
    |> Enum.map(& &1.id)
  end

  # What each sonar hears of a round body there, whose echo comes back along the line to its middle.
  defp heard(at) do
    for {mount, k} <- Enum.with_index(@profile.sonars),
        abs(Pose.bearing(mount, at)) < @profile.sonar_cone / 2,
        into: %{},
        do: {k, Pose.distance(mount, at) - 0.2}
  end

  defp place(degrees, away) do
    {x, y} = Pose.place(Pose.new(0, 0, degrees / 180 * :math.pi()), {away, 0.0})
    Pose.new(x, y)
  end

  test "a robot that is told where two sonars hear nothing is left out by one that does not know its place" do
    left_out =
      for degrees <- 0..355//5,
          at = place(degrees, 1.2),
          robots(at, 1.5, %{}) == [],
          do: {degrees, map_size(heard(at))}

    assert length(left_out) > 10
    assert Enum.all?(left_out, fn {_degrees, sonars} -> sonars >= 2 end)
    for degrees <- 0..355//5, do: assert(robots(place(degrees, 1.2), 0.5, %{}) == [:mag2])
  end

  test "one that is there is never left out, though any one sonar fails or misses it" do
    for degrees <- 0..355//5, away <- [0.5, 0.8, 1.2, 1.6, 1.9], broken <- 0..15 do
      at = place(degrees, away)
      assert robots(at, 1.5, Map.delete(heard(at), broken)) == [:mag2]
    end
  end
end
