defmodule Robot.Localiser.InSight do
  @moduledoc """
  Decides whether walls hide a robot, by the floor plan: then a picture shows nothing of it, and none of its blobs can be it.
  Pure. It costs several lines over the grid for each robot, so it is asked last.

  A robot counts as hidden if no line from where this robot may be, the estimate and so many standard deviations to both sides of
  it along the direction of its greatest uncertainty, where no wall is between, leads to its middle or to either side of it; as
  in sight as a whole if all lines do.
  """
  alias Hal.Pose
  alias Robot.Localiser.{Anchors, Belief}
  alias Nav.Grid

  # A line that is nearer to a wall than this (metres) does not pass it.
  @beside 0.02
  # A place up to this far (metres) from the estimate counts as that.
  @sure 0.1

  @enforce_keys [:grid, :places]
  defstruct @enforce_keys

  @typedoc "The plan, `nil` for none, and the places where this robot may be (metres)."
  @type t :: %__MODULE__{grid: Grid.t() | nil, places: [Pose.point()]}

  @doc "What is asked of the plan from a pose of this belief, and from these numbers of standard deviations beside it."
  @spec new(Grid.t() | nil, Belief.t(), Pose.t(), sds :: [float()]) :: t()
  def new(grid, belief, pose, sds \\ [1.0])
  def new(nil, _belief, _pose, _sds), do: %__MODULE__{grid: nil, places: []}

  def new(grid, belief, %Pose{x: x, y: y}, sds) do
    {worst, _least, direction} = Belief.spread(belief)
    {dx, dy} = {worst * :math.cos(direction), worst * :math.sin(direction)}
    sides = for sd <- sds, sd * worst > @sure, k <- [sd, -sd], do: {x + k * dx, y + k * dy}
    free = Enum.filter(sides, &Grid.free_line?(grid, {x, y}, &1, @beside))
    %__MODULE__{grid: grid, places: [{x, y} | free]}
  end

  @doc "Whether a mark may be in sight; always without a plan."
  @spec seen?(t(), Anchors.mark()) :: boolean()
  def seen?(%__MODULE__{grid: nil}, _mark), do: true

  def seen?(%__MODULE__{grid: grid, places: places}, mark),
    do: Enum.any?(places, &seen?(grid, &1, mark))

  @doc "Whether a mark must be in sight from side to side, wherever this robot is; always without a plan."
  @spec whole?(t(), Anchors.mark()) :: boolean()
  def whole?(%__MODULE__{grid: nil}, _mark), do: true

  def whole?(%__MODULE__{grid: grid, places: places}, mark) do
    Enum.all?(places, fn place ->
      Enum.all?(ends(place, mark), &Grid.free_line?(grid, place, &1, @beside))
    end)
  end

  @doc "The marks that are in sight from a place (metres), by the plan."
  @spec from([Anchors.mark()], Grid.t() | nil, Pose.point()) :: [Anchors.mark()]
  def from(marks, nil, _place), do: marks
  def from(marks, grid, place), do: Enum.filter(marks, &seen?(grid, place, &1))

  defp seen?(grid, place, mark),
    do: Enum.any?(ends(place, mark), &Grid.free_line?(grid, place, &1, @beside))

  # Its middle, and both sides of it.
  defp ends({px, py} = place, %{at: {x, y} = at, radius: radius}) do
    share = radius / max(Pose.distance(place, at), radius)
    {aside, up} = {(py - y) * share, (x - px) * share}
    [at, {x + aside, y + up}, {x - aside, y - up}]
  end
end
