defmodule Swarm.Directory.Scope do
  @moduledoc """
  Runs the process of `Swarm.Directory`: a scope of `:pg`, which other nodes must be able to send to by
  its name, and which must not end because of what they send (`Hal.HardenedServer`).

  OTP's code does the work, and only gets messages of its own protocol that are whole:

    * requests, from processes of this node;
    * what the scopes of other nodes tell: each speaks for processes of its own node only;
    * the end of a process, unless that process is alive or is still monitored.
  """
  use Hal.HardenedServer
  import Swarm.Wire, only: [list?: 2]
  alias Hal.HardenedServer

  @doc "Starts the scope with this name."
  @spec start_link(atom()) :: GenServer.on_start()
  def start_link(scope), do: HardenedServer.start_link(__MODULE__, scope, name: scope)

  @impl GenServer
  def init(scope), do: :pg.init([scope])

  @impl GenServer
  def handle_call(request, {pid, _tag} = from, s) do
    if node(pid) == node() and request?(request),
      do: :pg.handle_call(request, from, s),
      else: HardenedServer.drop(s)
  end

  @impl GenServer
  def handle_cast({:sync, peer, groups} = told, s) do
    if peer?(peer) and list?(groups, &group?(&1, peer)),
      do: :pg.handle_cast(told, s),
      else: HardenedServer.drop(s)
  end

  @impl GenServer
  def handle_info(message, s) do
    if told?(message), do: :pg.handle_info(message, s), else: HardenedServer.drop(s)
  end

  @impl GenServer
  def terminate(reason, s), do: :pg.terminate(reason, s)

  defp request?({what, _group, pids}) when what in [:join_local, :leave_local],
    do: members?(pids, node())

  defp request?(:monitor), do: true
  defp request?({:monitor, _group}), do: true
  defp request?({:demonitor, ref}), do: is_reference(ref)
  defp request?(_unknown), do: false

  defp told?({:join, peer, _group, pids}), do: peer?(peer) and members?(pids, node(peer))

  defp told?({:leave, peer, pids, groups}),
    do: peer?(peer) and members?(pids, node(peer)) and list?(groups, fn _group -> true end)

  defp told?({:discover, peer}), do: peer?(peer)
  # OTP 26 and later say which protocol they speak.
  defp told?({:discover, peer, version}), do: peer?(peer) and is_integer(version)
  defp told?({:DOWN, ref, :process, pid, _why}) when is_reference(ref), do: ended?(pid)

  defp told?({{:DOWN, whose}, ref, :process, pid, _why}) when is_reference(ref),
    do: whose in [:scope_monitors, :group_monitors] and ended?(pid)

  defp told?({what, node}) when what in [:nodeup, :nodedown], do: is_atom(node)
  defp told?(_unknown), do: false

  defp peer?(peer), do: is_pid(peer) and node(peer) != node()

  defp group?({_group, [_ | _] = pids}, peer), do: members?(pids, node(peer))
  defp group?(_other, _peer), do: false

  defp members?([_ | _] = pids, node), do: list?(pids, &member?(&1, node))
  defp members?(pid, node), do: member?(pid, node)

  defp member?(pid, node), do: is_pid(pid) and node(pid) == node

  # The monitor of a process that has ended is gone when its message arrives.
  defp ended?(pid) when is_pid(pid) and node(pid) == node(), do: not Process.alive?(pid)

  defp ended?(pid) when is_pid(pid) do
    {:monitors, monitors} = Process.info(self(), :monitors)
    {:process, pid} not in monitors
  end

  defp ended?(_other), do: false
end
