defmodule Missions.Push.Options do
  @moduledoc """
  Lists the options of the mission that pushes a box. Pure; metres in the map frame, m/s.

  | option | meaning | default |
  |---|---|---|
  | `goal:` | where the middle of the box is to be | `{0.0, 0.0}` |
  | `within:` | how near to it that is | 0.5 |
  | `speed:` | with which it is pushed | 0.15 |
  | `colour:` | the colour of the box | `"BlueBox"` |
  | `length:`, `width:` | its sides | 1.2, 0.4 |
  """
  alias Hal.Options

  @place {:tuple, [{:number, -1.0e4, 1.0e4, "m"}, {:number, -1.0e4, 1.0e4, "m"}],
          "{x, y} in metres"}

  @doc "The table of the options: what is allowed. The two that push stand 0.4 m from the middle of its longer side."
  @spec table() :: Options.table()
  def table do
    [
      goal: [@place, default: {0.0, 0.0}],
      within: [{:number, 0.3, 5, "m"}, default: 0.5],
      speed: [{:number, 0.05, 0.3, "m/s"}, default: 0.15],
      colour: [{:text, "a colour's name"}, default: "BlueBox"],
      length: [{:number, 1.0, 3.0, "m"}, default: 1.2],
      width: [{:number, 0.2, 1.0, "m"}, default: 0.4]
    ]
  end
end
