defmodule Nav.Reach do
  @moduledoc """
  Decides whether a robot can get to a place, by what it knows of walls. Pure; metres, in the frame of the map.

  The same ways as those that it drives (`Robot.Behaviour.Avoid.Route`): where this finds one, it finds one, too. Bodies that
  stand about do not count, as they may go away.
  """
  alias Hal.Pose
  alias Nav.Grid

  # The least distance from walls that a way keeps (metres).
  @by_wall 0.03
  # It stops so far from a wall that it drives at (`Robot.Safety.Reflex`).
  @stop 0.15
  # A robot has arrived within so much of its goal; so far off may the nearest place with that room be, plus half a cell's
  # diagonal.
  @there 0.1

  @type refusal :: :wall | :outside | :narrow | :no_way

  @doc "The room that a robot of this radius needs on its ways (metres)."
  @spec room(radius :: float()) :: float()
  def room(radius), do: radius + @by_wall

  @doc """
  Whether a robot of this radius can stand at a place, and drive there from another one, which may be `nil`: unknown.
  Without a grid nothing is known against it.

      iex> row = fn k -> if k == 3, do: <<1, 1, 1, 1, 1, 1, 1>>, else: <<0::56>> end
      iex> grid = Nav.Grid.new(for(k <- 0..6, into: <<>>, do: row.(k)), {7, 7}, 1.0, {0.0, 0.0})
      iex> for goal <- [{1.5, 1.5}, {1.5, 3.5}, {9.0, 1.0}, {1.5, 5.5}],
      ...>     do: Nav.Reach.check(grid, {5.5, 1.5}, goal, 0.2)
      [:ok, {:error, :wall}, {:error, :outside}, {:error, :no_way}]
  """
  @spec check(Grid.t() | nil, Pose.point() | nil, Pose.point(), radius :: float()) ::
          :ok | {:error, refusal()}
  def check(nil, _from, _goal, _radius), do: :ok

  def check(grid, from, goal, radius) do
    with :ok <- place(grid, goal, radius) do
      if from == nil or Grid.Way.find(grid, from, goal, room(radius)) != nil,
        do: :ok,
        else: {:error, :no_way}
    end
  end

  @doc "Whether it can stand there, or as near as counts as there, without asking for a way."
  @spec place(Grid.t() | nil, Pose.point(), radius :: float()) ::
          :ok | {:error, :wall | :outside | :narrow}
  def place(nil, _goal, _radius), do: :ok

  def place(grid, goal, radius) do
    {i, j} = Grid.index(grid, goal)
    clear = Grid.clearance(grid, goal)

    cond do
      clear >= radius + @stop -> :ok
      clear == 0.0 -> {:error, if(Grid.inside?(grid, i, j), do: :wall, else: :outside)}
      near?(grid, goal, radius) -> :ok
      true -> {:error, :narrow}
    end
  end

  defp near?(grid, goal, radius) do
    case Grid.Way.near(grid, goal, radius + @stop) do
      {:ok, place} -> Pose.distance(place, goal) <= @there + 0.71 * grid.cell
      :error -> false
    end
  end

  @doc """
  A refusal in words.

      iex> Nav.Reach.words(:no_way)
      "no way leads there"
  """
  @spec words(refusal()) :: String.t()
  def words(:wall), do: "there is a wall"
  def words(:outside), do: "it is outside of the map"
  def words(:narrow), do: "a wall is too near to it"
  def words(:no_way), do: "no way leads there"
end
