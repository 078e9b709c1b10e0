defmodule Missions.Landmark.Follower.Facing do
  @moduledoc false
  # Turns a follower that has been unsure of its place in its slot for 4 s to what it can make sure by: the leader, the landmark
  # and the robots ahead, one after the other, as far as no wall hides them; then, by a floor plan, all round, because its sonars
  # hear the walls anew at each angle. It stays turned, because it would not be in place while it turned back. Pure.
  alias Hal.Pose
  alias Missions.Landmark
  alias Missions.Landmark.SlotPoses
  alias Nav.Grid

  @unsure_ms 4_000
  # A line of sight is a disc of this radius (metres), less than the clearance of any free cell.
  @ray 0.01
  # All round in three turns, each of which is over by then (radians from the slot's heading).
  @round [2.1, -2.1, 0.0]
  # A slot that moved by less (metres) is the same one.
  @same 0.2

  defstruct unsure_ms: nil, toward: nil

  @typedoc "It has been unsure since `unsure_ms`, and stands in a slot with a heading `toward` something."
  @type t :: %__MODULE__{
          unsure_ms: integer() | nil,
          toward: {Pose.t(), heading :: float()} | nil
        }

  @typedoc "Whether a follower is away from its slot, near it and still `:turning`, in it and `:unsure` of that, or in place."
  @type where :: :away | :turning | :unsure | :in_place

  @doc "One tick; `leader` is the leader's pose."
  @spec note(t(), Landmark.State.t(), Pose.t(), where(), leader :: Pose.t()) :: t()
  def note(facing, %{now_ms: now} = mission, slot, where, leader) do
    since_ms = since(facing, where, now)
    toward = facing.toward
    toward = if toward && Pose.distance(elem(toward, 0), slot) < @same, do: toward
    facing = %{facing | unsure_ms: since_ms, toward: toward}

    with true <- where == :unsure and now - since_ms >= @unsure_ms,
         [_ | _] = headings <- headings(mission, slot, leader) do
      heading = Enum.at(headings, rem(div(now - since_ms, @unsure_ms) - 1, length(headings)))
      %{facing | toward: {slot, heading}}
    else
      _sure -> facing
    end
  end

  @doc "The slot with the heading in which the robot shall stand there."
  @spec turned(t(), Pose.t()) :: Pose.t()
  def turned(%__MODULE__{toward: nil}, slot), do: slot
  def turned(%__MODULE__{toward: {_slot, heading}}, slot), do: %{slot | heading: heading}

  defp since(%{unsure_ms: since_ms}, :unsure, now), do: since_ms || now
  defp since(%{unsure_ms: since_ms}, :turning, _now), do: since_ms
  defp since(_facing, _sure_or_away, _now), do: nil

  defp headings(%{percept: percept} = mission, slot, leader) do
    seen = for mark <- visible(mission, leader), do: heading(percept.pose, mark)

    round =
      for turn <- @round,
          match?(%Grid{closed?: true}, percept.grid),
          do: Pose.wrap(slot.heading + turn)

    seen ++ round
  end

  defp heading(pose, {x, y}), do: :math.atan2(y - pose.y, x - pose.x)

  # A robot that does not know walls takes one robot for another.
  defp visible(%{anchor: anchor, percept: %{grid: grid} = percept} = mission, leader) do
    ahead = for id <- Enum.take_while(anchor.order, &(&1 != mission.me)), do: percept.peers[id]
    robots = for %{pose: pose} <- ahead, do: Pose.point(pose)
    from = Pose.point(percept.pose)

    for at <- [Pose.point(leader), SlotPoses.landmark(anchor) | robots],
        at != nil and grid != nil and Grid.free_line?(grid, from, at, @ray),
        do: at
  end
end
