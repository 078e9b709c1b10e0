defmodule Robot.Names do
  @moduledoc """
  Names the processes of all robots of this node: a `Registry` with the keys `{robot, role}`, so that any
  number of robots can run on one node, and no atom is created at run time.

  Roles: `:robot` (the supervisor), `:board`, `:drive`, `:ptz`, `:scan`, `:camera`, `:blob_detector`,
  `:view`, `:saver`, `:gate`, `:watch`, `:executive`, `:pilot`, and the roles of companions.

  Readers use its table, without a message.
  """

  @type key :: {robot :: atom(), role :: term()}

  @doc "The registry as a child. It must run before any robot."
  @spec child_spec(term()) :: Supervisor.child_spec()
  def child_spec(_options), do: Registry.child_spec(keys: :unique, name: __MODULE__)

  @doc """
  A name by which to start a process, or to send to it.

      iex> Robot.Names.via(:mag1, :gate)
      {:via, Registry, {Robot.Names, {:mag1, :gate}}}
  """
  @spec via(robot :: atom(), role :: term()) :: {:via, module(), {module(), key()}}
  def via(robot, role), do: {:via, Registry, {__MODULE__, {robot, role}}}

  @doc "The process in this role, or `nil`."
  @spec whereis(robot :: atom(), role :: term()) :: pid() | nil
  def whereis(robot, role) do
    with {pid, _value} <- lookup(robot, role), do: pid
  end

  @doc "The process in this role and the value that it registered with, or `nil`."
  @spec lookup(robot :: atom(), role :: term()) :: {pid(), value :: term()} | nil
  # A registry lists a process that has ended for a moment.
  def lookup(robot, role) do
    with [{pid, _value} = found] <- Registry.lookup(__MODULE__, {robot, role}),
         true <- Process.alive?(pid) do
      found
    else
      _none_or_ended -> nil
    end
  end

  @doc "Registers the calling process in a role, with a value that others can look up."
  @spec register(robot :: atom(), role :: term(), value :: term()) ::
          :ok | {:error, {:already_registered, pid()}}
  def register(robot, role, value) when is_atom(robot),
    do: with({:ok, _owner} <- Registry.register(__MODULE__, {robot, role}, value), do: :ok)

  @doc "The roles that a robot of this node has now."
  @spec roles(robot :: atom()) :: [role :: term()]
  def roles(robot), do: select([{{{robot, :"$1"}, :_, :_}, [], [:"$1"]}])

  @doc "The processes in this role of all robots of this node."
  @spec all(role :: term()) :: [pid()]
  def all(role), do: select([{{{:_, role}, :"$1", :_}, [], [:"$1"]}])

  @doc "The processes of all robots of this node, by robot and role, sorted by these."
  @spec all() :: [{key(), pid()}]
  def all, do: Enum.sort(select([{{:"$1", :"$2", :_}, [], [{{:"$1", :"$2"}}]}]))

  @doc "The robots that run on this node, sorted."
  @spec robots() :: [atom()]
  def robots, do: Enum.sort(select([{{{:"$1", :robot}, :_, :_}, [], [:"$1"]}]))

  defp select(spec), do: Registry.select(__MODULE__, spec)
end
