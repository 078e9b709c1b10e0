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

  @doc "The load before and after a bench (`Bench.Command.loaded/1`), in words."
  @spec words(%{
          :load_before => float() | nil,
          :load_after => float() | nil,
          optional(atom()) => term()
        }) :: String.t()
  def words(%{load_before: before, load_after: later}),
    do: "Load of the machine (1 min): #{before || "?"} before, #{later || "?"} after"
end
