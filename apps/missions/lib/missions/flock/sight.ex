defmodule Missions.Flock.Sight do
  @moduledoc false
  # Says what of the flock and its course a robot sees past the walls that it knows, and where it can go by the rules of the flock
  # alone. Pure; metres, in the frame of the map.
  alias Hal.Pose
  alias Missions.Flock.Members
  alias Nav.{Grid, Reach}
  alias Robot.Percept

  # By the rules of the flock a robot keeps off walls: so much room beside it lets it pass.
  @wide 0.4
  # A place for it beside a point that is too near to a wall has so much more room than it needs.
  @beside 0.2
  # A line with less room than this leads through a wall.
  @wall 0.01
  # Between groups, lines from so many of one to so many of the other are tried.
  @few 8

  @doc "Whether the robot can drive straight from one point to another, by the walls that it knows."
  @spec sees?(Percept.t(), Pose.point(), Pose.point()) :: boolean()
  def sees?(%Percept{grid: nil}, _from, _to), do: true

  def sees?(%Percept{grid: grid, profile: profile}, from, to),
    do: Grid.passes?(grid, from, to, Reach.room(profile.radius))

  @doc "Whether the rules of the flock lead it to a point: it sees it, and is nearer than the spacing, or has room all the way."
  @spec straight?(Percept.t(), Pose.point(), spacing :: float()) :: boolean()
  def straight?(%Percept{grid: nil}, _point, _spacing), do: true

  def straight?(%Percept{grid: grid, pose: pose, profile: profile} = percept, point, spacing) do
    at = Pose.point(pose)

    sees?(percept, at, point) and
      (Pose.distance(at, point) < spacing or
         Grid.free_line?(grid, at, point, profile.radius + @wide))
  end

  @doc """
  Where the robot goes for a point of the course by its own way: there, or to the nearest place with room; that no way leads there,
  in words. Without a point, or without walls that it knows, it goes by none.
  """
  @spec place(Percept.t(), Pose.point() | nil) :: {:ok, Pose.point() | nil} | {:error, String.t()}
  def place(%Percept{grid: grid}, point) when grid == nil or point == nil, do: {:ok, nil}

  def place(%Percept{grid: grid, pose: pose, profile: %{radius: radius}}, {x, y} = point) do
    place = roomy(grid, point, radius)

    with {:error, why} <- Reach.check(grid, Pose.point(pose), place, radius),
         do:
           {:error,
            "no way to #{Float.round(x * 1.0, 1)},#{Float.round(y * 1.0, 1)}: #{Reach.words(why)}"},
         else: (:ok -> {:ok, place})
  end

  defp roomy(grid, point, radius) do
    with {:error, :narrow} <- Reach.place(grid, point, radius),
         {:ok, place} <- Grid.Way.near(grid, point, radius + @beside) do
      place
    else
      _there_or_nowhere -> point
    end
  end

  @doc "Whether no wall lies between two points."
  @spec line?(Grid.t(), Pose.point(), Pose.point()) :: boolean()
  def line?(grid, from, to), do: Grid.free_line?(grid, from, to, @wall)

  @doc "Whether no wall lies between these members and the others: between the 8 of each that are nearest to the middle of the other."
  @spec any?(Grid.t() | nil, [Members.member(), ...], [Members.member(), ...]) :: boolean()
  def any?(nil, _some, _others), do: true

  def any?(grid, some, others) do
    near = nearest(others, Members.middle(some))

    Enum.any?(nearest(some, Members.middle(others)), fn {_id, at} ->
      Enum.any?(near, fn {_other, to} -> line?(grid, at, to) end)
    end)
  end

  defp nearest(members, point),
    do:
      members
      |> Enum.sort_by(fn {id, at} -> {Pose.distance(at, point), id} end)
      |> Enum.take(@few)
end
