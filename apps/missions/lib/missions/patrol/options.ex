defmodule Missions.Patrol.Options do
  @moduledoc """
  Lists the options of the patrol, and the points that they mean. Pure; metres in the map frame, seconds.

  | option | meaning | default |
  |---|---|---|
  | `loop:` | `:square` (its corners and the middles of its sides), `:line` (five points along x) | `:square` |
  | `side:` | how long a side of the square, or the line, is | 4.0 |
  | `centre:` | where its middle is | `{0.0, 0.0}` |
  | `points:` | up to 64 points instead of a loop, `[{1, 2}, {3, 4}]` | none |
  | `period:` | within which each point is to be seen | 120.0 |
  | `by:` | how points are shared: `:motivation` (`Missions.Patrol.Motivation`), `:auction` (`Missions.Patrol.Auction`), `:rules` (`Missions.Patrol.Helping`) | `:motivation` |
  """
  alias Hal.Options

  @metres {:number, -1.0e4, 1.0e4, "m"}
  @place {:tuple, [@metres, @metres], "{x, y} in metres"}
  @most 64

  @doc "The table of the options: what is allowed."
  @spec table() :: Options.table()
  def table do
    [
      loop: [{:one_of, [:square, :line]}, default: :square],
      side: [{:number, 1, 100, "m"}, default: 4.0],
      centre: [@place, default: {0.0, 0.0}],
      points: [{:list, @place, @most}, default: []],
      period: [{:number, 10, 3_600, "s"}, default: 120.0],
      by: [{:one_of, [:motivation, :auction, :rules]}, default: :motivation]
    ]
  end

  @doc "The greatest number of points."
  @spec most() :: pos_integer()
  def most, do: @most

  @doc """
  The points of checked options, in the order of their numbers.

      iex> Missions.Patrol.Options.points(loop: :line, side: 4.0, centre: {1.0, 0.0}, points: [])
      [{-1.0, 0.0}, {0.0, 0.0}, {1.0, 0.0}, {2.0, 0.0}, {3.0, 0.0}]
      iex> Missions.Patrol.Options.points(loop: :square, side: 2.0, centre: {0.0, 0.0}, points: []) |> length()
      8
  """
  @spec points(keyword()) :: [Hal.Pose.point(), ...]
  def points(options) do
    {x, y} = options[:centre]

    case {options[:points], options[:loop]} do
      {[_ | _] = points, _loop} ->
        points

      {[], :line} ->
        for step <- -2..2, do: {x + step * options[:side] / 4, y}

      {[], :square} ->
        for {a, b} <- ring(), do: {x + a * options[:side] / 2, y + b * options[:side] / 2}
    end
  end

  defp ring, do: [{-1, -1}, {0, -1}, {1, -1}, {1, 0}, {1, 1}, {0, 1}, {-1, 1}, {-1, 0}]
end
