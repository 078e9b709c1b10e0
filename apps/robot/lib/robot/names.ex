defmodule Robot.Names do
  @moduledoc """
  Names the processes of all robots of this node: a registry keyed `{robot, role}`, so that any
  number of robots can run on one node, and no atom is created at run time.

  Roles: `:robot` (the supervisor), `:board`, `:drive`, `:ptz`, `:camera`, `:blob_detector`,
  `:view`, `:saver`, `:gate`, `:watch`, `:executive`, `:pilot`, and the roles of companions.

  It is a process of its own, and not a `Registry`, because a node cannot do without it, and a
  `Registry` crashes if a connected node sends it something (`Hal.HardenedServer`). Readers use
  its table, without a message.
  """
  use Hal.HardenedServer
  alias Hal.HardenedServer

  @type key :: {robot :: atom(), role :: term()}

  @doc "Starts the registry, which must run before any robot."
  @spec start_link(term()) :: GenServer.on_start()
  def start_link(_options), do: HardenedServer.start_link(__MODULE__, [], name: __MODULE__)

  @doc """
  A name by which to start a process, or to send to it.

      iex> Robot.Names.via(:mag1, :gate)
      {:via, Robot.Names, {:mag1, :gate}}
  """
  @spec via(robot :: atom(), role :: term()) :: {:via, module(), key()}
  def via(robot, role), do: {:via, __MODULE__, {robot, role}}

  @doc "The process in this role, or `nil`."
  @spec whereis(robot :: atom(), role :: term()) :: pid() | nil
  def whereis(robot, role) do
    with {pid, _value} <- lookup(robot, role), do: pid
  end

  @doc "The process in this role and the value that it registered with, or `nil`."
  @spec lookup(robot :: atom(), role :: term()) :: {pid(), value :: term()} | nil
  def lookup(robot, role) do
    with [{_key, pid, value}] <- entries({robot, role}), true <- Process.alive?(pid) do
      {pid, value}
    else
      _none_or_ended -> nil
    end
  end

  @doc "Registers the calling process in a role, with a value that others can look up."
  @spec register(robot :: atom(), role :: term(), value :: term()) ::
          :ok | {:error, {:already_registered, pid()}}
  def register(robot, role, value) when is_atom(robot),
    do: GenServer.call(__MODULE__, {:register, {robot, role}, self(), value}, :infinity)

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

  # What a `{:via, Robot.Names, key}` stands for.
  @doc false
  @spec register_name(key(), pid()) :: :yes | :no
  def register_name({robot, _role} = key, pid) when is_atom(robot) and pid == self() do
    case GenServer.call(__MODULE__, {:register, key, pid, nil}, :infinity) do
      :ok -> :yes
      {:error, {:already_registered, _pid}} -> :no
    end
  end

  @doc false
  @spec unregister_name(key()) :: :ok
  def unregister_name({robot, _role} = key) when is_atom(robot),
    do: GenServer.call(__MODULE__, {:unregister, key, self()}, :infinity)

  @doc false
  @spec whereis_name(key()) :: pid() | :undefined
  def whereis_name({robot, role}), do: whereis(robot, role) || :undefined

  @doc false
  @spec send(key(), term()) :: pid()
  def send({robot, role} = key, message) do
    case whereis(robot, role) do
      nil -> :erlang.error(:badarg, [key, message])
      pid -> Kernel.send(pid, message) && pid
    end
  end

  @impl GenServer
  def init([]) do
    :ets.new(__MODULE__, [:named_table, :protected, read_concurrency: true])
    {:ok, %{}}
  end

  # The state maps a monitor to the key of its process.
  @impl GenServer
  def handle_call({:register, {robot, _role} = key, pid, value}, {pid, _tag}, monitors)
      when is_atom(robot) and node(pid) == node() do
    case entries(key) do
      [{_key, former, _value}] when former != pid ->
        # The monitor of one that has ended may still be under way.
        if Process.alive?(former),
          do: {:reply, {:error, {:already_registered, former}}, monitors},
          else: {:reply, :ok, enter(monitors, key, pid, value)}

      [_own] ->
        {:reply, {:error, {:already_registered, pid}}, monitors}

      [] ->
        {:reply, :ok, enter(monitors, key, pid, value)}
    end
  end

  def handle_call({:unregister, key, pid}, {pid, _tag}, monitors) do
    :ets.match_delete(__MODULE__, {key, pid, :_})
    {:reply, :ok, monitors}
  end

  @impl GenServer
  def handle_info({:DOWN, ref, :process, pid, _reason}, monitors)
      when is_map_key(monitors, ref) do
    {key, monitors} = Map.pop!(monitors, ref)
    :ets.match_delete(__MODULE__, {key, pid, :_})
    {:noreply, monitors}
  end

  defp enter(monitors, key, pid, value) do
    :ets.insert(__MODULE__, {key, pid, value})
    Map.put(monitors, Process.monitor(pid), key)
  end

  # Without a registry there are no robots: its table ends with it.
  defp entries(key), do: if(running?(), do: :ets.lookup(__MODULE__, key), else: [])
  defp select(spec), do: if(running?(), do: :ets.select(__MODULE__, spec), else: [])
  defp running?, do: :ets.whereis(__MODULE__) != :undefined
end
