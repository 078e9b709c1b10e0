defmodule Hal.RFlex.Schedule do
  @moduledoc """
  When a driver does next what it does again and again: in `due`, in milliseconds. Pure.
  """
  alias Hal.RFlex.Driver

  @doc "Whether it is time; what was never scheduled is due."
  @spec due?(Driver.t(), atom(), integer()) :: boolean()
  def due?(s, what, at_ms), do: at_ms >= Map.get(s.due, what, at_ms)

  @doc "Schedules it `ms` after `at_ms`."
  @spec again(Driver.t(), atom(), integer(), pos_integer()) :: Driver.t()
  def again(s, what, at_ms, ms), do: %{s | due: Map.put(s.due, what, at_ms + ms)}
end
