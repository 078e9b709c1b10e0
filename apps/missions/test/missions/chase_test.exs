defmodule Missions.ChaseTest do
  use ExUnit.Case, async: true
  alias Hal.{Options, Pose}
  alias Missions.Chase
  alias Missions.Chase.{Driver, Push, Ring, Search, Sight, Track}
  doctest Driver
  doctest Push
  doctest Ring
  doctest Search
  doctest Track

  defp rolling(track, from_ms, to_ms, place) do
    Enum.reduce(from_ms..to_ms//100, track, fn ms, track ->
      {x, y} = place.(ms / 1000)
      # Errors of 2 cm, of either sign.
      error = 0.02 * (1 - 2 * rem(div(ms, 100), 2))
      Track.note(track, {x + error, y - error}, 0.0004, ms)
    end)
  end

  describe "the track" do
    test "follows a ball at a constant velocity, is sure of it, and says where it will be" do
      track = rolling(nil, 0, 3_000, &{0.4 * &1, 1.0 - 0.2 * &1})
      assert Track.state(track, 3_000) == :found
      {{x, y}, sd} = Track.place(track, 3_500)
      assert_in_delta x, 1.4, 0.08
      assert_in_delta y, 0.3, 0.08
      assert sd < 0.2
      assert_in_delta Track.speed(track, 3_000), 0.447, 0.1
    end

    test "knows less and less of a ball that no robot sees, and then says that it is lost" do
      track = rolling(nil, 0, 1_000, fn _s -> {1.0, 1.0} end)
      sds = for ms <- [1_000, 2_000, 3_000, 4_000], do: elem(Track.place(track, ms), 1)
      assert sds == Enum.sort(sds) and hd(sds) < 0.03 and List.last(sds) > 0.1
      assert Track.state(track, 3_900) == :found
      assert Track.state(track, 4_100) == :lost
      assert Track.state(nil, 0) == :unseen
    end

    test "does not heed a reflection, and goes to where the ball was carried" do
      track = rolling(nil, 0, 1_000, fn _s -> {1.0, 1.0} end)
      once = Track.note(track, {4.0, 4.0}, 0.0004, 1_100)
      assert Pose.distance(elem(Track.place(once, 1_100), 0), {1.0, 1.0}) < 0.05
      carried = Enum.reduce(1..5, track, &Track.note(&2, {4.0, 4.0}, 0.0004, 1_000 + 100 * &1))
      assert elem(Track.place(carried, 1_500), 0) == {4.0, 4.0}
      assert Track.state(carried, 1_500) == :seen
    end

    test "sightings of several robots are one ball, the surer ones count for more" do
      track =
        Enum.reduce(0..20, nil, fn k, track ->
          track
          |> Track.note({1.0, 0.0}, 0.0004, 100 * k)
          |> Track.note({1.2, 0.0}, 0.04, 100 * k)
        end)

      {{x, _y}, sd} = Track.place(track, 2_000)
      assert_in_delta x, 1.0, 0.02
      assert sd < 0.02
    end

    test "what is heard late counts where the ball is by now" do
      track = rolling(nil, 0, 2_000, &{0.5 * &1, 0.0})
      late = Track.note(track, {0.9, 0.0}, 0.0004, 1_800)
      assert late.outside == 0
      assert_in_delta elem(elem(Track.place(late, 2_000), 0), 0), 1.0, 0.06
    end
  end

  describe "the driver" do
    # Robots tell each other every 200 ms; `lost?` says which messages do not arrive.
    defp fleet(
           costs,
           ticks,
           lost? \\ fn _from, _to, _ms -> false end,
           silent? \\ fn _id, _ms -> false end
         ) do
      start = Map.new(costs, fn {id, _cost} -> {id, {%Driver{}, %{}}} end)

      Enum.map_reduce(0..ticks, start, fn k, fleet ->
        ms = 100 * k

        fleet =
          Map.new(fleet, fn {id, {driver, heard}} ->
            cost = costs[id].(ms)

            {id,
             {if(silent?.(id, ms), do: %Driver{}, else: Driver.tick(driver, id, cost, heard, ms)),
              heard}}
          end)

        fleet = if rem(k, 2) == 0, do: told(fleet, costs, ms, lost?, silent?), else: fleet
        {for({id, {driver, _heard}} <- Enum.sort(fleet), Driver.drives?(driver), do: id), fleet}
      end)
      |> elem(0)
    end

    defp told(fleet, costs, ms, lost?, silent?) do
      Map.new(fleet, fn {id, {driver, heard}} ->
        news =
          for {from, {other, _}} <- fleet,
              from != id,
              not silent?.(from, ms),
              not lost?.(from, id, ms),
              into: %{} do
            {from, %{at_ms: ms, cost: costs[from].(ms), drives?: Driver.drives?(other)}}
          end

        {id, {driver, Map.merge(heard, news)}}
      end)
    end

    defp at(cost), do: fn _ms -> cost end

    test "is the nearest, of equal ones the first by name, and never two" do
      for {costs, driver} <- [
            {%{a: at(3.0), b: at(2.0), c: at(4.0)}, :b},
            {%{a: at(2.0), b: at(2.0)}, :a},
            {%{a: at(nil), b: at(9.0)}, :b}
          ] do
        drivers = fleet(costs, 50)
        assert Enum.all?(drivers, &(length(&1) <= 1))
        assert List.last(drivers) == [driver]
      end
    end

    test "is the same while another is nearer by less than a metre, and another one beyond that" do
      keeps = fleet(%{a: at(2.0), b: fn ms -> if ms < 2_000, do: 3.0, else: 1.2 end}, 80)
      assert List.last(keeps) == [:a]
      gives = fleet(%{a: at(2.0), b: fn ms -> if ms < 2_000, do: 3.0, else: 0.5 end}, 80)
      assert List.last(gives) == [:b]
      assert Enum.all?(gives, &(length(&1) <= 1))
    end

    test "is replaced when it falls silent" do
      drivers =
        fleet(
          %{a: at(1.0), b: at(2.0), c: at(3.0)},
          80,
          fn _, _, _ -> false end,
          &(&1 == :a and &2 > 2_000)
        )

      assert Enum.at(drivers, 15) == [:a]
      assert List.last(drivers) == [:b]
    end

    test "is one again soon after two, who did not hear each other, do" do
      cut = fn _from, _to, ms -> ms < 3_000 end
      drivers = fleet(%{a: at(1.5), b: at(1.0)}, 60, cut)
      assert Enum.at(drivers, 20) == [:a, :b]
      assert for(drivers <- Enum.drop(drivers, 33), uniq: true, do: drivers) == [[:a]]
    end
  end

  test "the place behind the ball is where there is room, and beside it where a wall or a dead robot is" do
    scene = %{
      ball: {0.0, 0.0},
      goal: {3.0, 0.0},
      ball_radius: 0.11,
      radius: 0.2,
      grid: nil,
      taken: []
    }

    assert {{x, y}, +0.0} = Push.behind(scene)
    assert_in_delta x, -0.66, 1.0e-6
    assert_in_delta y, 0.0, 1.0e-6
    assert {{_x, _y}, side} = Push.behind(%{scene | taken: [{-0.7, 0.0}]})
    assert abs(side) > 1.0
    walls = Nav.Grid.plan(:binary.copy(<<1>>, 100), {10, 10}, 1.0, {-5.0, -5.0})
    assert Push.behind(%{scene | grid: walls}) == nil
  end

  test "the robot steers so that the ball goes to the goal" do
    scene = %{
      ball: {0.0, 0.0},
      goal: {3.0, 0.0},
      ball_radius: 0.11,
      radius: 0.2,
      grid: nil,
      taken: []
    }

    {vx, vy} = Push.velocity(scene, Pose.new(-0.4, 0.0), 0.0, 0.2)
    assert_in_delta vx, 0.2, 1.0e-9
    assert_in_delta vy, 0.0, 1.0e-9
    # From the right of the line the ball would go to the left: it must come round to the left.
    {_vx, vy} = Push.velocity(scene, Pose.new(-0.39, -0.1), 0.0, 0.2)
    assert vy > 0.1
  end

  test "a picture without a ball, of a lost robot, or of a hidden ball shows none" do
    profile = Hal.Profile.magellan()

    blob = %Vision.Blob{
      colour: "OrangeBall",
      area: 800,
      share: 0.01,
      x: 159.5,
      y: 190.0,
      left: 145,
      top: 170,
      right: 174,
      bottom: 202,
      width: 320,
      height: 240
    }

    percept = fn blobs ->
      %Robot.Percept{
        robot: :mag1,
        at_ms: 0,
        profile: profile,
        pose: Pose.new(1, 0),
        detections: %Vision.Detections{at_ms: 0, blobs: blobs}
      }
    end

    assert {{x, y}, var} = Sight.ball(percept.([blob]), "OrangeBall", 0.11)
    assert_in_delta x, 3.11, 0.02
    assert_in_delta y, 0.0, 0.02
    assert var < 0.01

    for wrong <- [
          percept.([]),
          percept.([%{blob | colour: "RedRobot"}]),
          percept.([%{blob | right: 158}]),
          percept.([%{blob | bottom: 180}]),
          percept.([%{blob | left: 0}]),
          %{percept.([blob]) | uncertainty: %{lost?: true, radius: 0.1}},
          %{percept.([blob]) | pose: nil},
          %{percept.([blob]) | detections: nil}
        ],
        do: assert(Sight.ball(wrong, "OrangeBall", 0.11) == nil)
  end

  test "it says what it knows, what it does not, and draws both" do
    {:idle, mission, []} = Chase.init(:mag1, Options.defaults(Chase.option_table()))
    {:search, mission, []} = Chase.handle({:command, :start}, mission)
    assert Chase.explain(mission) == [{"ball", "not seen yet"}]

    percept = %Robot.Percept{
      robot: :mag1,
      at_ms: 0,
      profile: Hal.Profile.magellan(),
      pose: Pose.new(1, 0)
    }

    {:search, mission, effects} = Chase.handle({:tick, percept}, mission)
    assert {:claim, %{formed: false, says: "looks for the ball"}} = List.last(effects)

    assert [{:polyline, "goal", _}, {:points, _, [{+0.0, +0.0, "goal"}]}, _] =
             Chase.layer(mission)
  end
end
