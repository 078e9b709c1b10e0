defmodule Missions.Landmark.Lookout.Legs do
  @moduledoc false
  # Decides to which place a robot goes next on its search from room to room (`Missions.Landmark.Lookout`), and to which it leaves
  # others. Pure; metres, in the frame of the map.
  alias Hal.Pose
  alias Missions.Landmark
  alias Missions.Landmark.Coverage
  alias Nav.{Frontiers, Grid}

  # Frontiers within so many metres of one that it has been to, or did not get to, are not gone to again.
  @again 0.6
  # One so near to that to which it goes (metres) is the same, a little farther on.
  @same 1.0
  # The robot nearer to a place has this much around it to itself (metres); others wait for what it sees.
  @taken 3.0
  # It would rather stand with so much room around it (metres), not in a doorway.
  @room 0.8
  @least_room 0.2
  # So near to where it turned (metres) it still stands there.
  @still 0.3
  @no_walls %Grid{
    clear: <<255>>,
    width: 1,
    height: 1,
    cell: 0.1,
    left: 0.0,
    low: 0.0,
    closed?: false
  }
  # So many places where others turned are looked at at once.
  @at_once 8

  @enforce_keys [:coverage]
  defstruct @enforce_keys ++
              [
                area: 0.0,
                heard: [],
                open: [],
                target: nil,
                stand: nil,
                tried: [],
                missed: 0,
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
  leg number `leg`, since `leg_ms`, or `nil` as long as another one goes there. `tried` are those to which it went, so many of which it
  `missed`, because it did not get there. `others` are the goals that others
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
          missed: non_neg_integer(),
          others: %{atom() => Frontiers.Choice.goal() | nil},
          at: Pose.point() | nil,
          leg: non_neg_integer(),
          leg_ms: integer(),
          planned_ms: integer(),
          arrived?: boolean(),
          told?: boolean()
        }

  @doc "Looks for what is left, once the robot has turned, or others have; `nil` where it has no room, and so does not know."
  @spec plan(t(), Landmark.State.t()) :: t() | nil
  def plan(lookout, %{percept: percept} = mission) do
    grid = percept.grid || @no_walls
    {now, later} = Enum.split(lookout.heard, @at_once)
    coverage = Enum.reduce(now, lookout.coverage, &Coverage.look(&2, grid, &1))
    raster = Coverage.raster(coverage)

    field = Frontiers.find(raster, Pose.point(percept.pose), percept.profile.radius)

    if field do
      lookout = %{lookout | coverage: coverage, area: Coverage.area(coverage), heard: later}
      open = Enum.reject(field.found, &tried?(lookout, &1))
      choose(%{lookout | open: open, planned_ms: mission.now_ms}, mission)
    end
  end

  defp tried?(%{tried: tried}, %{at: at}), do: Enum.any?(tried, &(Pose.distance(&1, at) < @again))

  @doc "Without a place to which it does not get."
  @spec give_up(t(), Pose.point()) :: t()
  def give_up(lookout, at) do
    lookout = %{
      lookout
      | tried: [at | lookout.tried],
        missed: lookout.missed + 1,
        target: nil,
        stand: nil
    }

    %{lookout | open: Enum.reject(lookout.open, &tried?(lookout, &1))}
  end

  @doc "Chooses among what is left by what others have told since; a robot on its way keeps to what it chose, if it can."
  @spec choose(t(), Landmark.State.t()) :: t()
  def choose(%{target: last} = lookout, mission) do
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
    Pose.distance(here, lookout.at) < @still or (grid != nil and Grid.free?(grid, here, @room))
  end

  # The goals of robots that still search.
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
end
