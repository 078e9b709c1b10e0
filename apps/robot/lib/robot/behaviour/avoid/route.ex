defmodule Robot.Behaviour.Avoid.Route do
  @moduledoc false
  # Chooses a route to a goal around standing obstacles, and keeps to it: a route with wide
  # clearance is preferred unless it is much longer, and the previous route is kept unless another
  # is clearly shorter. Otherwise a robot between two equally good routes would oscillate. Pure.
  alias Hal.Pose
  alias Robot.Percept
  alias Nav.{Grid, PathPlanner}
  alias Robot.Behaviour.Avoid.Neighbours
  alias Robot.Safety.Reflex.Body

  @enforce_keys [:corners, :goal, :at_ms]
  defstruct @enforce_keys ++ [way?: true, rough?: false, shut_ms: nil]

  @typedoc """
  `way?` is `false` if walls leave no way, whatever else stands about; this route ignores them then. `rough?`: a wall is on it as it was found, because the
  robot or its goal is too near to one. `shut_ms` is since when the walls have had no gap, however narrow.
  """
  @type t :: %__MODULE__{
          corners: [Pose.point(), ...],
          goal: Pose.point(),
          at_ms: integer(),
          way?: boolean(),
          rough?: boolean(),
          shut_ms: integer() | nil
        }

  # Clearance between the bodies (metres): the preferred one, the fallback, and the least one.
  @roomy 0.2
  @tight 0.1
  @tightest 0.06
  # A route with wide clearance may be this much longer (metres) than a tight one.
  @detour 2.0
  # A new route must be this much shorter (metres) than the old one; one is searched this often.
  @better 0.5
  @again_ms 800
  # Where there was none it is searched less often, because that takes longest.
  @walled_ms 2_000
  # A goal that moved farther than this (metres) needs a new route.
  @same_goal 0.4
  # Walls are known better than bodies: a line may pass them at this distance (metres), and a way keeps that one, if
  # there is one so wide.
  @by_wall 0.03
  @from_wall 0.08
  # Sonars draw a door narrower than it is, but leave a gap of this radius (metres); and what stands in one for so long is a
  # wall.
  @gap 0.05
  @shut_ms 5_000

  @doc """
  The place at which to stand if a body that will not move occupies the goal (a dead or holding
  robot, a disc): beside that body, on the side where the goal is, or on this robot's side if the
  goal is near the body's middle. `nil` if the goal is free.
  """
  @spec taken(Pose.point() | nil, Percept.t(), [Neighbours.t()], [PathPlanner.disc()]) ::
          Pose.point() | nil
  def taken(nil, _percept, _robots, _discs), do: nil

  def taken(goal, percept, robots, discs) do
    fixed = for(r <- robots, r.fixed?, do: body(r)) ++ discs
    own = percept.profile.radius

    Enum.find_value(fixed, fn {x, y, radius} ->
      limit = own + radius + @tightest
      distance = Pose.distance(goal, {x, y})

      if distance < limit - 0.02 do
        # On the goal's side if the goal is off the body's middle, else on this robot's side.
        side = if distance > 0.15, do: goal, else: Pose.point(percept.pose)
        angle = :math.atan2(elem(side, 1) - y, elem(side, 0) - x)
        {x + (limit + 0.04) * :math.cos(angle), y + (limit + 0.04) * :math.sin(angle)}
      end
    end)
  end

  @doc "The remaining corners of the route, the goal last; only the goal if none is found."
  @spec round(t() | nil, Pose.point(), Percept.t(), [Neighbours.t()], [PathPlanner.disc()]) :: t()
  def round(old, goal, percept, robots, discs) do
    from = Pose.point(percept.pose)
    own = percept.profile.radius
    bodies = fn fixed? -> for r <- robots, r.standing?, r.fixed? or not fixed?, do: body(r) end
    grown = fn list, margin -> Enum.map(list, &grow(&1, own, margin, from, goal)) end
    all = bodies.(false) ++ discs
    kept = keep(old, goal, from, grown.(all, @tightest), percept)

    if kept != nil and percept.at_ms - kept.at_ms < again_ms(kept) do
      kept
    else
      fixed = bodies.(true) ++ discs

      past_bodies =
        roomy(from, goal, grown.(all, @roomy), fn ->
          PathPlanner.way(from, goal, grown.(all, @tight))
        end) ||
          PathPlanner.way(from, goal, grown.(all, @tightest)) ||
          PathPlanner.way(from, goal, grown.(fixed, @tight)) || [goal]

      bodies = [grown.(all, @tight), grown.(fixed, @tightest), []]
      corners = past_walls(past_bodies, from, goal, percept, bodies)

      new = %__MODULE__{
        corners: corners || past_bodies,
        goal: goal,
        at_ms: percept.at_ms,
        way?: corners != nil,
        rough?: corners == nil or not no_wall?(corners, from, percept),
        shut_ms: if(corners == nil, do: shut_ms(kept, from, goal, percept))
      }

      better(kept, new, from)
    end
  end

  defp shut_ms(kept, from, goal, %{grid: grid, at_ms: at_ms}) do
    if Grid.Way.find(grid, from, goal, @gap) == nil, do: (kept && kept.shut_ms) || at_ms
  end

  defp again_ms(%{way?: way?}), do: if(way?, do: @again_ms, else: @walled_ms)

  # The way past the bodies, if no wall stands in it; else one past walls and bodies, or past the walls and those bodies
  # that do not move, or past the walls alone; `nil` if there is none. What only sonars saw may be gone: if it leaves no
  # way, the robot goes by the plan, and looks again.
  defp past_walls(corners, from, goal, %{grid: grid, ways: ways} = percept, bodies) do
    if no_wall?(corners, from, percept, Body.turning_room(percept.profile)) do
      corners
    else
      (ways && round_walls(ways, from, goal, percept.profile, bodies)) ||
        round_walls(grid, from, goal, percept.profile, bodies)
    end
  end

  # The wide margin is that with which the gate lets it turn anywhere on the way.
  defp round_walls(grid, from, goal, %{radius: own} = profile, bodies) do
    wide = max(@from_wall, Body.turning_room(profile) - own)
    way = fn discs, margin -> Grid.Way.find(grid, from, goal, own + margin, discs) end

    # Most places that cannot be reached are behind walls: one search tells.
    with [_ | _] = loosest <- way.([], @by_wall) do
      Enum.find_value(
        for(discs <- Enum.uniq(bodies), margin <- [wide, @by_wall], do: {discs, margin}),
        fn
          {[], @by_wall} -> loosest
          {discs, margin} -> way.(discs, margin)
        end
      )
    end
  end

  defp no_wall?(corners, from, percept, room \\ 0.0)
  defp no_wall?(_corners, _from, %{grid: nil}, _room), do: true

  defp no_wall?([place | rest], from, %{grid: grid, profile: profile} = percept, room) do
    Grid.passes?(percept.ways || grid, from, place, max(room, profile.radius + @by_wall)) and
      no_wall?(rest, place, percept, room)
  end

  defp no_wall?([], _from, _percept, _room), do: true

  defp body(%{at: {x, y}, radius: radius}), do: {x, y, radius}

  defp better(nil, new, _from), do: new
  defp better(%{rough?: true}, new, _from), do: new
  defp better(kept, %{way?: false} = new, _from), do: %{kept | at_ms: new.at_ms}

  defp better(kept, new, from) do
    if left(kept, from) > left(new, from) + @better, do: new, else: %{kept | at_ms: new.at_ms}
  end

  @doc """
  Whether it is known that no way leads to its goal. A floor plan proves it. What sonars have seen is doubtful, and forgotten
  in time: it must leave no gap, and have done so for longer than a person or robot takes to pass a door.
  """
  @spec none?(t(), Percept.t()) :: boolean()
  def none?(%__MODULE__{way?: true}, _percept), do: false
  def none?(_route, %{grid: %{closed?: true}}), do: true

  def none?(%__MODULE__{shut_ms: shut_ms}, %{at_ms: at_ms}),
    do: shut_ms != nil and at_ms - shut_ms >= @shut_ms

  @doc "The length of the route from a place (metres)."
  @spec left(t(), Pose.point()) :: float()
  def left(%__MODULE__{corners: corners}, from), do: length_of(corners, from)

  # The old route from here, if it is still free: a corner is passed when the next one is in view.
  defp keep(nil, _goal, _from, _discs, _percept), do: nil

  defp keep(old, goal, from, discs, percept) do
    if Pose.distance(old.goal, goal) < @same_goal do
      corners = List.replace_at(old.corners, -1, goal)
      corners = prune(corners, from, discs, percept)

      if free?(corners, from, discs) and (old.rough? or no_wall?(corners, from, percept)),
        do: %{old | corners: corners}
    end
  end

  defp prune([_ | [next | _] = rest] = corners, from, discs, percept) do
    if PathPlanner.blocker(from, next, discs) == nil and no_wall?([next], from, percept),
      do: prune(rest, from, discs, percept),
      else: corners
  end

  defp prune(corners, _from, _discs, _percept), do: corners

  defp free?([], _from, _discs), do: true

  defp free?([place | rest], from, discs),
    do: PathPlanner.blocker(from, place, discs) == nil and free?(rest, place, discs)

  # The body grown by the margin; less if this robot or its goal is nearer than that.
  defp grow({x, y, radius}, own, margin, from, goal) do
    tight = own + radius + min(margin, @tightest)
    room = min(Pose.distance(from, {x, y}), Pose.distance(goal, {x, y})) - 0.01
    {x, y, (own + radius + margin) |> min(room) |> max(min(tight, room))}
  end

  defp roomy(from, goal, discs, tight) do
    way = PathPlanner.way(from, goal, discs)

    cond do
      way == nil -> tight.()
      length_of(way, from) < Pose.distance(from, goal) + @detour -> way
      true -> Enum.min_by([{way, 0.0}, {tight.(), @detour}], &cost(&1, from)) |> elem(0)
    end
  end

  defp cost({nil, _}, _from), do: 1.0e9
  defp cost({way, extra}, from), do: length_of(way, from) + extra

  defp length_of(way, from) do
    {length, _} =
      Enum.reduce(way, {0.0, from}, fn place, {length, from} ->
        {length + Pose.distance(from, place), place}
      end)

    length
  end
end
