defmodule Robot.Names do
  @moduledoc """
  Names the processes of all robots of this node: a `Registry` keyed `{robot, role}`, so that any
  number of robots can run on one node, and no atom is created at run time.

  Roles: `:robot` (the supervisor), `:board`, `:drive`, `:ptz`, `:camera`, `:blob_detector`,
  `:view`, `:saver`, `:gate`, `:watch`, `:executive`, `:pilot`, and the roles of companions.
  """

  @doc "The child specification of the registry, which must run before any robot."
  @spec child_spec(term()) :: Supervisor.child_spec()
  def child_spec(_options), do: Registry.child_spec(keys: :unique, name: __MODULE__)

  @doc """
  A name by which to start a process, or to send to it.

      iex> Robot.Names.via(:mag1, :gate)
      {:via, Registry, {Robot.Names, {:mag1, :gate}}}
  """
  @spec via(robot :: atom(), role :: term()) :: {:via, module(), term()}
  def via(robot, role), do: {:via, Registry, {__MODULE__, {robot, role}}}

  @doc "The process in this role, or `nil`."
  @spec whereis(robot :: atom(), role :: term()) :: pid() | nil
  def whereis(robot, role), do: GenServer.whereis(via(robot, role))

  @doc "The processes in this role of all robots of this node."
  @spec all(role :: term()) :: [pid()]
  def all(role), do: Registry.select(__MODULE__, [{{{:_, role}, :"$1", :_}, [], [:"$1"]}])

  @doc "The robots that run on this node, sorted."
  @spec robots() :: [atom()]
  def robots do
    __MODULE__ |> Registry.select([{{{:"$1", :robot}, :_, :_}, [], [:"$1"]}]) |> Enum.sort()
  end
end
