defmodule Hal.RFlex.Schedule do
  @moduledoc false
  # Decides when a driver does its periodic tasks next: `due` has the times, in milliseconds. Pure.
  alias Hal.RFlex.Driver

  @doc "Whether a task is due; one that was never scheduled is."
  @spec due?(Driver.t(), atom(), integer()) :: boolean()
  def due?(s, what, at_ms), do: at_ms >= Map.get(s.due, what, at_ms)

  @doc "Schedules a task `ms` after `at_ms`."
  @spec again(Driver.t(), atom(), integer(), pos_integer()) :: Driver.t()
  def again(s, what, at_ms, ms), do: %{s | due: Map.put(s.due, what, at_ms + ms)}
end
