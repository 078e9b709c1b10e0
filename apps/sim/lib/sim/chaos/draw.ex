defmodule Sim.Chaos.Draw do
  @moduledoc """
  Draws the options of a run (`Sim.Trial.Options`) from a seed and the number of the run. Pure.

  Only what is allowed is drawn, and most of it so that a fleet can form: most landmarks stand in
  the room where the fleet starts, most radios lose little, and at least half of the robots
  survive. What happens to a run (`.Events`, `.Faults`) begins no later than 40 s before its end.
  """
  alias Sim.Chaos.Draw.{Events, Faults}
  alias Sim.Chaos.Random
  alias Sim.Trial.{Options, Setup}

  # Fixed lists, so that no draw makes an atom.
  @mags for k <- 1..20, do: :"mag#{k}"
  @mins for k <- 1..20, do: :"min#{k}"
  @places 30

  @typedoc "Opens a map for a fleet of so many robots, as `Sim.Floorplan.open/2` does."
  @type opener :: (String.t(), pos_integer() -> {:ok, Sim.Floorplan.t()} | {:error, String.t()})

  @doc """
  The options of run `number` (from 1) of a seed, as a keyword list in a fixed order. Who draws many
  runs may keep the maps: `open`.

      iex> Sim.Chaos.Draw.options(1, 3) == Sim.Chaos.Draw.options(1, 3)
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
    {events, random} = Events.draw(random, robots, duration_s, &place(&1, plan, plan.room))
    {script, random} = Faults.draw(random, robots, duration_s, radio[:loss])
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

      iex> run = Sim.Chaos.Draw.options(1, 3)
      iex> patrol = Sim.Chaos.Draw.instead(run, {Missions.Patrol, []})
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
    bodies = for id <- robots, do: {id, Setup.profile(id).radius}
    fits? = match?({:ok, _starts}, Sim.Floorplan.starts(plan, bodies, world, place))
    {if(fits?, do: place, else: :default), random}
  end

  # A place where the landmark can stand; the centre, which is free in all maps, if it finds none.
  defp place(random, plan, rectangle, left \\ @places)
  defp place(random, _plan, _rectangle, 0), do: {{0.0, 0.0}, random}

  defp place(random, plan, {low_x, low_y, high_x, high_y} = rectangle, left) do
    {x, random} = Random.number(random, low_x, high_x, 1)
    {y, random} = Random.number(random, low_y, high_y, 1)

    if Setup.check_landmarks(plan, [{x, y}]) == :ok,
      do: {{x, y}, random},
      else: place(random, plan, rectangle, left - 1)
  end
end
