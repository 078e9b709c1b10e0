defmodule Robot.Localiser.InSight do
  @moduledoc """
  Decides whether walls hide a robot, by the floor plan: then a picture shows nothing of it, and none of its blobs can be it.
  Pure. It costs several lines over the grid for each robot, so it is asked last.

  A robot counts as hidden if no line from where this robot may be, the estimate and one standard deviation to both sides of it
  along the direction of its greatest uncertainty, leads to its middle or to either side of it.
  """
  alias Hal.Pose
  alias Robot.Localiser.{Anchors, Belief}
  alias Nav.Grid

  # A line that is nearer to a wall than this (metres) does not pass it.
  @beside 0.02
  # An uncertainty up to this (metres) counts as none.
  @sure 0.1

  @enforce_keys [:grid, :places]
  defstruct @enforce_keys

  @typedoc "The plan, `nil` for none, and the places where this robot may be (metres)."
  @type t :: %__MODULE__{grid: Grid.t() | nil, places: [Pose.point()]}

  @doc "What is asked of the plan from a pose of this belief."
  @spec new(Grid.t() | nil, Belief.t(), Pose.t()) :: t()
  def new(nil, _belief, _pose), do: %__MODULE__{grid: nil, places: []}

  def new(grid, belief, %Pose{x: x, y: y}) do
    {worst, _least, direction} = Belief.spread(belief)
    {dx, dy} = {worst * :math.cos(direction), worst * :math.sin(direction)}
    sides = if worst > @sure, do: [{x + dx, y + dy}, {x - dx, y - dy}], else: []
    %__MODULE__{grid: grid, places: [{x, y} | sides]}
  end

  @doc "Whether a mark may be in sight; always without a plan."
  @spec seen?(t(), Anchors.mark()) :: boolean()
  def seen?(%__MODULE__{grid: nil}, _mark), do: true

  def seen?(%__MODULE__{grid: grid, places: places}, mark),
    do: Enum.any?(places, &seen?(grid, &1, mark))

  @doc "The marks that are in sight from a place (metres), by the plan."
  @spec from([Anchors.mark()], Grid.t() | nil, Pose.point()) :: [Anchors.mark()]
  def from(marks, nil, _place), do: marks
  def from(marks, grid, place), do: Enum.filter(marks, &seen?(grid, place, &1))

  defp seen?(grid, {px, py} = place, %{at: {x, y} = at, radius: radius}) do
    share = radius / max(Pose.distance(place, at), radius)
    {aside, up} = {(py - y) * share, (x - px) * share}

    Grid.free_line?(grid, place, at, @beside) or
      Grid.free_line?(grid, place, {x + aside, y + up}, @beside) or
      Grid.free_line?(grid, place, {x - aside, y - up}, @beside)
  end
end
