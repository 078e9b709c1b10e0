defmodule Mesh.Distribution.Epmd do
  @moduledoc """
  Replaces Erlang's port mapper: a node learns where others are from signed beacons that the mesh
  has heard, and from a list. Neither epmd nor a name server is needed, and node names need not be
  host names: `mag1@convoy` keeps its name whatever address it has.

      -start_epmd false -epmd_module Elixir.Mesh.Distribution.Epmd

  | | comes from |
  |---|---|
  | own port | `CONVOY_DIST_PORT`, for the node named by `ROBOT` (every node, where there is no `ROBOT`); else `default_port/1` |
  | others | `learn/3`; else `CONVOY_PEERS`, as in `mag2@convoy=10.0.0.12:9102,min1@convoy=10.0.0.21` |
  | nodes of the same host part | 127.0.0.1 and their default port: `iex --remsh` on the robot itself |
  | hosts that are addresses | `mag1@10.0.0.11`: that address and the default port |

  A name server is never asked, because `:net_kernel` calls this module, and while it waits for an
  answer, all connections of the node wait.

  Erlang calls this module before any application runs, and starts its only process, which owns
  the table. Without that process (a node with the usual epmd) `learn/3` does nothing. A full
  table accepts no more names. No text becomes an atom here.
  """
  alias Mesh.Distribution.Epmd.Peers
  alias Mesh.Distribution.Preload

  @table __MODULE__
  @most 1_024
  # The version of the distribution protocol, as epmd answers it.
  @version 5

  @type text :: String.t() | charlist() | atom()

  @doc "Remembers where a node listens: `learn(\"mag2@convoy\", {10, 0, 0, 12}, 9102)`."
  @spec learn(String.t(), :inet.ip_address(), :inet.port_number()) :: :ok | {:error, :full}
  def learn(node, ip, port)
      when is_binary(node) and byte_size(node) < 256 and is_tuple(ip) and port in 1..65_535 do
    cond do
      :ets.whereis(@table) == :undefined -> :ok
      :ets.member(@table, node) or :ets.info(@table, :size) < @most -> insert({node, ip, port})
      true -> {:error, :full}
    end
  end

  @doc "Forgets a node; a node of the list is found again only after a restart."
  @spec forget(String.t()) :: :ok
  def forget(node) do
    if :ets.whereis(@table) != :undefined, do: :ets.delete(@table, node)
    :ok
  end

  @doc """
  The port of a robot without a configured one.

      iex> Enum.map(["mag1", "mag100", "min1", "world"], &Mesh.Distribution.Epmd.default_port/1)
      [9101, 9200, 9201, 9301]
  """
  @spec default_port(text()) :: 9_101..9_999
  def default_port(name), do: Peers.default_port(to_string(name))

  # The callbacks that Erlang expects of an epmd module.

  @doc false
  @spec start_link() :: GenServer.on_start()
  def start_link do
    :ok = Preload.load()
    :proc_lib.start_link(__MODULE__, :init, [self()])
  end

  @doc false
  @spec init(pid()) :: no_return()
  def init(starter) do
    Process.register(self(), __MODULE__)
    # The table of a previous distribution may still exist until its owner has ended.
    :ets.new(@table, [:named_table, :public, read_concurrency: true])
    list = to_string(:os.getenv(~c"CONVOY_PEERS", ~c""))
    for {node, ip, port} <- Enum.take(Peers.parse(list), @most), do: insert({node, ip, port})
    :proc_lib.init_ack(starter, {:ok, self()})
    own()
  end

  # If the port mapper of a distribution crashes, the node ends. So this process only owns the
  # table, and drops whatever arrives: not even OTP's system messages are read here. No other
  # application need be loaded for it: the distribution starts before them.
  defp own do
    receive do
      _anything -> own()
    end
  end

  @doc false
  @spec listen_port_please(text(), text()) :: {:ok, :inet.port_number()}
  def listen_port_please(name, _host), do: {:ok, Peers.own_port(to_string(name), environment())}

  @doc false
  @spec register_node(text(), :inet.port_number()) :: {:ok, creation :: pos_integer()}
  def register_node(name, port), do: register_node(name, port, :inet)

  @doc false
  @spec register_node(text(), :inet.port_number(), family :: atom()) ::
          {:ok, creation :: pos_integer()}
  def register_node(name, port, _family) do
    if :ets.whereis(@table) != :undefined, do: insert({{:own, to_string(name)}, nil, port})
    # Distinguishes one life of a node from the next, as epmd would; 0 to 3 have a special
    # meaning.
    {:ok, 3 + :rand.uniform(0xFFFFFFFF - 4)}
  end

  @doc false
  @spec address_please(text(), text(), family :: atom()) ::
          {:ok, :inet.ip_address(), :inet.port_number(), version :: 5} | {:error, :address}
  def address_please(name, host, family) do
    {name, host} = {to_string(name), to_string(host)}

    case lookup(name <> "@" <> host) || Peers.guess(name, host, own_host()) do
      {ip, port} when tuple_size(ip) == 4 and family in [:inet, :inet_tcp] ->
        {:ok, ip, port, @version}

      {ip, port} when tuple_size(ip) == 8 and family in [:inet6, :inet6_tcp] ->
        {:ok, ip, port, @version}

      _unknown ->
        {:error, :address}
    end
  end

  @doc false
  @spec port_please(text(), text() | :inet.ip_address()) ::
          {:port, :inet.port_number(), version :: 5}
  def port_please(name, host), do: port_please(name, host, :infinity)

  @doc false
  @spec port_please(text(), text() | :inet.ip_address(), timeout()) ::
          {:port, :inet.port_number(), version :: 5}
  def port_please(name, host, _timeout) do
    text = to_string(name) <> "@" <> if(is_tuple(host), do: "", else: to_string(host))

    case lookup(text) do
      {_ip, port} -> {:port, port, @version}
      nil -> {:port, default_port(name), @version}
    end
  end

  @doc false
  @spec names() :: {:ok, [{charlist(), :inet.port_number()}]}
  def names, do: names(own_host())

  @doc false
  @spec names(text() | :inet.ip_address()) :: {:ok, [{charlist(), :inet.port_number()}]}
  def names(host) do
    host = if is_tuple(host), do: to_string(:inet.ntoa(host)), else: to_string(host)
    rows = if :ets.whereis(@table) == :undefined, do: [], else: :ets.tab2list(@table)
    known = for {node, _ip, port} <- rows, name = named(node, host), do: {name, port}
    {:ok, Enum.sort(for {name, port} <- known, do: {String.to_charlist(name), port})}
  end

  defp named({:own, name}, host), do: if(host == own_host(), do: name)

  defp named(node, host) do
    case String.split(node, "@") do
      [name, ^host] -> name
      _other -> nil
    end
  end

  defp insert(row) do
    :ets.insert(@table, row)
    :ok
  end

  defp lookup(node) do
    case :ets.whereis(@table) != :undefined and :ets.lookup(@table, node) do
      [{_node, ip, port}] -> {ip, port}
      _none -> nil
    end
  end

  # While the node is about to get its name, it has none yet.
  defp own_host, do: node() |> Atom.to_string() |> String.split("@") |> List.last()

  defp environment do
    for name <- ["CONVOY_DIST_PORT", "ROBOT"],
        value = :os.getenv(String.to_charlist(name)),
        value != false,
        into: %{},
        do: {name, to_string(value)}
  end
end
