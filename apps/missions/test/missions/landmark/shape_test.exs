defmodule Missions.Landmark.ShapeTest do
  @moduledoc "What a leader that knows no walls makes of followers that are blocked."
  use ExUnit.Case, async: true
  alias Hal.{Odometry, Pose, Profile, Twist}
  alias Nav.Grid
  alias Robot.Percept
  alias Missions.Landmark
  alias Missions.Landmark.{Beat, Shape}

  @asked {:column, 1.0}
  @ids [:mag2, :mag3, :mag4, :mag5]

  # A leader at 0,0 whose followers claim so, `now_ms` after its election.
  defp mission(claims, now_ms, pose \\ Pose.new(0, 0)) do
    peers =
      for {id, claim} <- claims, into: %{} do
        {id,
         %{
           pose: Pose.new(5.0, 5.0),
           twist: Twist.zero(),
           radius: 0.2,
           at_ms: now_ms,
           mode: :holding,
           beat: Beat.new(claim)
         }}
      end

    odometry = %Odometry{pose: Pose.new(0, 0), twist: Twist.zero()}

    %Landmark.State{
      me: :mag1,
      formation: @asked,
      assign: :cost,
      leader_change?: true,
      order: Keyword.keys(claims),
      now_ms: now_ms,
      percept: %Percept{
        robot: :mag1,
        at_ms: now_ms,
        profile: Profile.magellan(),
        peers: peers,
        pose: pose,
        odometry: odometry
      }
    }
  end

  defp claims(blocked),
    do: for(id <- @ids, do: {id, if(id in blocked, do: [blocked: true], else: [])})

  # Every 4 s another set of followers claims to be blocked, and all others are under way, or in place.
  defp run(steps) do
    for {claims, n} <- Enum.with_index(steps, 1), reduce: Shape.new() do
      shape -> Shape.update(shape, mission(claims, n * 9_000), 1.6)
    end
  end

  test "one that is blocked while others are under way waits; half of them, and it is a cluster" do
    assert %{rung: :asked, squeeze: 0} = run([claims([:mag2])])
    assert %{rung: :asked, squeeze: 0} = run([claims([:mag2, :mag3])])
    assert %{rung: :cluster, formation: @asked} = shape = run([claims([:mag2, :mag3, :mag4])])
    assert [_, _, _, _] = places = Shape.trail(shape, mission(claims([]), 5_000))
    # None is nearer to the landmark, at 1.6,0, than the leader is.
    for {x, y, _heading} <- places, do: assert(Pose.distance({x, y}, {1_600, 0}) > 1_600)
  end

  test "all come as close as may be once one that stands in its slot has not become sure of it for 15 s" do
    stand = fn shape, claims, seconds ->
      for ms <- seconds,
          reduce: shape,
          do: (shape -> Shape.update(shape, mission(claims, 1_000 * ms), 1.6))
    end

    unsure = for id <- @ids, do: {id, if(id == :mag5, do: [unsure: true], else: [in_place: true])}
    under_way = Keyword.put(unsure, :mag2, [])

    assert %{formation: @asked} = shape = stand.(Shape.new(), unsure, 10..24)
    # One that leaves its slot meanwhile: it begins anew.
    assert %{formation: @asked} = stand.(shape, under_way, [25]) |> stand.(unsure, 26..40)
    assert %{formation: {:column, 0.8}, rung: :closer} = closer = stand.(shape, unsure, [25])
    assert stand.(closer, unsure, 26..90) == %{closer | unsure_ms: 26_000}
  end

  test "among walls, too; but a ring, and what is as close as may be already, stay" do
    cells = :binary.copy(<<0>>, 200 * 200)
    plan = Grid.plan(cells, {200, 200}, 0.1, {-10.0, -10.0})
    unsure = for id <- @ids, do: {id, if(id == :mag5, do: [unsure: true], else: [in_place: true])}

    stand = fn formation ->
      for s <- 10..60, reduce: Shape.new() do
        shape ->
          mission = mission(unsure, 1_000 * s)
          mission = put_in(%{mission | formation: formation}.percept.grid, plan)
          Shape.update(shape, mission, 1.6)
      end
    end

    assert %{formation: {:column, 0.8}, rung: :closer, spots: [_, _, _, _]} =
             stand.({:column, 1.0})

    assert %{formation: {:column, 0.8}, rung: :closer} = stand.({:column, 0.85})

    for formation <- [{:circle, 1.0}, {:column, 0.8}],
        do: assert(%{formation: ^formation, rung: :asked, squeeze: 0} = stand.(formation))
  end

  test "whoever does not get to its place of a cluster is given another one, and nobody else moves" do
    before = run([claims(@ids)])
    later = run([claims(@ids), claims([:mag3]) |> rest()])
    assert later.rung == :cluster
    [a, b, c, d] = before.spots
    assert [^a, other, ^c, ^d] = later.spots
    for spot <- [a, b, c, d], do: assert(Pose.distance(other, spot) > 0.5)

    # Who is still on the way keeps its place, too, and nobody waits for it.
    assert run([claims(@ids), claims([:mag3])]).spots == later.spots

    # It learns of each.
    again = run([claims(@ids), claims([:mag3]) |> rest(), claims([:mag3]) |> rest()])
    assert [^a, another, ^c, ^d] = again.spots
    assert another not in [b, other]
    assert length(again.barred) == 2
  end

  test "a place that a robot could not get to is free again after half a minute" do
    shape = run([claims(@ids), claims([:mag3]) |> rest()])
    later = &Shape.update(shape, mission(claims([]) |> rest(), 18_000 + &1), 1.6)
    assert [_place] = later.(29_900).barred
    assert later.(30_000).barred == []
    assert later.(30_000).spots == shape.spots
  end

  test "where there is no room for all, no place is in a wall, and nothing is formed" do
    # A room of 4 x 1.2 m about the leader; its followers are in it, close together.
    row = fn j -> if j in 94..105, do: 60..99, else: 0..-1//1 end

    cells = for j <- 0..199, i <- 0..199, into: <<>>, do: if(i in row.(j), do: <<0>>, else: <<1>>)

    grid = Grid.new(cells, {200, 200}, 0.1, {-8.0, -10.0})
    stand = %{mag2: -1.0, mag3: -0.7, mag4: 0.5, mag5: 0.8}

    mission =
      Enum.reduce(stand, mission(claims([]), 9_000), fn {id, x}, mission ->
        put_in(mission.percept.peers[id].beat.pose, {round(1_000 * x), 0, 0})
      end)

    shape = Shape.update(Shape.new(), put_in(mission.percept.grid, grid), 1.6)
    assert %{rung: nil, spots: [_, _, _, _]} = shape
    assert Enum.uniq(shape.spots) == shape.spots
    for spot <- shape.spots, do: assert(Grid.free?(grid, Pose.point(spot), 0.2))

    # They stay as long as there is no room, wherever the robots are by then.
    later = put_in(%{mission | now_ms: 11_000}.percept.grid, grid)
    later = put_in(later.percept.peers[:mag5].beat.pose, {-1_500, 0, 0})
    assert Shape.update(shape, later, 1.6).spots == shape.spots
  end

  test "a place in which a robot has stood is kept, whatever sonars see there later" do
    shape = run([claims(@ids)])
    there = claims([]) |> rest() |> mission(10_000)
    {x, y} = shape.spots |> List.last() |> Pose.point()
    wall = Grid.new(<<1>>, {1, 1}, 0.2, {x - 0.1, y - 0.1}, closed?: false)
    walled = &put_in(&1.percept.grid, wall)

    stood = Shape.update(shape, there, 1.6)
    assert Shape.update(stood, walled.(there), 1.6).spots == shape.spots
    assert Shape.update(shape, walled.(mission(claims([]), 10_000)), 1.6).spots != shape.spots
  end

  test "the shape that was asked for is kept while all stand in it, whatever sonars see there later" do
    wall = &Grid.new(<<1>>, {1, 1}, 6.0, &1, closed?: false)
    knows = &put_in(mission(claims([]) |> rest(), &1).percept.grid, wall.(&2))
    shape = Shape.update(Shape.new(), knows.(9_000, {9.0, 9.0}), 1.6)
    walled = knows.(10_000, {-7.0, -3.0})

    assert shape.room == {5, [1, 2, 3, 4]}
    refute match?(%{rung: :asked, room: {5, _}}, Shape.update(shape, walled, 1.6))
    formed = %{walled | leadership: %Landmark.Leader{formed?: true}}
    assert %{rung: :asked, room: {5, [1, 2, 3, 4]}} = Shape.update(shape, formed, 1.6)
  end

  test "after the last spacing comes the column along its way, then the cluster" do
    one = claims([:mag2]) |> rest()
    rungs = for n <- 1..5, do: run(List.duplicate(one, n)).rung
    assert rungs == [:closer, :closer, :column, :cluster, :cluster]
  end

  test "a leader that has moved on asks for the shape again, and forgets where nobody got to" do
    shape = run([claims(@ids), claims([:mag3]) |> rest()])
    moved = Shape.update(shape, mission(claims([]), 19_000, Pose.new(0.0, 1.2)), 1.6)
    assert %{rung: :asked, squeeze: 0, barred: [], spots: nil} = moved
    assert Shape.trail(moved, mission(claims([]), 9_000)) == nil
  end

  defp rest(claims),
    do: for({id, claim} <- claims, do: {id, if(claim == [], do: [in_place: true], else: claim)})
end
