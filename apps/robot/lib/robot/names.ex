defmodule Robot.Names do
  @moduledoc """
  Names the processes of all robots of this node: a `Registry` keyed `{robot, role}`, so that any
  number of robots can run on one node, and no atom is created at run time.

  Roles: `:robot` (the supervisor), `:board`, `:drive`, `:ptz`, `:camera`, `:blob_detector`, `:view`, `:saver`, `:gate`,
  `:executive`, `:pilot`, and what companions call themselves.
  """

  @doc "The child that must run before any robot."
  @spec child_spec(term()) :: Supervisor.child_spec()
  def child_spec(_options), do: Registry.child_spec(keys: :unique, name: __MODULE__)

  @doc """
  A name to start a process with, or to send to.

      iex> Robot.Names.via(:mag1, :gate)
      {:via, Registry, {Robot.Names, {:mag1, :gate}}}
  """
  @spec via(robot :: atom(), role :: term()) :: {:via, module(), term()}
  def via(robot, role), do: {:via, Registry, {__MODULE__, {robot, role}}}

  @doc "The process in that role, if there is one."
  @spec whereis(robot :: atom(), role :: term()) :: pid() | nil
  def whereis(robot, role), do: GenServer.whereis(via(robot, role))

  @doc "The processes in that role, of all robots of this node."
  @spec all(role :: term()) :: [pid()]
  def all(role), do: Registry.select(__MODULE__, [{{{:_, role}, :"$1", :_}, [], [:"$1"]}])

  @doc "The robots that run on this node, sorted."
  @spec robots() :: [atom()]
  def robots do
    __MODULE__ |> Registry.select([{{{:"$1", :robot}, :_, :_}, [], [:"$1"]}]) |> Enum.sort()
  end
end
