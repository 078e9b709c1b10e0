defmodule Nav.Frontiers.Choice do
  @moduledoc """
  Decides which frontier a robot goes to: the one with the least cost, where what others are going to see costs extra (Burgard, Moors,
  Stachniss and Schneider 2005, section III). Pure.

  Each tells to where it goes and how far that is for it. Of two that are after the same place, that with the shorter way has
  it, and of equal ones the first by name; for the other one it costs extra. So whatever two robots know of each other, they
  decide the same about it.
  """
  alias Hal.Pose
  alias Nav.Frontiers

  # A place within `@sees` m of another robot's target costs `@extra` m more.
  @sees 5.0
  @extra 12.0
  # A robot keeps going where it goes unless another place costs so many metres less.
  @keep 1.5
  @same 1.6

  @typedoc "To where another robot goes, and how far that is for it."
  @type goal :: {atom(), Pose.point(), far :: float()}

  @doc """
  The frontier to go to, or `nil` without any. `last` is where the robot was going.

      iex> [near, far] = for x <- [2.0, 9.0], do: %{at: {x, 0.0}, far: x, size: 5, square: round(x)}
      iex> for goals <- [[], [{:mag2, {2.5, 0.0}, 1.0}], [{:mag2, {2.5, 0.0}, 3.0}]],
      ...>     do: Nav.Frontiers.Choice.of([near, far], :mag1, nil, goals).at
      [{2.0, 0.0}, {9.0, 0.0}, {2.0, 0.0}]
  """
  @spec of([Frontiers.frontier()], atom(), Pose.point() | nil, [goal()]) ::
          Frontiers.frontier() | nil
  def of(frontiers, me, last, goals),
    do: Enum.min_by(frontiers, &{cost(&1, me, last, goals), &1.square}, fn -> nil end)

  defp cost(%{at: at, far: far}, me, last, goals) do
    seen =
      for {id, goal, theirs} <- goals, {theirs, id} < {far, me}, reduce: 0.0 do
        seen -> seen + max(0.0, 1.0 - Pose.distance(at, goal) / @sees)
      end

    kept = if last != nil and Pose.distance(at, last) < @same, do: @keep, else: 0.0
    far + @extra * seen - kept
  end
end
