defmodule Missions.Landmark.LookoutTest do
  @moduledoc "A search from room to room, by hand: two rooms with a door between them."
  use ExUnit.Case, async: true
  alias Hal.{Pose, Profile}
  alias Missions.Landmark
  alias Missions.Landmark.{Beat, Coverage, Lookout}
  alias Nav.Grid
  alias Robot.Percept
  doctest Coverage

  # 6.5 x 4 m; the wall between the rooms is at x = 4, its door from y = 1.4 to 2.6.
  defp rooms(door? \\ true) do
    cells =
      for j <- 0..39, i <- 0..64, into: <<>> do
        edge? = i in [0, 64] or j in [0, 39]
        wall? = i in 39..40 and not (door? and j in 14..25)
        if edge? or wall?, do: <<1>>, else: <<0>>
      end

    Grid.new(cells, {65, 40}, 0.1, {0.0, 0.0})
  end

  defp mission(options \\ []) do
    {_phase, mission, _effects} = Landmark.init(:mag2, [])
    options = Keyword.merge([grid: rooms(), at: {2.0, 2.0}, peers: %{}], options)
    {x, y} = options[:at]

    percept = %Percept{
      robot: :mag2,
      at_ms: 10_000,
      profile: Profile.magellan(),
      pose: Pose.new(x, y),
      grid: options[:grid],
      peers: options[:peers]
    }

    %{mission | phase: :wander, percept: percept, now_ms: 10_000, started?: true}
  end

  defp peer(id, phase \\ :wander),
    do: %{id => %{at_ms: 10_000, beat: Beat.new(phase: phase), pose: Pose.new(0, 0), radius: 0.2}}

  defp moved(mission, {x, y}), do: put_in(mission.percept.pose, Pose.new(x, y))

  defp goal(mission),
    do: for({:goal, tag, goal} <- elem(Lookout.act(mission), 1), do: {tag, goal})

  defp told(mission),
    do: for({:tell, :all, :looked, said} <- elem(Lookout.act(mission), 1), do: said)

  defp mm({x, y}), do: {round(1_000 * x), round(1_000 * y)}

  test "the next place is behind the door, with room around it, and the others are told once" do
    mission = Lookout.turned(mission())
    assert Lookout.left?(mission) and not Lookout.arrived?(mission)
    assert [{{:roam, leg}, {Robot.Behaviour.Goto, options}}] = goal(mission)
    assert options[:x] > 4.3
    assert Grid.clearance(rooms(), {options[:x], options[:y]}) >= 0.75

    assert [[at: {2_000, 2_000}, goal: {_x, _y}, far_mm: far]] = told(mission)
    assert far in 1_500..5_000
    {mission, _effects} = Lookout.act(mission)
    assert told(mission) == []

    there = Lookout.ended(mission, leg, 1)
    assert Lookout.arrived?(there)
    refute Lookout.arrived?(Lookout.ended(mission, leg - 1, 1))
    # From there all is seen.
    all = there |> moved({options[:x], options[:y]}) |> Lookout.turned()
    refute Lookout.left?(all)

    assert Lookout.says(%{all | phase: :rest}) =~
             "no landmark: has looked at all that it can reach, 2"
  end

  test "what no way leads to is not waited for, and a leg that takes too long ends" do
    mission = Lookout.turned(mission(grid: rooms(false)))
    refute Lookout.left?(mission)

    mission = Lookout.turned(mission())
    refute Lookout.arrived?(%{mission | now_ms: 69_000})
    assert Lookout.arrived?(%{mission | now_ms: 71_000})
    assert Lookout.turned(%{mission | now_ms: 79_000}).lookout.missed == 1

    # One that a round interrupts is gone again.
    interrupted = Lookout.turned(%{mission | now_ms: 30_000})
    assert interrupted.lookout.target.at == mission.lookout.target.at
    assert interrupted.lookout.missed == 0
  end

  test "a place that it cannot get to is not tried again" do
    mission = Lookout.turned(mission())
    first = mission.lookout.target.at
    mission = Lookout.ended(mission, mission.lookout.leg, 2)
    refute Lookout.arrived?(mission)
    if Lookout.left?(mission), do: assert(Pose.distance(mission.lookout.target.at, first) > 0.5)
    again = Lookout.turned(mission)
    for %{at: at} <- again.lookout.open, do: assert(Pose.distance(at, first) > 0.5)
    # It does not say that it has looked at all.
    assert Lookout.says(%{again | phase: :rest}) =~ "did not get to: "
    refute Lookout.says(%{again | phase: :rest}) =~ "all that it can reach"
  end

  test "what others have looked at is looked at" do
    mission = Lookout.turned(mission(peers: peer(:mag1)))
    area = mission.lookout.area
    heard = Lookout.hear(mission, :mag1, at: mm({5.2, 2.0}), goal: nil, far_mm: 0)
    {looked, _effects} = Lookout.act(%{heard | now_ms: 13_000})
    assert looked.lookout.area > area + 2.5
    refute Lookout.left?(looked)
  end

  test "of two that are after one place the nearer has it, and the other one waits until it is gone" do
    mission = Lookout.turned(mission(peers: peer(:mag1)))
    target = mission.lookout.target

    tell = fn mission, far_mm ->
      Lookout.hear(mission, :mag1, at: mm({2.0, 1.0}), goal: mm(target.at), far_mm: far_mm)
    end

    assert [{:stand, {Robot.Behaviour.Stop, []}}] = mission |> tell.(1_000) |> goal()
    assert [{{:roam, _leg}, _goto}] = mission |> tell.(20_000) |> goal()

    # It says that it goes nowhere, and waits for ever only for one that searches.
    waits = tell.(mission, 1_000)
    assert [[at: _place, goal: nil, far_mm: 0]] = told(waits)
    refute Lookout.arrived?(%{waits | now_ms: 500_000})

    for peers <- [%{}, peer(:mag1, :rest)] do
      alone = put_in(waits.percept.peers, peers)
      assert [{{:roam, _leg}, _goto}] = goal(%{alone | company: nil})
    end
  end

  test "a robot that knows no walls has no lookout, and one that sees them by sonar counts only what is near" do
    assert %{lookout: nil} = Lookout.turned(mission(grid: nil))
    plan = Lookout.turned(mission()).lookout.area
    sonar = Lookout.turned(mission(grid: %{rooms() | closed?: false})).lookout.area
    assert sonar < plan - 2
    mission = Lookout.turned(mission(grid: %{rooms() | closed?: false}))
    heard = Lookout.hear(mission, :mag1, at: mm({5.2, 2.0}), goal: nil, far_mm: 0)
    assert heard.lookout.area == sonar
  end

  test "a flood of what others say is bounded" do
    mission = %{Lookout.turned(mission()) | phase: :search}

    flooded =
      for k <- 1..1_000, reduce: mission do
        mission -> Lookout.hear(mission, :"mag#{rem(k, 3)}", at: {k, k}, goal: {k, k}, far_mm: k)
      end

    assert length(flooded.lookout.heard) <= 64
    # Nobody of them is there.
    assert flooded.lookout.others == %{}
  end
end
