defmodule Missions.ExploreTest do
  use ExUnit.Case, async: true
  alias Hal.{Odometry, Options, Pose, Profile, Twist}
  alias Missions.Explore
  alias Missions.Explore.SharedMap
  alias Nav.Frontiers
  alias Nav.Frontiers.Choice
  alias Robot.Mission.{Letter, Runner}
  alias Nav.Survey
  alias Robot.Percept
  doctest SharedMap
  doctest Choice

  @tile Survey.tile()

  # A map drawn from the top, a letter for 40 cm: . free, # wall, blank unknown. Its lower left corner is the origin.
  defp drawn(rows) do
    wide = rows |> hd() |> String.length()

    cells =
      for row <- Enum.reverse(rows), _times <- 1..4, into: <<>> do
        for <<letter <- row>>, into: <<>> do
          state = %{?. => 1, ?# => 2, ?\s => 0}[letter]
          <<state, state, state, state>>
        end
      end

    %{cells: cells, width: 4 * wide, height: 4 * length(rows), left: 0, low: 0}
  end

  @room [
    "##########",
    "#........ ",
    "#........ ",
    "#........ ",
    "#........ ",
    "#...######",
    "#...#     ",
    "#...#     ",
    "#...      ",
    "#####     "
  ]

  defp find(rows, from \\ {1.0, 2.2}, radius \\ 0.2),
    do: Frontiers.find(drawn(rows), from, radius)

  test "frontiers are where the free meets the unknown and the robot can come, the nearest first" do
    assert [%{at: {x, y}} = near | more] = find(@room).found
    assert x > 3.3 and y > 2.0
    assert_in_delta near.far, 2.6, 0.3
    assert more != [] and Enum.all?(more, &(&1.far >= near.far))

    # Seen on all sides it is done; without room it is nowhere, which is not the same.
    closed = for row <- @room, do: String.replace(row, " ", "#")
    assert find(closed).found == []
    everywhere = fn _at -> true end
    assert Frontiers.unknown(find(closed), everywhere) == 0.0
    assert_in_delta Frontiers.unknown(find(@room), everywhere), 0.2, 0.1
    assert Frontiers.unknown(find(@room), fn {x, y} -> x < 3.0 and y > 1.0 end) == 0.0
    assert find(closed, {9.0, 9.0}) == nil
    assert Frontiers.find(SharedMap.raster(SharedMap.new()), {0.0, 0.0}, 0.2) == nil
  end

  test "a way round a corner goes for what the robot sees of it" do
    rows = List.replace_at(@room, 8, "#...#     ")
    field = find(rows, {1.0, 1.0})
    [frontier | _] = field.found
    assert frontier.far > 3.0
    {x, y} = Frontiers.ahead(field, frontier, {1.0, 1.0})
    assert x < 1.9 and y > 2.0
  end

  test "a door that seems too narrow is tried, but one that does not costs less" do
    # A letter is 40 cm: a robot of 46 cm does not pass.
    door = [
      "#########",
      "#...#... ",
      "#...#... ",
      "#....... ",
      "#...#... ",
      "#########"
    ]

    assert [%{far: narrow} | _] = find(door, {0.8, 1.0}).found
    wide = List.replace_at(door, 2, "#....... ")
    assert [%{far: far} | _] = find(wide, {0.8, 1.0}).found
    assert narrow > far + 1.0
    shut = List.replace_at(door, 3, "#...#... ")
    assert find(shut, {0.8, 1.0}).found == []
  end

  test "of two that are after one place the nearer has it, whoever asks, and of equals the first by name" do
    [near, far] = for x <- [2.0, 4.0], do: %{at: {x, 0.0}, far: x, size: 5, square: round(x)}

    for {theirs, {mag1, mag2}} <- [{1.0, {4.0, 2.0}}, {3.0, {2.0, 4.0}}, {2.0, {2.0, 4.0}}] do
      others = for f <- [near, far], do: %{f | far: theirs + elem(f.at, 0) - 2.0}
      at = fn choice -> elem(choice.at, 0) end
      assert at.(Choice.of([near, far], :mag1, nil, [{:mag2, {2.0, 0.0}, theirs}])) == mag1
      assert at.(Choice.of(others, :mag2, nil, [{:mag1, {2.0, 0.0}, 2.0}])) == mag2
    end
  end

  defp percept(at_ms, pose, options \\ []) do
    odometry = %Odometry{pose: pose, twist: Twist.zero(), frame: nil}
    percept = %Percept{robot: :mag1, at_ms: at_ms, profile: Profile.magellan(), pose: pose}
    struct!(percept, [odometry: odometry, sonar: List.duplicate(5.1, 16)] ++ options)
  end

  defp looked(pose),
    do: Enum.reduce(0..3, SharedMap.new(), &SharedMap.look(&2, percept(&1 * 1_000, pose)))

  defp tell_all(map, times),
    do: Enum.map_reduce(1..times, map, fn _, map -> SharedMap.tell(map) end) |> elem(0)

  test "what one has seen the other knows in the end, whatever was lost, also from a third one" do
    one = looked(Pose.new(0, 0))
    other = looked(Pose.new(6, 0))
    assert SharedMap.area(one) > 5.0

    joined =
      one |> tell_all(12) |> Enum.drop_every(2) |> Enum.reduce(other, &SharedMap.hear(&2, &1))

    assert Map.take(joined.tiles, Map.keys(one.tiles)) |> map_size() == map_size(one.tiles)
    assert_in_delta SharedMap.area(joined), SharedMap.area(one) + SharedMap.area(other), 0.5
    third = joined |> tell_all(24) |> Enum.reduce(looked(Pose.new(3, 9)), &SharedMap.hear(&2, &1))

    assert Map.take(third.tiles, Map.keys(one.tiles)) ==
             Map.take(joined.tiles, Map.keys(one.tiles))
  end

  test "its own eyes count for more than what it is told, and what was told last for more than what before" do
    map = looked(Pose.new(0, 0))
    at = Survey.tile_of({0.0, 0.0})
    tile = fn state -> for(_ <- 1..(@tile * @tile), into: <<>>, do: <<state::2>>) end
    told = fn {i, j}, state -> <<i::signed-16, j::signed-16, tile.(state)::binary>> end

    assert :binary.match(SharedMap.hear(map, told.(at, 2)).tiles[at], <<1>>) != :nomatch
    far = {9, 9}
    heard = map |> SharedMap.hear(told.(far, 2)) |> SharedMap.hear(told.(far, 1))
    assert heard.tiles[far] == :binary.copy(<<1>>, @tile * @tile)
    # What is unknown to another one is not forgotten, and what is too far away is not heard.
    assert SharedMap.hear(heard, told.(far, 0)).tiles == heard.tiles
    assert SharedMap.hear(heard, told.({31, 0}, 1)).tiles == heard.tiles
  end

  defp explore(options \\ []) do
    {:ok, options} = Options.check(options, Explore.option_table(), "explore")
    {runner, []} = Runner.start(Runner.new(:mag1), Explore, options)
    {runner, []} = Runner.handle(runner, {:command, :start})
    runner
  end

  defp ticks(runner, range, pose, options \\ []) do
    Enum.reduce(range, {runner, []}, fn n, {runner, told} ->
      {runner, effects} = Runner.handle(runner, {:tick, percept(n * 100, pose, options)})
      {runner, told ++ effects}
    end)
  end

  test "it looks round first, then goes to a frontier and says so" do
    {runner, [_ | _] = effects} = ticks(explore(), 0..20, Pose.new(0, 0))
    assert runner.claim.says =~ ~r/^\d+ m² explored, going to a frontier \d\.\d m away$/
    refute runner.claim.formed

    assert [{:goal, {:go, 0}, {Robot.Behaviour.Goto, goal}} | _] =
             for({:goal, {:go, _}, _} = goal <- Enum.reverse(effects), do: goal)

    assert Pose.distance({goal[:x], goal[:y]}, {0.0, 0.0}) > 0.5
    assert [%Letter{kind: :seen} | _] = for({:send, :all, letter} <- effects, do: letter)
  end

  test "in a closet it has explored all within seconds, and is told otherwise by others" do
    closet = [sonar: List.duplicate(0.6, 16)]
    {runner, effects} = ticks(explore(), 0..60, Pose.new(0, 0), closet)

    # Between its sonars it has seen no wall, and has no room to look: that is not what it was asked for.
    assert %{formed: false, phase: :explored} = runner.claim

    assert runner.claim.says =~
             ~r/^1 m² explored, \d\d % of edge unknown, walls \d+ % confirmed$/

    assert [%{says: "says that 1 m² are explored" <> _}] =
             for({:stage, :explored, facts} <- effects, do: facts)
  end

  test "what it says of much that is left fits a status" do
    {runner, _effects} = ticks(explore(), 0..60, Pose.new(0, 0), sonar: List.duplicate(0.6, 16))

    aside = for x <- 1..12, do: {{50.0 + x, 0.0}, 60_000}
    map = %{runner.mission.map | free: 123_400}

    says = fn fields ->
      mission = struct!(%{runner.mission | aside: aside, map: map, planned_ms: 6_000}, fields)
      {runner, _effects} = ticks(%{runner | mission: mission}, 61..61, Pose.new(0, 0))
      runner.claim.says
    end

    good = ", walls 100 % confirmed"
    unknown = says.(unknown: 0.3, good: good)
    assert unknown =~ ~r/^1234 m² explored, 12 frontiers left, 30 % of edge unknown, walls 100/
    doubt = says.(unknown: 0.0, good: good, looked: List.duplicate({0.0, 0.0}, 127))
    assert doubt =~ ~r/, 12 frontiers left, 127 walls in doubt, walls 100 % confirmed$/
    for says <- [unknown, doubt], do: assert(String.length(says) <= 80, says)
  end

  test "a frontier that it comes no nearer to is left alone, and tried once more" do
    {runner, _effects} = ticks(explore(), 0..20, Pose.new(0, 0))
    first = runner.mission.target.at
    {runner, _effects} = ticks(runner, 21..130, Pose.new(0, 0))
    assert Pose.distance(runner.mission.target.at, first) > 0.5
    assert [{_place, until_ms} | _] = runner.mission.aside
    assert until_ms > 30_000 and until_ms < 60_000
  end

  test "no way is no frontier, either" do
    {runner, _effects} = ticks(explore(), 0..20, Pose.new(0, 0))
    {runner, []} = Runner.handle(runner, {:outcome, {:go, 0}, 0})
    assert {[_], 1, nil} = {runner.mission.aside, runner.mission.goal, runner.mission.target}
    {same, []} = Runner.handle(runner, {:outcome, {:go, 0}, 0})
    assert same.mission == runner.mission
  end

  test "it explores no farther than it is told" do
    {runner, _effects} = ticks(explore(within: 3), 0..20, Pose.new(0, 0))
    assert runner.mission.target
    {runner, _effects} = ticks(explore(), 0..20, Pose.new(0, 0))
    mission = %{runner.mission | within: 1.0, planned_ms: nil, since_ms: -9_000}
    {runner, _effects} = ticks(%{runner | mission: mission}, 21..21, Pose.new(0, 0))
    assert runner.mission.done?
  end

  test "junk is refused, and however many robots speak, it remembers a bounded number" do
    {runner, effects} = ticks(explore(), 0..20, Pose.new(0, 0))
    [%Letter{} = letter | _] = for {:send, :all, %Letter{} = letter} <- effects, do: letter

    hear = fn runner, from, letter ->
      elem(Runner.handle(runner, {:message, %{from: from, kind: :mission, body: letter}}), 0)
    end

    for {key, junk} <- [goal: {0, 1.0}, goal: :here, far_mm: -1, tiles: <<1>>, tiles: :all] do
      refused = hear.(runner, :mag2, put_in(letter.fields[key], junk))
      assert {refused.mission, refused.refused} == {runner.mission, 1}
    end

    crowd = Enum.reduce(1..300, runner, &hear.(&2, :"crowd#{&1}", letter))
    assert map_size(crowd.mission.peers) == 256
  end

  test "a stop keeps the map for the next start" do
    {runner, _effects} = ticks(explore(), 0..20, Pose.new(0, 0))
    {:ok, resumed} = runner |> Runner.halt() |> Runner.resume()
    assert resumed.mission.map == runner.mission.map
    {resumed, []} = Runner.handle(resumed, {:command, :start})
    assert Runner.state(resumed) == {Explore, :explore}
  end
end
