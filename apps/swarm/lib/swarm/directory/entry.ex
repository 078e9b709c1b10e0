defmodule Swarm.Directory.Entry do
  @moduledoc """
  Keeps a role of a robot in the directory, for a role carries nothing out by itself: a companion (`Robot.Companion`) that
  is listed after it. Its options: `role:`; `as:`, by default the same, for the group `{as, robot}` that it is in while the
  robot has its name; and `all:`, a group in which it stays anyway, if any.
  """
  use GenServer
  alias Robot.Names
  alias Swarm.Directory
  alias Swarm.Directory.Membership

  @behaviour Robot.Companion

  @impl Robot.Companion
  def child_spec({config, options}) do
    role = Keyword.fetch!(options, :role)
    group = {Keyword.get(options, :as, role), config.id}
    arguments = [config.id, role, group, List.wrap(options[:all])]
    %{id: {__MODULE__, role}, start: {__MODULE__, :start_link, arguments}}
  end

  @doc "Starts the process, as the robot's supervisor does."
  @spec start_link(robot :: atom(), role :: atom(), Directory.group(), [Directory.group()]) ::
          GenServer.on_start()
  def start_link(robot, role, group, all) do
    GenServer.start_link(__MODULE__, {robot, role, group, all},
      name: Names.via(robot, {:directory, role})
    )
  end

  @doc "Says whether the role is found under the robot's name, or no longer is."
  @spec present(robot :: atom(), role :: atom(), boolean()) :: :ok
  def present(robot, role, present?),
    do: GenServer.cast(Names.via(robot, {:directory, role}), {:present, present?})

  @impl GenServer
  def init({robot, role, group, all}) do
    case Names.whereis(robot, role) do
      # It has ended meanwhile; with the next one this starts again.
      nil -> :ignore
      pid -> {:ok, entered(pid, group, all)}
    end
  end

  # Those of an entry that ended alone are still there.
  defp entered(pid, group, all) do
    Directory.leave(pid, [group | all])
    entry = %{pid: pid, group: group, all: Membership.enter(all, pid)}
    Map.put(entry, :name, Membership.enter([group], pid))
  end

  @impl GenServer
  def handle_cast({:present, true}, %{name: %{left?: true}} = s),
    do: {:noreply, %{s | name: Membership.enter([s.group], s.pid)}}

  def handle_cast({:present, true}, s), do: {:noreply, s}

  def handle_cast({:present, false}, s),
    do: {:noreply, %{s | name: Membership.leave(s.name)}}

  @impl GenServer
  def handle_info(message, s) do
    case {Membership.arrived(s.all, message), Membership.arrived(s.name, message)} do
      {{:ok, all}, :other} -> {:noreply, %{s | all: all}}
      {:other, {:ok, name}} -> {:noreply, %{s | name: name}}
      {:other, :other} -> {:noreply, s}
    end
  end
end
