defmodule Soak.Fleet.Tree do
  @moduledoc "Lists the processes of a node's swarm and robot, and kills one of them."
  alias Robot.Names

  @doc "The processes of swarm and robot, by what they are, sorted. Two that are the same have the same words."
  @spec processes() :: [{String.t(), pid()}]
  def processes do
    roles = Map.new(Names.all(), fn {{_robot, role}, pid} -> {pid, inspect(role)} end)

    case top() do
      nil ->
        []

      top ->
        Enum.sort(for pid <- Process.list(), words = words(pid, top, roles), do: {words, pid})
    end
  end

  # The supervisor below the application's master.
  defp top do
    with master when is_pid(master) <- :application_controller.get_master(:swarm),
         {pid, _module} when is_pid(pid) <- :application_master.get_child(master),
         do: pid,
         else: (_ended -> nil)
  end

  defp words(nil, _top, _roles), do: nil
  defp words(top, top, _roles), do: "Swarm.Supervisor"

  defp words(pid, top, roles) do
    with {:dictionary, dictionary} <- Process.info(pid, :dictionary),
         [parent | _] = ancestors <- dictionary[:"$ancestors"],
         true <- top in ancestors,
         {:registered_name, name} <- Process.info(pid, :registered_name) do
      cond do
        role = roles[pid] -> role
        name != [] -> inspect(name)
        # All supervisors begin alike.
        true -> "#{call(dictionary[:"$initial_call"])} of #{words(pid(parent), top, roles)}"
      end
    else
      _another -> nil
    end
  end

  defp pid(name) when is_atom(name), do: Process.whereis(name)
  defp pid(pid), do: pid

  defp call({module, _function, _arity}), do: inspect(module)
  defp call(_other), do: "a process"

  @doc """
  Kills the process that a number from 0 to 1 chooses among those of swarm and robot. Says what it was,
  `nil` if there is none.
  """
  @spec kill(float()) :: String.t() | nil
  def kill(chance) do
    case processes() do
      [] ->
        nil

      all ->
        {words, pid} = Enum.at(all, trunc(chance * length(all)))
        Process.exit(pid, :kill)
        words
    end
  end
end
