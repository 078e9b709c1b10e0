defmodule Sim.TrialRuns do
  @moduledoc """
  Plays whole missions in lockstep for tests. In all of them a robot that does not get on says so.
  """
  import ExUnit.Assertions
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
    do: if(condition.(trial), do: spoken(trial), else: until(Trial.step(trial), condition))

  defp spoken(trial) do
    assert Trial.result(trial).stuck == [], "robots stood short of their places without a word"
    trial
  end
end
