defmodule Nav.KnownWalls do
  @moduledoc """
  Holds what a robot knows of walls, by a floor plan, by its sonars, or by both. Pure.

  With a floor plan the robot also remembers what its sonars surely see where the plan shows free space: a door that is
  shut, furniture that is not drawn (`Nav.OccupancyGrid`). Its ways lead round that as round walls, but it
  proves nothing: it may be gone, and is forgotten in time. So `known/1` is the plan alone, for all that reasons by
  walls, and `ways/1` the plan with what was seen, for ways. The plan is one term, which the robots of a node share; a
  copy with what was seen is made only when that changes, at most once a second.
  """
  alias Nav.{Grid, OccupancyGrid}

  defstruct plan: nil, sensed: nil, ways: nil

  @typedoc "`ways` is the plan with the walls of `sensed`, `nil` as long as there are none."
  @type t :: %__MODULE__{
          plan: Grid.t() | nil,
          sensed: OccupancyGrid.t() | nil,
          ways: Grid.t() | nil
        }

  @doc "Of a floor plan, of what sonars will see (an empty `OccupancyGrid`), or of nothing."
  @spec new(Grid.t() | OccupancyGrid.t() | nil) :: t()
  def new(%Grid{} = plan), do: %__MODULE__{plan: plan, sensed: OccupancyGrid.new()}
  def new(sensed_or_none), do: %__MODULE__{sensed: sensed_or_none}

  @doc """
  Takes the sonars of a percept; `discs` are standing things that are known (map frame, metres). `plan?` says that the pose
  is corrected by the floor plan: else the robot cannot tell what is not on it, and keeps nothing beside it.
  """
  @spec update(t(), Nav.percept(), [OccupancyGrid.disc()], plan? :: boolean()) :: t()
  def update(walls, percept, discs, plan? \\ true)
  def update(%__MODULE__{sensed: nil} = walls, _percept, _discs, _plan?), do: walls
  def update(%__MODULE__{plan: %Grid{} = plan}, _percept, _discs, false), do: new(plan)

  def update(%__MODULE__{sensed: before, plan: plan} = walls, percept, discs, _plan?) do
    sensed = OccupancyGrid.update(before, percept, discs, plan)
    seen = OccupancyGrid.grid(sensed)

    cond do
      plan == nil or seen == OccupancyGrid.grid(before) -> %{walls | sensed: sensed}
      seen == nil -> %{walls | sensed: sensed, ways: nil}
      true -> %{walls | sensed: sensed, ways: Grid.overlay(plan, seen)}
    end
  end

  @doc "The floor plan; without one, what the sonars have surely seen. `nil` for nothing."
  @spec known(t()) :: Grid.t() | nil
  def known(%__MODULE__{plan: nil, sensed: nil}), do: nil
  def known(%__MODULE__{plan: nil, sensed: sensed}), do: OccupancyGrid.grid(sensed)
  def known(%__MODULE__{plan: plan}), do: plan

  @doc "The floor plan with what sonars have surely seen; `nil` where that adds nothing to `known/1`."
  @spec ways(t()) :: Grid.t() | nil
  def ways(%__MODULE__{ways: ways}), do: ways
end
