defmodule Lab.TrialRuns do
  @moduledoc """
  Runs whole missions in lockstep for tests. In all of them a robot that makes no progress must
  say so.
  """
  import ExUnit.Assertions
  alias Lab.{Run, Trial}

  @doc "Runs a trial to its end; blobs are computed directly unless the options say otherwise."
  def run(options) do
    {:ok, trial} = Trial.new(Map.merge(%{blobs: :direct}, options))
    to_the_end(trial)
  end

  @doc "Continues a trial to its end."
  def to_the_end(trial), do: trial |> Run.play() |> spoken()

  @doc "Continues a trial until a condition holds."
  def until(trial, condition), do: trial |> Run.play(condition) |> spoken()

  defp spoken(trial) do
    assert Trial.result(trial).stuck == [],
           "robots stood short of their places without reporting it"

    trial
  end
end
