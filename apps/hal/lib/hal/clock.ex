defmodule Hal.Clock do
  @moduledoc "Reads the clock of those who are given none: the monotonic one of this VM."

  @doc "The time in milliseconds (`System.monotonic_time/1`)."
  @spec now_ms() :: integer()
  def now_ms, do: System.monotonic_time(:millisecond)
end
