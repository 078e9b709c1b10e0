defmodule Swarm.Formation.Space do
  @moduledoc """
  Decides where robots of a size can stand: beside bodies that stay where they are, and clear of the walls that the leader knows
  (`Nav.Grid`, `nil` for none). Pure; metres, in the frame of the map.
  """
  alias Hal.Pose
  alias Nav.Grid

  # The gap from edge to edge between a standing robot and a body, and between a standing robot and a wall.
  @gap 0.2
  @from_wall 0.1
  # The room beside a robot that drives from one place to another.
  @beside 0.03

  @enforce_keys [:radius]
  defstruct @enforce_keys ++ [bodies: [], grid: nil]

  @type t :: %__MODULE__{
          radius: float(),
          bodies: [{x :: float(), y :: float(), radius :: float()}],
          grid: Grid.t() | nil
        }

  @doc """
  Whether a robot can stand there.

      iex> space = %Swarm.Formation.Space{radius: 0.2, bodies: [{1.0, 0.0, 0.2}]}
      iex> for x <- [0.0, 0.5], do: Swarm.Formation.Space.free?(space, {x, 0.0})
      [true, false]
  """
  @spec free?(t(), Pose.t() | Pose.point()) :: boolean()
  def free?(%__MODULE__{radius: radius} = space, place) do
    Enum.all?(space.bodies, fn {x, y, other} ->
      Pose.distance(place, {x, y}) >= radius + other + @gap
    end) and
      (space.grid == nil or Grid.free?(space.grid, point(place), radius + @from_wall))
  end

  @doc "Whether a way leads from one place to another, past the walls."
  @spec way?(t(), Pose.t() | Pose.point(), Pose.t() | Pose.point()) :: boolean()
  def way?(%__MODULE__{grid: nil}, _from, _to), do: true

  def way?(%__MODULE__{grid: grid, radius: radius}, from, to),
    do: Grid.Way.find(grid, point(from), point(to), radius + @beside) != nil

  @doc "Whether no wall is between two places, so that a robot can drive straight from one to the other."
  @spec joined?(t(), Pose.t() | Pose.point(), Pose.t() | Pose.point()) :: boolean()
  def joined?(%__MODULE__{grid: nil}, _a, _b), do: true

  def joined?(%__MODULE__{grid: grid, radius: radius}, a, b),
    do: Grid.passes?(grid, point(a), point(b), radius + @beside)

  defp point(%Pose{} = pose), do: Pose.point(pose)
  defp point(point), do: point
end
