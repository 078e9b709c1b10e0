defmodule Sim.TrialRuns do
  @moduledoc "Plays whole missions in lockstep for tests."
  alias Sim.Trial

  @doc "A run to its end; blobs are seen directly unless told otherwise."
  def run(options) do
    {:ok, trial} = Trial.new(Map.merge(%{blobs: :direct}, options))
    to_the_end(trial)
  end

  @doc "Plays on to the end."
  def to_the_end(trial), do: until(trial, &Trial.done?/1)

  @doc "Plays on until a condition holds."
  def until(trial, condition),
    do: if(condition.(trial), do: trial, else: until(Trial.step(trial), condition))
end
