defmodule Sim.Chaos.Isolated do
  @moduledoc "Calls a function in a process of its own, so that what it raises is a finding and not the end."
  alias Sim.Trial.Memory

  @doc """
  The value of a function, or one line on why it ended without one.

      iex> Sim.Chaos.Isolated.call(fn -> 1 + 1 end)
      {:ok, 2}
      iex> Sim.Chaos.Isolated.call(fn -> exit(:why) end)
      {:exit, "exit :why"}
  """
  @spec call((... -> value)) :: {:ok, value} | {:exit, line :: String.t()} when value: term()
  def call(function) do
    {pid, monitor} =
      spawn_monitor(fn ->
        Memory.prepare()
        exit({:chaos_value, function.()})
      end)

    receive do
      {:DOWN, ^monitor, :process, ^pid, {:chaos_value, value}} -> {:ok, value}
      {:DOWN, ^monitor, :process, ^pid, reason} -> {:exit, line(reason)}
    end
  end

  defp line({reason, [{module, function, arity, _place} | _stack]}) do
    arity = if is_list(arity), do: length(arity), else: arity
    "#{inspect(reason, limit: 8)} in #{inspect(module)}.#{function}/#{arity}"
  end

  defp line(reason), do: "exit #{inspect(reason, limit: 8)}"
end
