defmodule Sim.Invariants.Attempt do
  @moduledoc false
  # Calls a function whose failure is a finding and not the end.

  @doc """
  The value of a function, or the reason with which a process would end by what it raises.

      iex> Sim.Invariants.Attempt.call(fn -> 1 + 1 end)
      {:ok, 2}
      iex> Sim.Invariants.Attempt.call(fn -> exit(:why) end)
      {:exit, :why}
  """
  @spec call((... -> value)) :: {:ok, value} | {:exit, reason :: term()} when value: term()
  def call(function) do
    {:ok, function.()}
  catch
    :error, reason -> {:exit, {reason, __STACKTRACE__}}
    :throw, value -> {:exit, {{:nocatch, value}, __STACKTRACE__}}
    :exit, reason -> {:exit, reason}
  end
end
