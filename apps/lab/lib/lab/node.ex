defmodule Lab.Node do
  @moduledoc """
  Runs a part of a fleet of nodes, one robot or the world, on a VM of `Vm.Fleet`, which calls `main/3` over standard input.

  The end of a process of the part ends the node. What the part tells goes through `Lab.Node.Reporter`.
  """
  alias Lab.Node.Reporter

  @doc """
  Starts a robot or the world, in processes linked to the caller. Returns facts for what starts the node, and what the part
  tells of itself ten times a second.
  """
  @callback start(options :: map()) ::
              {:ok, facts :: term(), report :: {module(), atom(), list()}}

  @doc """
  Starts the applications as `config` says (`[app: [key: value]]`), and then a part; returns its facts. `to` is what
  reports go to: a process on another node, with the name of the part, a file, or `nil`. With `:permanent` the end of an application ends
  the node, as in a release.
  """
  @spec main({module(), map()}, keyword(keyword()), keyword()) :: term()
  def main(part, config, options \\ []) do
    # Together, so that the missions are there when the mesh begins: it must know their atoms.
    :ok = Application.put_all_env(config)
    {:ok, _apps} = Application.ensure_all_started(:lab, options[:apps] || :temporary)
    caller = self()
    {pid, monitor} = spawn_monitor(fn -> run(caller, part, options[:to]) end)

    receive do
      {^pid, facts} -> facts
      {:DOWN, ^monitor, :process, ^pid, reason} -> exit(reason)
    end
  end

  defp run(caller, {module, options}, to) do
    Process.flag(:trap_exit, true)
    {:ok, facts, report} = module.start(options)
    if to, do: {:ok, _reporter} = Reporter.start_link(to, report)
    send(caller, {self(), facts})

    receive do
      {:EXIT, _part, reason} ->
        IO.puts("a part of it has ended: #{inspect(reason, limit: 20)}")
        System.halt(1)
    end
  end
end
