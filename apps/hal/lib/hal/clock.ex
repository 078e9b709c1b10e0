defmodule Hal.Clock do
  @moduledoc "Default clock: this VM's monotonic time."

  @doc "The time in milliseconds (`System.monotonic_time/1`)."
  @spec now_ms() :: integer()
  def now_ms, do: System.monotonic_time(:millisecond)
end
