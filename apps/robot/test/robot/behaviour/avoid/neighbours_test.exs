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

  # What each sonar hears of a body there.
  defp heard(at) do
    for {mount, k} <- Enum.with_index(@profile.sonars),
        distance = Pose.distance(mount, at),
        abs(Pose.bearing(mount, at)) < @profile.sonar_cone / 2 + :math.asin(0.2 / distance),
        into: %{},
        do: {k, distance - 0.2}
  end

  test "a robot that is told where two sonars hear nothing is left out by one that does not know its place" do
    for degrees <- 0..355//5 do
      at = Pose.place(Pose.new(0, 0, degrees / 180 * :math.pi()), {0.6, 0.0})
      at = Pose.new(elem(at, 0), elem(at, 1))
      assert robots(at, 1.5, %{}) == []
      assert robots(at, 0.5, %{}) == [:mag2]
    end
  end

  test "one that is there is never left out, though any one sonar fails or misses it" do
    for degrees <- 0..355//5, away <- [0.5, 0.8, 1.2, 1.6, 1.9], broken <- 0..15 do
      {x, y} = Pose.place(Pose.new(0, 0, degrees / 180 * :math.pi()), {away, 0.0})
      at = Pose.new(x, y)
      assert robots(at, 1.5, Map.delete(heard(at), broken)) == [:mag2]
    end
  end
end
