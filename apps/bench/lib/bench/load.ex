defmodule Bench.Load do
  @moduledoc "Tells how busy this machine is: figures are worth less on one that does other things, too."

  @doc "The load in the last minute; `nil` where nobody knows."
  @spec now() :: float() | nil
  def now do
    with {:ok, text} <- File.read("/proc/loadavg"),
         {load, _rest} <- Float.parse(text),
         do: load,
         else: (_unknown -> nil)
  end

  @doc "The load before a bench, and that after it, in words: now, unless it is given."
  @spec words(before :: float() | nil, later :: float() | nil) :: String.t()
  def words(before, later \\ now()),
    do: "Load of the machine (1 min): #{before || "?"} before, #{later || "?"} after"
end
