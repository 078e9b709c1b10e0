defmodule Missions.Landmark.Lookout do
  @moduledoc false
  # Searches from room to room, once a round has ended in which no robot had found the landmark: each robot goes to the
  # nearest place from which it sees what none has looked at, turns around there, and so on until the landmark is found or
  # nothing is left. Pure.
  #
  # Places are frontiers (`Nav.Frontiers`) of what has been looked at (`Missions.Landmark.Coverage`). Robots tell
  # each other where they have turned and where they go, so that they go apart. A robot that knows nothing of walls, or has no camera, has
  # no lookout: it wanders. `Missions.Landmark.Lookout.Legs` chooses among the places.
  alias Hal.Pose
  alias Missions.Landmark
  alias Missions.Landmark.Coverage
  alias Missions.Landmark.Lookout.Legs

  # Places where others turned that wait to be looked at.
  @most 64
  @leg_ms 60_000
  # What others have looked at is taken into account so often.
  @plan_ms 3_000
  @nearness 0.3

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

  # Nothing counts as looked at that it has only turned about.
  def turned(%{percept: %{profile: %{camera: nil}}} = mission), do: %{mission | lookout: nil}

  def turned(%{percept: %{pose: pose}} = mission) do
    lookout = mission.lookout || %Legs{coverage: %Coverage{}}
    at = Pose.point(pose)
    lookout = %{leave(lookout, mission.now_ms) | at: at, heard: [at | lookout.heard]}
    plan(mission, %{lookout | target: nil, stand: nil, told?: false})
  end

  # A leg that took too long did not come to its end; one that was interrupted, or waited, may still be gone.
  defp leave(%{arrived?: true, target: %{at: at}} = lookout, _now_ms),
    do: %{lookout | tried: [at | lookout.tried]}

  defp leave(%{stand: {_x, _y}, target: %{at: at}, leg_ms: leg_ms} = lookout, now_ms)
       when now_ms - leg_ms >= @leg_ms,
       do: Legs.give_up(lookout, at)

  defp leave(lookout, _now_ms), do: lookout

  defp plan(mission, lookout), do: %{mission | lookout: Legs.plan(lookout, mission)}

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
      | lookout: if(mission.phase == :wander, do: Legs.choose(lookout, mission), else: lookout)
    }
  end

  def hear(mission, _from, _said), do: mission

  defp metres({x, y}), do: {x / 1_000, y / 1_000}

  @doc "The end of a leg, by its number: the robot is there, or goes elsewhere if it cannot get there."
  @spec ended(Landmark.State.t(), non_neg_integer(), outcome :: integer()) :: Landmark.State.t()
  def ended(%{lookout: %{leg: leg, target: %{at: at}} = lookout} = mission, leg, outcome) do
    if outcome == 1,
      do: %{mission | lookout: %{lookout | arrived?: true}},
      else: %{mission | lookout: lookout |> Legs.give_up(at) |> Legs.choose(mission)}
  end

  def ended(mission, _earlier, _outcome), do: mission

  @doc "Goes to the next place, or stands if nothing is left, and tells the others."
  @spec act(Landmark.State.t()) :: {Landmark.State.t(), [Robot.Mission.effect()]}
  def act(%{lookout: %{heard: [_ | _], planned_ms: at_ms} = lookout, now_ms: now_ms} = mission)
      when now_ms - at_ms >= @plan_ms do
    case plan(mission, lookout) do
      %{lookout: nil} = lost -> {lost, []}
      planned -> act(planned)
    end
  end

  def act(mission) do
    # A robot that waits for another one looks whether that is still on its way.
    lookout =
      if mission.lookout.stand, do: mission.lookout, else: Legs.choose(mission.lookout, mission)

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
  def says(%{percept: %{profile: %{camera: nil}}}),
    do: "has no camera, and waits for one that sees the landmark"

  def says(%{lookout: nil}), do: nil

  def says(%{lookout: lookout, percept: percept} = mission) do
    area = "#{round(lookout.area)} m²"
    plan? = match?(%{grid: %{closed?: true}}, percept)

    cond do
      mission.phase != :rest ->
        "has looked at #{area}, goes on to the next room"

      plan? and lookout.missed == 0 ->
        "no landmark: has looked at all that it can reach, #{area}"

      lookout.missed > 0 ->
        "no landmark in the #{area} that it has looked at; places that it did not get to: #{lookout.missed}"

      true ->
        "no landmark in the #{area} that it has looked at"
    end
  end
end
