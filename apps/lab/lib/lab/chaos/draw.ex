defmodule Lab.Chaos.Draw do
  @moduledoc """
  Draws the options of a run (`Lab.Trial.Options`) from a seed and the number of the run. Pure.

  Only what is allowed is drawn, and most of it so that a fleet can form: most landmarks stand in
  the room where the fleet starts, most radios lose little, and at least half of the robots
  survive. What happens to a run begins no later than 40 s before its end.
  """
  alias Lab.Chaos.Random
  alias Lab.Trial.{Options, Places}

  # Fixed lists, so that no draw makes an atom.
  @mags for k <- 1..20, do: :"mag#{k}"
  @mins for k <- 1..20, do: :"min#{k}"
  @places 30
  @rest_s 40
  @first_s 5

  @typedoc "Opens a map for a fleet of so many robots, as `Sim.Floorplan.open/2` does."
  @type opener :: (String.t(), pos_integer() -> {:ok, Sim.Floorplan.t()} | {:error, String.t()})

  @doc """
  The options of run `number` (from 1) of a seed, as a keyword list in a fixed order. Who draws many
  runs may keep the maps: `open`.

      iex> Lab.Chaos.Draw.options(1, 3) == Lab.Chaos.Draw.options(1, 3)
      true
  """
  @spec options(seed :: integer(), number :: pos_integer(), opener()) :: keyword()
  def options(seed, number, open \\ &Sim.Floorplan.open/2) do
    random = Random.new(seed, number)
    {robots, random} = robots(random)
    {map, random} = Random.weighted(random, [{"hall", 5}, {"hospital", 3}, {"arena", 3}])
    {world, random} = Random.whole(random, 1, 1_000_000)
    {start, random} = Random.weighted(random, spread: 5, same: 1)
    {duration_s, random} = Random.whole(random, 60, 240)
    {radio, random} = radio(random)
    {mission, random} = mission(random)
    {noise, random} = Random.weighted(random, default: 5, off: 2, slip: 3)
    {blobs, random} = Random.weighted(random, direct: 14, painted: 1)
    fixed = [robots: robots, seed: world, map: map, start: start]

    {landmark, random} = Random.weighted(random, default: 5, room: 5, anywhere: 2, none: 1)

    {:ok, plan} = open.(map, length(robots))
    {landmark, random} = landmark(landmark, random, plan, {robots, world})
    {events, random} = events(random, robots, duration_s, &place(&1, plan, plan.room))
    {script, random} = faults(random, robots, duration_s, radio[:loss])
    {casts, _random} = Random.weighted(random, sent: 1, drawn: 1)

    fixed ++
      [landmark: landmark] ++
      events ++
      [script: script] ++
      radio ++
      [noise: noise, duration_s: duration_s, blobs: blobs, casts: casts] ++ mission
  end

  @landmark [:formation, :assign, :leader_change, :policy, :lost_link]

  @doc """
  Such a run with another mission. Its robots know the walls, unless they make a map.

      iex> run = Lab.Chaos.Draw.options(1, 3)
      iex> patrol = Lab.Chaos.Draw.instead(run, {Missions.Patrol, []})
      iex> {Keyword.keys(run -- patrol), patrol -- run}
      {[:formation, :assign, :leader_change, :policy, :lost_link], [mission: {Missions.Patrol, []}, plan: :known]}
  """
  @spec instead(keyword(), {module(), keyword()}) :: keyword()
  def instead(run, mission),
    do: Keyword.drop(run, @landmark) ++ [mission: mission, plan: Options.plan(mission)]

  defp robots(random) do
    {size, random} = Random.weighted(random, few: 3, some: 8, many: 3, twenty: 1)

    {count, random} =
      case size do
        :few -> Random.whole(random, 1, 2)
        :some -> Random.whole(random, 3, 7)
        :many -> Random.whole(random, 8, 12)
        :twenty -> {20, random}
      end

    {minis, random} = Random.whole(random, 0, count)
    {Enum.take(@mags, count - minis) ++ Enum.take(@mins, minis), random}
  end

  defp radio(random) do
    {quality, random} = Random.weighted(random, whole: 4, fair: 4, poor: 2, bad: 1)

    {loss, random} =
      case quality do
        :whole -> {0.0, random}
        :fair -> Random.number(random, 0.0, 0.2, 2)
        :poor -> Random.number(random, 0.2, 0.35, 2)
        :bad -> Random.number(random, 0.35, 0.5, 2)
      end

    {twice?, random} = Random.weighted(random, [{false, 2}, {true, 1}])
    {share, random} = Random.number(random, 0.01, 0.3, 2)
    {least, random} = Random.whole(random, 0, 50)
    {slow, random} = Random.weighted(random, usual: 5, fast: 2, slow: 2)

    {more, random} =
      case slow do
        :usual -> {45, random}
        :fast -> Random.whole(random, 0, 10)
        :slow -> Random.whole(random, 100, 300)
      end

    delay_ms = if slow == :usual, do: {5, 50}, else: {least, least + more}
    {[loss: loss, duplicates: if(twice?, do: share, else: 0.0), delay_ms: delay_ms], random}
  end

  defp mission(random) do
    {kind, random} = Random.pick(random, [:column, :line, :wedge, :triangle, :diamond, :circle])
    {near?, random} = Random.weighted(random, [{true, 2}, {false, 1}])
    {spacing, random} = Random.number(random, 0.8, 2.0, 1)
    {assign, random} = Random.weighted(random, cost: 3, chain: 1)
    {change?, random} = Random.weighted(random, [{true, 4}, {false, 1}])
    {policy, random} = Random.weighted(random, available: 3, majority: 1)

    {lost_link, random} =
      Random.weighted(random, [{nil, 5}, {:stop, 1}, {:hold, 1}, {:continue, 1}])

    {[
       formation: {kind, if(near?, do: 1.0, else: spacing)},
       assign: assign,
       leader_change: change?,
       policy: policy,
       lost_link: lost_link
     ], random}
  end

  defp landmark(where, random, _plan, _fleet) when where in [:default, :none],
    do: {where, random}

  defp landmark(where, random, plan, {robots, world}) do
    {width, height} = Sim.Floorplan.size(plan)
    whole = {-width / 2, -height / 2, width / 2, height / 2}
    {place, random} = place(random, plan, if(where == :room, do: plan.room, else: whole))
    # The fleet must still have room to start.
    {:ok, profiles} = Options.bodies(robots, [])
    bodies = for id <- robots, do: {id, profiles[id].radius}
    fits? = match?({:ok, _starts}, Sim.Floorplan.starts(plan, bodies, world, place))
    {if(fits?, do: place, else: :default), random}
  end

  # A place where the landmark can stand; the centre, which is free in all maps, if it finds none.
  defp place(random, plan, rectangle, left \\ @places)
  defp place(random, _plan, _rectangle, 0), do: {{0.0, 0.0}, random}

  defp place(random, plan, {low_x, low_y, high_x, high_y} = rectangle, left) do
    {x, random} = Random.number(random, low_x, high_x, 1)
    {y, random} = Random.number(random, low_y, high_y, 1)

    if Places.check_landmarks(plan, [{x, y}]) == :ok,
      do: {{x, y}, random},
      else: place(random, plan, rectangle, left - 1)
  end

  # So that most fleets have time to form again before the run ends.
  defp last_s(duration_s), do: max(duration_s - @rest_s, @first_s)

  # What happens during a run, in whole seconds; `place` draws where the landmark can be moved to.
  defp events(random, robots, duration_s, place) do
    last_s = last_s(duration_s)
    {moves, random} = moves(random, last_s, place)
    {kills, random} = kills(random, robots, last_s)
    {cuts, random} = cuts(random, robots, last_s)
    {[moves: moves, kills: kills, cuts: cuts], random}
  end

  defp moves(random, last_s, place) do
    {count, random} = Random.weighted(random, [{0, 5}, {1, 3}, {2, 1}, {3, 1}])

    {moves, random} =
      Random.times(random, count, fn random ->
        {place, random} = place.(random)
        {at_s, random} = Random.whole(random, @first_s, last_s)
        {{place, at_s}, random}
      end)

    {Enum.sort_by(moves, &elem(&1, 1)), random}
  end

  # At most half of the fleet dies.
  defp kills(random, robots, last_s) do
    {count, random} = Random.weighted(random, [{0, 5}, {1, 4}, {2, 2}, {3, 1}])

    {kills, random} =
      Random.times(random, min(count, div(length(robots), 2)), fn random ->
        {leader?, random} = Random.weighted(random, [{true, 1}, {false, 1}])
        {robot, random} = Random.pick(random, robots)
        {at_s, random} = Random.whole(random, @first_s, last_s)
        {{if(leader?, do: :leader, else: robot), at_s}, random}
      end)

    {Enum.sort_by(kills, fn {who, at_s} -> {at_s, who} end), random}
  end

  defp cuts(random, [_only], _last_s), do: {[], random}

  defp cuts(random, robots, last_s) do
    {count, random} = Random.weighted(random, [{0, 5}, {1, 3}, {2, 2}, {3, 1}])
    {cuts, random} = Random.times(random, count, &cut(&1, robots, last_s))
    {Enum.sort_by(cuts, &elem(&1, 0)), random}
  end

  defp cut(random, robots, last_s) do
    {from_s, random} = Random.whole(random, 0, last_s - 1)
    {length_s, random} = Random.weighted(random, short: 2, long: 3, for_ever: 1)

    {to_s, random} =
      case length_s do
        :short -> Random.whole(random, from_s + 1, min(from_s + 5, last_s))
        :long -> Random.whole(random, from_s + 1, min(from_s + 60, last_s))
        :for_ever -> {:end, random}
      end

    {what, random} = what(random, robots)
    {{from_s, to_s, what}, random}
  end

  defp what(random, robots) do
    {kind, random} = Random.weighted(random, groups: 4, link: 2, way: 2)
    {mixed, random} = Random.shuffle(random, robots)

    case kind do
      :groups ->
        {first, random} = Random.whole(random, 1, length(robots) - 1)
        {left, right} = Enum.split(mixed, first)
        {[Enum.sort(left), Enum.sort(right)], random}

      way ->
        [a, b | _others] = mixed
        {{way, a, b}, random}
    end
  end

  # A script, by time: robots that freeze, or see or hear nothing for a while, parts of their program that crash or hang, a
  # radio that becomes worse for a while, people who press the emergency stop and start again, or ask for another shape.
  defp faults(random, robots, duration_s, loss) do
    {count, random} = Random.weighted(random, [{0, 6}, {1, 3}, {2, 2}, {3, 1}])

    {scripts, random} =
      Random.times(random, count, fn random ->
        {at_s, random} = Random.whole(random, @first_s, last_s(duration_s))
        {leader?, random} = Random.weighted(random, [{true, 1}, {false, 2}])
        {robot, random} = Random.pick(random, robots)

        {kind, random} =
          Random.weighted(random,
            freeze: 4,
            blind: 3,
            deaf: 3,
            crash: 3,
            hang: 3,
            loss: 2,
            estop: 2,
            shape: 2
          )

        script(kind, at_s, if(leader?, do: :leader, else: robot), loss, random)
      end)

    {scripts |> Enum.concat() |> Enum.sort_by(&elem(&1, 0)), random}
  end

  defp script(kind, at_s, who, _loss, random) when kind in [:freeze, :blind, :deaf] do
    {for_s, random} = Random.number(random, 0.5, 12.0, 1)
    {[{at_s, {kind, who, for_s}}], random}
  end

  # A robot that begins anew stands until a person starts it.
  defp script(:crash, at_s, who, _loss, random) do
    {role, random} = Random.pick(random, [:gate, :executive, :pilot, :estop, :comms])
    {for_s, random} = Random.whole(random, 1, 5)
    {[{at_s, {:crash, who, role}}, {at_s + for_s, {:tell, :all, :start}}], random}
  end

  defp script(:hang, at_s, who, _loss, random) do
    {role, random} = Random.pick(random, [:executive, :pilot])
    {for_s, random} = Random.number(random, 0.2, 3.0, 1)
    {[{at_s, {:hang, who, role, for_s}}, {at_s + ceil(for_s) + 1, {:tell, :all, :start}}], random}
  end

  defp script(:loss, at_s, _who, loss, random) do
    {share, random} = Random.number(random, 0.2, 0.5, 2)
    {for_s, random} = Random.whole(random, 2, 30)
    {[{at_s, {:loss, share}}, {at_s + for_s, {:loss, loss}}], random}
  end

  defp script(:estop, at_s, who, _loss, random) do
    {for_s, random} = Random.whole(random, 2, 10)

    {[
       {at_s, {:estop, who}},
       {at_s + for_s, {:reset}},
       {at_s + for_s + 1, {:tell, :all, :start}}
     ], random}
  end

  defp script(:shape, at_s, _who, _loss, random) do
    {kind, random} = Random.pick(random, [:column, :line, :wedge, :triangle, :diamond, :circle])
    {spacing, random} = Random.number(random, 0.8, 2.0, 1)
    {[{at_s, {:tell, :all, {:formation, kind, spacing}}}], random}
  end
end
