defmodule Missions.FlockTest do
  use ExUnit.Case, async: true
  alias Hal.{Odometry, Options, Pose, Profile, Twist}
  alias Missions.Flock
  alias Missions.Flock.{Apart, Field, Members, Sight}
  alias Robot.Mission.{Letter, Runner}
  alias Robot.Percept
  doctest Apart
  doctest Field
  doctest Members

  @spacing 1.2

  # Agents that are points, by the formulas alone, `seconds` long.
  defp settle(agents, seconds) do
    Enum.reduce(1..(seconds * 20), agents, fn _step, agents ->
      for %{at: {x, y} = at, velocity: {vx, vy} = own} = agent <- agents do
        {ux, uy} = Field.neighbours(at, own, agents -- [agent], @spacing)
        # Friction, which the guide has: without it a lattice swings for long.
        {vx, vy} = {vx + 0.05 * (ux - vx), vy + 0.05 * (uy - vy)}
        %{agent | at: {x + 0.05 * vx, y + 0.05 * vy}, velocity: {vx, vy}}
      end
    end)
  end

  defp agent(x, y, velocity \\ {0.0, 0.0}), do: %{at: {x, y}, velocity: velocity}

  test "two settle at the spacing, from nearer and from farther" do
    for far <- [0.5, 0.9, 1.5] do
      [one, other] = settle([agent(0.0, 0.0), agent(far, 0.0)], 30)
      assert_in_delta Pose.distance(one.at, other.at), @spacing, 0.01
    end
  end

  test "what neighbours do to each other is equal and opposite, so that a flock does not move itself" do
    agents = [agent(0.0, 0.0, {0.3, 0.1}), agent(0.8, 0.1), agent(1.1, 1.0, {0.0, -0.2})]

    forces =
      for agent <- agents,
          do: Field.neighbours(agent.at, agent.velocity, agents -- [agent], @spacing)

    assert_in_delta forces |> Enum.map(&elem(&1, 0)) |> Enum.sum(), 0.0, 1.0e-9
    assert_in_delta forces |> Enum.map(&elem(&1, 1)) |> Enum.sum(), 0.0, 1.0e-9
    assert Enum.any?(forces, fn {ux, uy} -> abs(ux) + abs(uy) > 0.01 end)
  end

  test "who is farther than its reach counts for nothing, however fast" do
    far = Field.reach(@spacing) + 0.01

    assert Field.neighbours({0.0, 0.0}, {0.1, 0.0}, [agent(far, 0.0, {9.0, 0.0})], @spacing) ==
             {0.0, 0.0}
  end

  test "a robot at the very place of another has no direction, and no error" do
    assert Field.neighbours({1.0, 1.0}, {0.0, 0.0}, [agent(1.0, 1.0)], @spacing) == {0.0, 0.0}
    assert {_ux, _uy} = Field.obstacles({1.0, 1.0}, {0.0, 0.0}, [{1.0, 1.0}], 1.0)
  end

  defp flock(options \\ []) do
    {:ok, options} = Options.check(options, Flock.option_table(), "flock")
    {runner, []} = Runner.start(Runner.new(:mag1), Flock, options)
    {runner, []} = Runner.handle(runner, {:command, :start})
    runner
  end

  defp tick(runner, at_ms, peers \\ %{}, pose \\ Pose.new(0, 0), grid \\ nil) do
    still = %Odometry{pose: pose, twist: Twist.zero()}

    Runner.handle(
      runner,
      {:tick,
       %Percept{
         robot: :mag1,
         at_ms: at_ms,
         profile: Profile.magellan(),
         pose: pose,
         odometry: still,
         peers: peers,
         grid: grid
       }}
    )
  end

  defp peer(x, y, at_ms, mode \\ :moving),
    do: %{pose: Pose.new(x, y), twist: Twist.zero(), radius: 0.2, at_ms: at_ms, mode: mode}

  defp letter(options \\ [], fields \\ []) do
    {_runner, effects} = tick(flock(options), 0)
    {:send, :all, %Letter{} = letter} = List.keyfind(effects, :send, 0)
    %{letter | fields: Keyword.merge(letter.fields, fields)}
  end

  defp hear(runner, from, letter),
    do: elem(Runner.handle(runner, {:message, %{from: from, kind: :mission, body: letter}}), 0)

  defp velocity(effects) do
    {:goal, :flock, {Robot.Behaviour.Velocity, velocity: velocity}} =
      List.keyfind(effects, :goal, 0)

    velocity
  end

  test "it keeps to members alone: who tells nothing, stands by itself, or has another course is none" do
    beside = fn mode -> %{mag2: peer(1.5, 0.0, 100, mode)} end
    {runner, _effects} = tick(flock(), 0)

    pulled? = fn runner, peers ->
      runner |> tick(100, peers) |> elem(1) |> velocity() |> elem(0) > 0
    end

    assert pulled?.(hear(runner, :mag2, letter()), beside.(:moving))
    refute pulled?.(runner, beside.(:moving))
    refute pulled?.(hear(runner, :mag2, letter()), beside.(:holding))
    refute pulled?.(hear(runner, :mag2, letter()), beside.(:dead))
    refute pulled?.(hear(runner, :mag2, letter(course: [{1, 1}])), beside.(:moving))
    refute pulled?.(hear(runner, :mag2, letter(spacing: 2)), beside.(:moving))
  end

  test "a person has it go on to a leg, and it tells the others at once; no robot can say so, and no leg comes twice" do
    options = [course: [{0, 0}, {4, 0}, {8, 0}]]
    {runner, _effects} = tick(flock(options), 0)
    said = &{:command, {:message, :leg, [leg: &1]}}
    {on, []} = Runner.handle(runner, said.(2))
    assert on.mission.leg == 2
    {_on, effects} = tick(on, 100)
    assert {:send, :all, %Letter{kind: :member, fields: fields}} = List.keyfind(effects, :send, 0)
    assert fields[:leg] == 2

    for leg <- [1, 2, 5], do: assert({%{mission: %{leg: 2}}, []} = Runner.handle(on, said.(leg)))
    assert {%{mission: %{leg: 4}}, []} = Runner.handle(on, said.(4))

    forged = Letter.new!(Flock, :all, :leg, leg: 3)
    assert hear(on, :mag2, forged).mission == on.mission
  end

  test "the greatest leg that anybody tells counts, one beyond the course does not, and junk is refused" do
    options = [course: [{0, 0}, {4, 0}]]
    {runner, _effects} = tick(flock(options), 0)
    on = hear(runner, :mag2, letter(options, leg: 2))
    assert {on.mission.leg, Runner.state(on)} == {2, {Flock, :flock}}
    assert hear(on, :mag3, letter(options, leg: 1)).mission.leg == 2
    assert hear(on, :mag3, letter(options, leg: 4)).mission.leg == 2
    assert hear(on, :mag3, letter(options, leg: 3)).mission.leg == 3

    fresh = letter(options)

    for junk <- [
          put_in(fresh.fields[:leg], -1),
          put_in(fresh.fields[:leg], 66),
          put_in(fresh.fields[:leg], 1.0),
          put_in(fresh.fields[:plan], :here),
          %{fresh | fields: []},
          %{fresh | fields: [1 | 2]},
          %{fresh | version: 2},
          %{fresh | mission: Missions.Patrol}
        ] do
      refused = hear(runner, :mag2, junk)
      assert {refused.mission, refused.refused} == {runner.mission, 1}, inspect(junk)
    end
  end

  test "it keeps off what its sonars see, but not off a member that is a little beside where it tells" do
    options = [course: [{5, 0}]]
    {runner, _effects} = tick(flock(options), 0)
    runner = hear(runner, :mag2, letter(options))

    ahead = fn range, peers ->
      sonar = List.replace_at(List.duplicate(5.1, 16), 11, range)
      profile = Profile.magellan()
      odometry = %Odometry{pose: Pose.new(0, 0), twist: Twist.zero()}
      percept = %Percept{robot: :mag1, at_ms: 100, profile: profile, pose: Pose.new(0, 0)}
      percept = %{percept | odometry: odometry, sonar: sonar, peers: peers}
      {_runner, effects} = Runner.handle(runner, {:tick, percept})
      effects |> velocity() |> elem(0)
    end

    assert ahead.(0.5, %{}) < 0 and ahead.(5.1, %{}) > 0
    told = %{mag2: peer(1.2, 0.0, 100)}
    # Its body begins at 1.0 m: an echo that is 0.25 m nearer is still its.
    assert ahead.(0.55, told) == ahead.(5.1, told)
    assert ahead.(0.3, told) < ahead.(5.1, told)
  end

  test "it waits while the flock does not hang together, and says so" do
    options = [course: [{0, 0}, {9, 0}]]
    told = letter(options, leg: 2)
    {runner, _effects} = tick(flock(options), 0)
    runner = runner |> hear(:mag2, told) |> hear(:mag3, told)

    go = fn x ->
      peers = %{mag2: peer(1.2, 0.0, 600), mag3: peer(x, 0.0, 600)}
      {runner, effects} = tick(runner, 600, peers)
      {runner.claim.says, runner.mission.pace, velocity(effects)}
    end

    assert {"on the way to point 2 of 2, 3 robots together", 1.0, {vx, _vy}} = go.(-1.2)
    assert vx > 0.01
    assert {"on the way to point 2 of 2, 3 robots together", 0.5, _slower} = go.(-1.5)

    assert {"mag3 is 2.0 m from mag1; to point 2 of 2", +0.0, _waits} = go.(-2.0)
  end

  # 8 x 4 m with a wall across the middle, whose door has so many cells of 10 cm; its lower left corner is at -4, -2.
  defp hall(door) do
    cells =
      for j <- 0..39, i <- 0..79, into: <<>> do
        <<if(i in 39..40 and j not in Enum.take(28..38, door), do: 1, else: 0)>>
      end

    Nav.Grid.new(cells, {80, 40}, 0.1, {-4.0, -2.0})
  end

  test "behind a wall it goes to the point by its own way, and by the rules of the flock once it sees it" do
    runner = flock(course: [{2, 0}])

    go = fn pose ->
      runner |> tick(0, %{}, pose, hall(11)) |> elem(1) |> List.keyfind(:goal, 0)
    end

    assert {:goal, {:way, 0}, {Robot.Behaviour.Goto, way}} = go.(Pose.new(-2, 0))
    assert {way[:x], way[:y], way[:speed]} == {2, 0, 0.3}
    assert {:goal, :flock, {Robot.Behaviour.Velocity, velocity: _}} = go.(Pose.new(1, 0))
  end

  test "a way that ended before the point is tried again" do
    {runner, _effects} = tick(flock(course: [{2, 0}]), 0, %{}, Pose.new(-2, 0), hall(11))
    {runner, _effects} = Runner.handle(runner, {:outcome, {:way, 0}, 2})
    {_runner, effects} = tick(runner, 100, %{}, Pose.new(-2, 0), hall(11))
    assert {:goal, {:way, 1}, {Robot.Behaviour.Goto, _}} = List.keyfind(effects, :goal, 0)
  end

  test "it says where no way leads, and what lies between members that are apart" do
    says = fn course, door, peers ->
      {runner, _effects} = tick(flock(course: course), 0, %{}, Pose.new(-2, 0), hall(door))
      runner = Enum.reduce(Map.keys(peers), runner, &hear(&2, &1, letter(course: course)))
      {runner, _effects} = tick(runner, 500, peers, Pose.new(-2, 0), hall(door))
      runner.claim.says
    end

    assert says.([{2, 0}], 0, %{}) ==
             "no way to 2.0,0.0: no way leads there; gathers"

    assert says.([{0, 0}], 11, %{}) ==
             "no way to 0.0,0.0: there is a wall; gathers"

    peers = %{mag2: peer(2.0, 0.0, 500)}
    apart = "mag2 is 4.0 m from mag1"
    assert says.([{-2, 0}], 11, peers) == apart <> ", a wall between; gathers"
    assert says.([{-2, 0}], 0, peers) == apart <> ", no way between; gathers"
  end

  test "those that are behind go on while the first wait, and one that stands is told of" do
    options = [course: [{0, 0}, {9, 0}]]
    told = letter(options, leg: 2)
    {runner, _effects} = tick(flock(options), 0)
    runner = runner |> hear(:mag2, told)

    go = fn runner, at_ms ->
      runner = hear(runner, :mag2, told)
      elem(tick(runner, at_ms, %{mag2: peer(4.0, 0.0, at_ms)}), 0)
    end

    behind = go.(runner, 600)
    assert behind.mission.pace == 1.0
    runner = Enum.reduce(1..24, behind, &go.(&2, 600 + 500 * &1))

    assert runner.claim.says =~
             ~r/^mag2 is 4.0 m from mag1, stood 1\d s; to point 2 of 2$/
  end

  test "the longest that it says fits a status" do
    options = [course: for(x <- 1..64, do: {x, 0})]
    told = letter(options, leg: 64)
    {runner, _effects} = tick(flock(options), 0)

    runner =
      Enum.reduce(1..240, runner, fn n, runner ->
        runner = hear(runner, :magellan12, told)
        peers = %{magellan12: peer(0.0, 12.3, 500 * n)}
        elem(tick(runner, 500 * n, peers, Pose.new(0, 0), nil), 0)
      end)

    assert runner.claim.says == "magellan is 12.3 m from mag1, stood 115 s; to point 64 of 64"
    # With what lies between.
    assert String.length(runner.claim.says <> ", no way between") <= 80
  end

  test "a flock that waits, or is slow, on its way past the point's reach is not at the point" do
    # In the open, one member nearer than the spacing, the middle beyond the flock's radius.
    options = [course: [{0, 0}, {9, 0}, {12, 0}]]

    wait = fn options, xs ->
      told = letter(options, leg: 2)
      {runner, _effects} = tick(flock(options), 0)

      Enum.reduce(1..40, runner, fn n, runner ->
        runner = Enum.reduce(Map.keys(xs), runner, &hear(&2, &1, told))
        peers = Map.new(xs, fn {id, {x, v}} -> {id, peer(x + v * n / 2, 0.0, 500 * n)} end)
        elem(tick(runner, 500 * n, peers), 0)
      end).mission.leg
    end

    row = fn last -> for n <- 1..last, into: %{}, do: {:"mag#{n + 1}", {1.2 * n, 0.0}} end
    assert wait.(options, row.(7)) == 2
    # At rest with the middle within the flock's radius it is there.
    assert wait.([course: [{0, 0}, {1.4, 0}, {12, 0}]], row.(1)) == 3
    # 0.02 m/s of 0.05.
    slow = [speed: 0.05, course: [{0, 0}, {1.4, 0}, {12, 0}]]
    assert wait.(slow, %{mag2: {0.4, 0.04}}) == 2
  end

  test "rest counts anew on each leg" do
    options = [course: [{9, 0}, {0.7, 0}, {9, 0}]]
    {runner, _effects} = tick(flock(options), 0)
    runner = Enum.reduce(1..40, runner, &elem(tick(&2, 500 * &1), 0))
    runner = hear(runner, :mag2, letter(options, leg: 2))
    runner = Enum.reduce(41..48, runner, &elem(tick(&2, 500 * &1), 0))
    assert {runner.mission.leg, runner.mission.done_ms} == {2, nil}
  end

  test "of large groups the nearest of each are asked for sight, in whatever order" do
    own = for n <- 1..9, do: {:"mag#{n}", {-1.0 - 0.2 * n, -1.5}}
    # The ninth alone sees through the door.
    own = List.replace_at(own, 8, {:mag9, {-3.9, 1.4}})
    others = for n <- 1..9, do: {:"min#{n}", {1.0 + 0.2 * n, 1.4}}

    for {own, others} <- [{own, others}, {Enum.reverse(own), Enum.reverse(others)}] do
      refute Sight.any?(hall(11), own, others)
      assert Sight.any?(hall(11), tl(Enum.sort(own)), others)
    end
  end

  test "a member that fell silent is waited for no longer" do
    {runner, _effects} = tick(flock(), 0)
    heard = hear(runner, :mag2, letter())
    {still, _effects} = tick(heard, 3_400)
    assert still.mission.heard == %{mag2: 0}
    {alone, _effects} = tick(heard, 3_500)
    assert alone.mission.heard == %{}
  end

  test "however many robots speak, it remembers a bounded number" do
    {runner, _effects} = tick(flock(), 0)
    letter = letter()
    crowd = Enum.reduce(1..400, runner, &hear(&2, :"crowd#{&1}", letter))
    assert map_size(crowd.mission.heard) == 256
  end

  test "it draws its course, and which points of it are done" do
    options = [course: [{1.0, 2.0}, {3.0, 4.0}], spacing: 1.0, speed: 0.3]
    {:idle, flock, []} = Flock.init(:mag1, options)

    assert [{:polyline, "course", [{1.0, 2.0}, {3.0, 4.0}]}, {:points, _name, points}] =
             Flock.layer(%{flock | leg: 2})

    assert points == [{1.0, 2.0, "1 done"}, {3.0, 4.0, "2"}]
  end

  test "alone, or without a course, it arrives by itself" do
    for options <- [[], [course: []]] do
      {runner, stages} =
        Enum.reduce(0..120, {flock(options), []}, fn n, {runner, stages} ->
          {runner, effects} = tick(runner, n * 100)
          {runner, stages ++ for({:stage, name, %{says: says}} <- effects, do: {name, says})}
        end)

      assert runner.claim.formed and runner.claim.phase == :arrived
      assert {:gathered, "says that 1 robot keeps together"} = hd(stages)
    end
  end

  test "a stop leaves it ready for the next start, from the first leg" do
    runner = hear(elem(tick(flock(), 0), 0), :mag2, letter([], leg: 1))
    assert {:ok, resumed} = runner |> Runner.halt() |> Runner.resume()
    {resumed, []} = Runner.handle(resumed, {:command, :start})
    assert {Runner.state(resumed), resumed.mission.heard} == {{Flock, :gather}, %{}}
  end
end
