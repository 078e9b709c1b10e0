defmodule Missions.Chase.Ring do
  @moduledoc """
  Places the robots that do not drive the ball round it, out of the way of ball and driver. Pure; metres in the map frame.

  Half of them stand on each side of the line from the ball to the goal, at equal angles, between 45 and 135 degrees from it unless another arc
  is given. Where a
  wall leaves no room, a place is nearer to the ball, or on the robot's own side of it. The robots take the places at the least sum of the squares of their ways
  (`Swarm.Formation.Assignment`).
  """
  alias Hal.Pose
  alias Nav.Reach
  alias Swarm.Formation.Assignment

  @arc {:math.pi() / 4, 3 * :math.pi() / 4}
  @shares [1.0, 0.85, 0.7]
  # Off where the robot is, seen from the ball.
  @beside [0, 1, -1, 2, -2, 3, -3] |> Enum.map(&(&1 * :math.pi() / 6))

  @typedoc "Between these angles from the line to the goal, in radians."
  @type arc :: {from :: float(), to :: float()}

  @doc "The places of so many robots round the ball."
  @spec places(non_neg_integer(), Pose.point(), Pose.point(), float(), arc()) :: [Pose.point()]
  def places(count, ball, goal, radius, {from, to} \\ @arc) do
    direction = Missions.Chase.Push.direction(ball, goal)
    left = div(count + 1, 2)

    for {side, n} <- [{1, left}, {-1, count - left}],
        k <- 1..n//1,
        do: at(ball, radius, direction + side * (from + (k - 0.5) / n * (to - from)))
  end

  @doc """
  The place of robot `me` among these robots, by where they are; `nil` if it has no room there.

      iex> robots = %{a: {0.0, -3.0}, b: {0.0, 3.0}}
      iex> {_x, y} = Missions.Chase.Ring.place(:b, robots, {0.0, 0.0}, {5.0, 0.0}, 2.0, nil, 0.2)
      iex> Float.round(y, 3)
      2.0
  """
  @spec place(
          atom(),
          %{atom() => Pose.point()},
          Pose.point(),
          Pose.point(),
          float(),
          Nav.Grid.t() | nil,
          float(),
          arc()
        ) ::
          Pose.point() | nil
  def place(me, robots, ball, goal, ring, grid, radius, arc \\ @arc) do
    places = places(map_size(robots), ball, goal, ring, arc)
    robots = Enum.sort(robots)

    rows =
      for {_id, at} <- robots,
          do: for(place <- places, do: round(100 * :math.pow(Pose.distance(at, place), 2)))

    mine = Enum.find_index(robots, fn {id, _at} -> id == me end)
    place = Enum.at(places, Enum.at(Assignment.match(rows), mine))

    nearer = for share <- @shares, do: between(ball, place, share)
    own = Missions.Chase.Push.direction(ball, robots |> List.keyfind!(me, 0) |> elem(1))

    Enum.find(
      nearer ++ Enum.map(@beside, &at(ball, ring, own + &1)),
      &(Reach.place(grid, &1, radius) == :ok)
    )
  end

  defp at({x, y}, radius, angle),
    do: {x + radius * :math.cos(angle), y + radius * :math.sin(angle)}

  defp between({ax, ay}, {bx, by}, share), do: {ax + share * (bx - ax), ay + share * (by - ay)}
end
