defmodule Sim.Map.Image do
  @moduledoc "Maps from bitmaps."

  @doc "Opens `FILE:WIDTHxHEIGHT`."
  @spec open(String.t()) :: {:ok, Sim.Map.t()} | {:error, String.t()}
  def open(name) do
    {:error, "unknown map #{name}: hall, hospital, arena or FILE.png:WIDTHxHEIGHT in metres"}
  end
end
