defmodule Missions.Chase.Options do
  @moduledoc """
  Lists the options of the chase. Pure; metres in the map frame, m/s.

  | option | meaning | default |
  |---|---|---|
  | `goal:` | where the ball is to be | `{0.0, 0.0}` |
  | `within:` | how near to it that is | 0.5 |
  | `ring:` | how far from the ball the others keep | 1.8 |
  | `speed:` | of the robot that pushes the ball | 0.25 |
  | `colour:` | the colour of the ball | `"OrangeBall"` |
  | `radius:` | the radius of the ball | 0.11 |
  """
  alias Hal.Options

  @place {:tuple, [{:number, -1.0e4, 1.0e4, "m"}, {:number, -1.0e4, 1.0e4, "m"}],
          "{x, y} in metres"}

  @doc "The table of the options: what is allowed."
  @spec table() :: Options.table()
  def table do
    [
      goal: [@place, default: {0.0, 0.0}],
      within: [{:number, 0.2, 5, "m"}, default: 0.5],
      ring: [{:number, 1.2, 5, "m"}, default: 1.8],
      speed: [{:number, 0.05, 0.5, "m/s"}, default: 0.25],
      colour: [{:text, "a colour's name"}, default: "OrangeBall"],
      radius: [{:number, 0.03, 0.5, "m"}, default: 0.11]
    ]
  end
end
