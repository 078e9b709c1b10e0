defmodule Swarm.Directory do
  @moduledoc """
  Finds robots: groups of processes over all connected nodes, on `:pg`. Groups contain robots
  (their comms processes), not nodes, so that a hundred robots look alike on one node or on a
  hundred.

  | group | members |
  |---|---|
  | `{:robot, :mag1}` | the comms process of that robot |
  | `{:estop, :mag1}` | its e-stop process |
  | `:estops` | the e-stop processes of all robots |
  | `{:attended, :mag1}` | the comms process of that robot, if it moves only in the presence of a person |
  | `{:team, :blue}` | the processes that entered it |
  | `{:service, :camera}`, `{:service, :camera, :mag1}` | the processes that offer it (`Agents.Responder`); that of one robot |
  | `{:topic, :poses}` | the subscribers (`Agents.Topic`) |

  A directory that restarts is empty, and one that is down cannot be entered: a process that
  entered monitors it (`monitor/0`), and enters again.
  """
  @type group ::
          :estops
          | {:robot, atom()}
          | {:estop, atom()}
          | {:attended, atom()}
          | {:team, atom()}
          | {:service, atom()}
          | {:service, atom(), robot :: atom()}
          | {:topic, atom() | String.t()}

  @doc "The scope as a child."
  @spec child_spec(term()) :: Supervisor.child_spec()
  def child_spec(_options),
    do: %{id: __MODULE__, start: {:pg, :start_link, [__MODULE__]}}

  @doc "Adds a local process to groups."
  @spec enter(pid(), [group()]) :: :ok | {:error, :down}
  def enter(pid, groups) do
    Enum.each(groups, &(:ok = :pg.join(__MODULE__, &1, pid)))
  catch
    :exit, {_why, {:gen_server, :call, _arguments}} -> {:error, :down}
  end

  @doc "Removes a local process from groups."
  @spec leave(pid(), [group()]) :: :ok | {:error, :down}
  def leave(pid, groups) do
    Enum.each(groups, &:pg.leave(__MODULE__, &1, pid))
  catch
    :exit, {_why, {:gen_server, :call, _arguments}} -> {:error, :down}
  end

  @doc """
  Monitors the directory of this node: a `:DOWN` message arrives when it ends, or at once if there
  is none.
  """
  @spec monitor() :: reference()
  def monitor, do: Process.monitor(__MODULE__)

  @doc "The comms process of a robot, or `nil`. One on this node is preferred."
  @spec whereis(robot :: atom()) :: pid() | nil
  def whereis(robot) do
    case sorted({:robot, robot}) do
      [] -> nil
      [first | _] = pids -> Enum.find(pids, first, &(node(&1) == node()))
    end
  end

  @doc "All members of a group."
  @spec members(group()) :: [pid()]
  def members(group), do: sorted(group)

  @doc "The names of all robots, sorted."
  @spec robots() :: [atom()]
  def robots do
    if running?(),
      do: Enum.sort(for {:robot, robot} <- :pg.which_groups(__MODULE__), do: robot),
      else: []
  end

  @doc "The names of the robots that move only in the presence of a person, sorted."
  @spec attended() :: [atom()]
  def attended do
    if running?(),
      do: Enum.sort(for {:attended, robot} <- :pg.which_groups(__MODULE__), do: robot),
      else: []
  end

  @doc "The services of each robot that offers any (`Agents.Responder`), sorted by the robots."
  @spec services() :: [{robot :: atom(), [service :: atom(), ...]}]
  def services do
    groups = if running?(), do: :pg.which_groups(__MODULE__), else: []
    # Any node may enter anything.
    offers =
      for {:service, service, robot} when is_atom(service) and is_atom(robot) <-
            Enum.sort(groups),
          do: {robot, service}

    offers |> Enum.group_by(&elem(&1, 0), &elem(&1, 1)) |> Enum.sort()
  end

  # The groups are read from a table that disappears with the scope.
  defp sorted(group),
    do: if(running?(), do: Enum.sort(:pg.get_members(__MODULE__, group)), else: [])

  defp running?, do: :ets.whereis(__MODULE__) != :undefined
end
