defmodule Missions.Explore.Options do
  @moduledoc """
  Lists the options of the exploration. Pure.

  | option | meaning | default |
  |---|---|---|
  | `within:` | how far from where it began a robot explores, metres to each side | 48 |
  """
  alias Hal.Options
  alias Missions.Explore.SharedMap

  @doc "The table of the options: what is allowed."
  @spec table() :: Options.table()
  def table, do: [within: [{:number, 3, SharedMap.far(), "m"}, default: SharedMap.far()]]
end
