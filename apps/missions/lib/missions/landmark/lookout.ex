defmodule Missions.Landmark.Lookout do
  @moduledoc """
  Searches from room to room, once a round has ended in which nobody had found the landmark: each robot goes to the
  nearest place from which it sees what nobody has looked at, turns around there, and so on until the landmark is found or
  nothing is left. Pure.

  Places are frontiers (`Robot.Navigation.Frontiers`) of what has been looked at (`Missions.Landmark.Coverage`). Robots tell
  each other where they have turned and where they go, so that they go apart. A robot that knows nothing of walls has no
  lookout: it wanders.
  """
  alias Hal.Pose
  alias Missions.Landmark
  alias Missions.Landmark.Coverage
  alias Robot.Navigation.{Frontiers, Grid}

  # Frontiers within so many metres of one that it has been to, or did not get to, are not gone to again.
  @again 0.6
  # One so near to that to which it goes (metres) is the same, a little farther on.
  @same 1.0
  # Who is nearer to a place has this much around it to itself (metres); others wait for what it sees.
  @taken 3.0
  # It would rather stand with so much room around it (metres), not in a doorway.
  @room 0.8
  @least_room 0.2
  @no_walls %Grid{
    clear: <<255>>,
    width: 1,
    height: 1,
    cell: 0.1,
    left: 0.0,
    low: 0.0,
    closed?: false
  }
  # Places where others turned that wait to be looked at.
  @most 64
  @leg_ms 60_000
  # What others have looked at is taken into account so often.
  @plan_ms 3_000
  @at_once 8
  @nearness 0.3

  @enforce_keys [:coverage]
  defstruct @enforce_keys ++
              [
                area: 0.0,
                heard: [],
                open: [],
                target: nil,
                stand: nil,
                tried: [],
                others: %{},
                at: nil,
                leg: 0,
                leg_ms: 0,
                planned_ms: 0,
                arrived?: false,
                told?: false
              ]

  @typedoc """
  `coverage` is what has been looked at, `area` m2 of it free, without what can be seen from the places in `heard`, where
  others have turned since. `open` are the frontiers that are left, and `target` the one that it will see: by going to `stand`, which is
  leg number `leg`, since `leg_ms`, or `nil` as long as another one goes there. `tried` are those to which it went. `others` are the goals that others
  told last, `at` is where it turned last, and it has `told?` that and its goal. `arrived?` says that it is at `stand`.
  """
  @type t :: %__MODULE__{
          coverage: Coverage.t(),
          area: float(),
          heard: [Pose.point()],
          open: [Frontiers.frontier()],
          target: Frontiers.frontier() | nil,
          stand: Pose.point() | nil,
          tried: [Pose.point()],
          others: %{atom() => Frontiers.Choice.goal() | nil},
          at: Pose.point() | nil,
          leg: non_neg_integer(),
          leg_ms: integer(),
          planned_ms: integer(),
          arrived?: boolean(),
          told?: boolean()
        }

  @place {:tuple,
          [{:integer, -10_000_000, 10_000_000, "mm"}, {:integer, -10_000_000, 10_000_000, "mm"}],
          "{x, y} in mm"}

  @doc "What robots tell each other: where one has turned around in vain, and where it goes now, so far away."
  @spec message() :: Hal.Options.table()
  def message do
    [
      at: [@place, required: true],
      goal: [{:or, nil, @place}, required: true],
      far_mm: [{:integer, 0, 10_000_000, "mm"}, required: true]
    ]
  end

  @doc "Whether the robot searches by itself, without waiting for others after each turn."
  @spec alone?(Landmark.State.t()) :: boolean()
  def alone?(%{lookout: lookout}), do: lookout != nil

  @doc "Whether something is left to look at."
  @spec left?(Landmark.State.t()) :: boolean()
  def left?(%{lookout: lookout}), do: lookout != nil and lookout.target != nil

  @doc "Whether the robot is where it wanted to turn around, or gave up getting there."
  @spec arrived?(Landmark.State.t()) :: boolean()
  def arrived?(%{lookout: lookout, now_ms: now_ms}),
    do: lookout.arrived? or (lookout.stand != nil and now_ms - lookout.leg_ms >= @leg_ms)

  @doc "After a turn in vain: where to next."
  @spec turned(Landmark.State.t()) :: Landmark.State.t()
  def turned(%{percept: %{pose: pose, grid: grid}, lookout: lookout} = mission)
      when pose == nil or (grid == nil and lookout == nil),
      do: %{mission | lookout: nil}

  def turned(%{percept: %{pose: pose}} = mission) do
    lookout = mission.lookout || %__MODULE__{coverage: %Coverage{}}
    at = Pose.point(pose)
    tried = if lookout.target, do: [lookout.target.at | lookout.tried], else: lookout.tried
    lookout = %{lookout | at: at, heard: [at | lookout.heard], tried: tried}
    plan(%{lookout | target: nil, stand: nil, told?: false}, mission)
  end

  # Looks for what is left once it has turned, or others have.
  defp plan(lookout, %{percept: percept} = mission) do
    grid = percept.grid || @no_walls
    {now, later} = Enum.split(lookout.heard, @at_once)
    coverage = Enum.reduce(now, lookout.coverage, &Coverage.look(&2, grid, &1))
    raster = Coverage.raster(coverage)

    case Frontiers.find(raster, Pose.point(percept.pose), percept.profile.radius) do
      # Where it has no room it does not know what is left.
      nil ->
        %{mission | lookout: nil}

      field ->
        open = Enum.reject(field.found, &tried?(lookout, &1))
        lookout = %{lookout | coverage: coverage, heard: later, open: open}
        lookout = %{lookout | area: Coverage.area(coverage), planned_ms: mission.now_ms}
        %{mission | lookout: choose(lookout, mission)}
    end
  end

  defp tried?(%{tried: tried}, %{at: at}), do: Enum.any?(tried, &(Pose.distance(&1, at) < @again))

  defp choose(%{target: last} = lookout, mission) do
    goals = goals(lookout, mission)
    target = Frontiers.Choice.of(lookout.open, mission.me, last && last.at, goals)
    wait? = target != nil and taken?(target, mission.me, goals) and may_wait?(lookout, mission)

    cond do
      target == nil and last == nil -> lookout
      target == nil -> leg(lookout, mission, nil, nil)
      wait? and last != nil and lookout.stand == nil -> %{lookout | target: target}
      wait? -> leg(lookout, mission, target, nil)
      lookout.stand != nil and Pose.distance(last.at, target.at) < @same -> lookout
      true -> leg(lookout, mission, target, stand(mission.percept, target.at))
    end
  end

  defp leg(lookout, mission, target, stand) do
    %{
      lookout
      | target: target,
        stand: stand,
        leg: lookout.leg + 1,
        leg_ms: mission.now_ms,
        arrived?: false,
        told?: false
    }
  end

  defp taken?(%{at: at, far: far}, me, goals),
    do:
      Enum.any?(goals, fn {id, to, theirs} ->
        {theirs, id} < {far, me} and Pose.distance(to, at) < @taken
      end)

  # It waits where others get past it: where it turned, or where there is room.
  defp may_wait?(lookout, %{percept: %{pose: pose, grid: grid}}) do
    here = Pose.point(pose)
    Pose.distance(here, lookout.at) < @nearness or (grid != nil and Grid.free?(grid, here, @room))
  end

  # Those who still search.
  defp goals(%{others: others}, mission) do
    beats = Landmark.State.beats(mission)

    for {id, goal} <- Enum.sort(others),
        goal != nil and match?(%{phase: phase} when phase in [:wander, :search], beats[id]),
        do: goal
  end

  defp stand(%{grid: nil}, at), do: at

  defp stand(%{grid: grid, profile: profile}, at) do
    Enum.find_value([@room, profile.radius + @least_room], at, fn room ->
      with {:ok, place} <- Grid.Way.near(grid, at, room), do: place, else: (:error -> nil)
    end)
  end

  @doc "What another robot tells. Where it turned counts only for robots that have one plan."
  @spec hear(Landmark.State.t(), atom(), keyword()) :: Landmark.State.t()
  def hear(%{lookout: lookout, percept: %{grid: grid}} = mission, from, said)
      when lookout != nil and grid != nil do
    goal = with {_x, _y} = to <- said[:goal], do: {from, metres(to), said[:far_mm] / 1_000}
    known? = is_map_key(Landmark.State.beats(mission), from)
    heard = if grid.closed?, do: lookout.heard ++ [metres(said[:at])], else: []

    lookout = %{
      lookout
      | others: if(known?, do: Map.put(lookout.others, from, goal), else: lookout.others),
        heard: Enum.take(heard, @most)
    }

    %{
      mission
      | lookout: if(mission.phase == :wander, do: choose(lookout, mission), else: lookout)
    }
  end

  def hear(mission, _from, _said), do: mission

  defp metres({x, y}), do: {x / 1_000, y / 1_000}

  @doc "The end of a leg, by its number: the robot is there, or goes elsewhere if it cannot get there."
  @spec ended(Landmark.State.t(), non_neg_integer(), outcome :: integer()) :: Landmark.State.t()
  def ended(%{lookout: %{leg: leg, target: %{at: at}} = lookout} = mission, leg, outcome) do
    if outcome == 1 do
      %{mission | lookout: %{lookout | arrived?: true}}
    else
      lookout = %{lookout | tried: [at | lookout.tried], target: nil, stand: nil}
      open = Enum.reject(lookout.open, &tried?(lookout, &1))
      %{mission | lookout: choose(%{lookout | open: open}, mission)}
    end
  end

  def ended(mission, _earlier, _outcome), do: mission

  @doc "Goes to the next place, or stands if nothing is left, and tells the others."
  @spec act(Landmark.State.t()) :: {Landmark.State.t(), [Robot.Mission.effect()]}
  def act(%{lookout: %{heard: [_ | _], planned_ms: at_ms} = lookout, now_ms: now_ms} = mission)
      when now_ms - at_ms >= @plan_ms do
    case plan(lookout, mission) do
      %{lookout: nil} -> {mission, []}
      planned -> act(planned)
    end
  end

  def act(mission) do
    # Who waits for another one looks whether that is still on its way.
    lookout =
      if mission.lookout.stand, do: mission.lookout, else: choose(mission.lookout, mission)

    {%{mission | lookout: %{lookout | told?: true}},
     tell(lookout) ++ [goal(lookout), {:look, 0.0}]}
  end

  defp goal(%{stand: nil}), do: {:goal, :stand, {Robot.Behaviour.Stop, []}}

  defp goal(%{stand: {x, y}, leg: leg}),
    do: {:goal, {:roam, leg}, {Robot.Behaviour.Goto, x: x, y: y, tolerance: @nearness}}

  defp tell(%{told?: true}), do: []

  defp tell(%{at: at, stand: nil}),
    do: [{:tell, :all, :looked, [at: mm(at), goal: nil, far_mm: 0]}]

  defp tell(%{at: at, target: %{at: goal, far: far}}),
    do: [{:tell, :all, :looked, [at: mm(at), goal: mm(goal), far_mm: round(1_000 * far)]}]

  defp mm({x, y}), do: {round(1_000 * x), round(1_000 * y)}

  @doc "How much has been looked at, for people; `nil` for a robot without a lookout."
  @spec says(Landmark.State.t()) :: String.t() | nil
  def says(%{lookout: nil}), do: nil

  def says(%{lookout: lookout, percept: percept} = mission) do
    area = "#{round(lookout.area)} m²"
    plan? = match?(%{grid: %{closed?: true}}, percept)

    cond do
      mission.phase != :rest -> "has looked at #{area}, goes on to the next room"
      plan? -> "no landmark: has looked at all that it can reach, #{area}"
      true -> "no landmark in the #{area} that it has looked at"
    end
  end
end
