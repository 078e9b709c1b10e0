defmodule Missions.Flock.Options do
  @moduledoc """
  Lists the options of the flock. Pure; metres in the map frame, m/s.

  | option | meaning | default |
  |---|---|---|
  | `spacing:` | between neighbours | 1.2 |
  | `speed:` | on the way | 0.3 |
  | `course:` | up to 64 points, `[{0, 0}, {6, 0}]`: it gathers round the first, then goes to each | `[{0.0, 0.0}]` |
  """
  alias Hal.Options

  @metres {:number, -1.0e4, 1.0e4, "m"}
  @place {:tuple, [@metres, @metres], "{x, y} in metres"}
  @most 64

  @doc "The table of the options: what is allowed."
  @spec table() :: Options.table()
  def table do
    [
      spacing: [{:number, 0.9, 5, "m"}, default: 1.2],
      speed: [{:number, 0.05, 1, "m/s"}, default: 0.3],
      course: [{:list, @place, @most}, default: [{0.0, 0.0}]]
    ]
  end

  @doc "The greatest number of points of a course."
  @spec most() :: pos_integer()
  def most, do: @most
end
