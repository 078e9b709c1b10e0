defmodule Sim.Chaos.Isolated do
  @moduledoc "Calls a function in a process of its own, so that what it raises is a finding and not the end."
  alias Sim.Invariants.Attempt
  alias Sim.Trial.Memory

  @doc """
  The value of a function, or the reason with which its process ended (`Sim.Invariants.Violation.crash/2`).

      iex> Sim.Chaos.Isolated.call(fn -> 1 + 1 end)
      {:ok, 2}
      iex> Sim.Chaos.Isolated.call(fn -> exit(:why) end)
      {:exit, :why}
  """
  @spec call((... -> value)) :: {:ok, value} | {:exit, reason :: term()} when value: term()
  def call(function) do
    {pid, monitor} =
      spawn_monitor(fn ->
        Memory.prepare()
        exit({:chaos_value, Attempt.call(function)})
      end)

    receive do
      {:DOWN, ^monitor, :process, ^pid, {:chaos_value, result}} -> result
      {:DOWN, ^monitor, :process, ^pid, reason} -> {:exit, reason}
    end
  end
end
