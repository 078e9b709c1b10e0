defmodule Robot.Localiser.InSight do
  @moduledoc """
  Leaves out the robots that walls hide, by the floor plan: a picture shows nothing of them, and none of its blobs can be one.
  Pure.

  A robot counts as hidden if no line from where this robot may be, the estimate and one standard deviation to both sides of it
  along the direction of its greatest uncertainty, leads to its middle or to either side of it.
  """
  alias Hal.Pose
  alias Robot.Localiser.{Anchors, Belief}
  alias Robot.Navigation.Grid

  # A line that is nearer to a wall than this (metres) does not pass it.
  @beside 0.02
  # An uncertainty up to this (metres) counts as none.
  @sure 0.1

  @doc "The marks that may be in sight from a pose of this belief; all of them without a plan."
  @spec marks([Anchors.mark()], Grid.t() | nil, Belief.t(), Pose.t()) :: [Anchors.mark()]
  def marks(marks, nil, _belief, _pose), do: marks

  def marks(marks, grid, belief, %Pose{} = pose) do
    places = places(belief, pose)
    Enum.filter(marks, fn mark -> Enum.any?(places, &seen?(grid, &1, mark)) end)
  end

  @doc "The marks that are in sight from a place (metres), by the plan."
  @spec from([Anchors.mark()], Grid.t() | nil, Pose.point()) :: [Anchors.mark()]
  def from(marks, nil, _place), do: marks
  def from(marks, grid, place), do: Enum.filter(marks, &seen?(grid, place, &1))

  defp places(belief, %Pose{x: x, y: y}) do
    {worst, _least, direction} = Belief.spread(belief)
    {dx, dy} = {worst * :math.cos(direction), worst * :math.sin(direction)}
    if worst > @sure, do: [{x, y}, {x + dx, y + dy}, {x - dx, y - dy}], else: [{x, y}]
  end

  defp seen?(grid, {px, py} = place, %{at: {x, y} = at, radius: radius}) do
    share = radius / max(Pose.distance(place, at), radius)
    {aside, up} = {(py - y) * share, (x - px) * share}

    Grid.free_line?(grid, place, at, @beside) or
      Grid.free_line?(grid, place, {x + aside, y + up}, @beside) or
      Grid.free_line?(grid, place, {x - aside, y - up}, @beside)
  end
end
