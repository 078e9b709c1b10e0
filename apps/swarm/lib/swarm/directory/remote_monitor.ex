defmodule Swarm.Directory.RemoteMonitor do
  @moduledoc """
  Reports when processes end, on any node, without ever waiting for their nodes. Monitoring a
  process of another node blocks while the connection is full, so a separate process does it.
  """

  @doc """
  Monitors `%{alias => pid}` for the calling process. When a process or its node ends, the message
  `{Swarm.Directory.RemoteMonitor, alias, :gone}` is sent to that alias of the caller.
  """
  @spec start(%{reference() => pid()}) :: watch :: pid()
  def start(pids) do
    owner = self()

    spawn(fn ->
      own = Process.monitor(owner)
      watch(own, Map.new(pids, fn {ref, pid} -> {Process.monitor(pid), ref} end))
    end)
  end

  @doc """
  Ends the monitoring. Messages that it has already sent may still be on their way to an open
  alias.
  """
  @spec stop(watch :: pid()) :: :ok
  def stop(watch) do
    Process.exit(watch, :kill)
    :ok
  end

  defp watch(own, watched) do
    receive do
      {:DOWN, ^own, :process, _owner, _reason} ->
        :ok

      {:DOWN, monitor, :process, _pid, _reason} when is_map_key(watched, monitor) ->
        send(watched[monitor], {__MODULE__, watched[monitor], :gone})
        watch(own, watched)
    end
  end
end
