defmodule Mesh.Options do
  @moduledoc """
  Checks the options of a node's mesh, once.

  | option | |
  |---|---|
  | `secret_file` | the fleet's secret (`mix fleet.secret` makes one), or `secret`, as loaded; default: where `Mesh.Secret` looks |
  | `fleet` | the names of all possible robots; default `mag1` to `mag100`, `min1` to `min100` |
  | `interface` | the address, or the network card, to listen on and to send from (`Mesh.Interface`); default all |
  | `port` | the UDP port; default 4370, 0 takes any |
  | `multicast` | group and port of the gossip, default `{{239, 255, 67, 86}, 4371}`; `false` for none |
  | `peers` | addresses to try, `["10.0.0.7:4370"]`, if multicast is blocked |
  | `addresses` | further addresses that others hear this node from, if a router on the way changes them (NAT), up to 8 |
  | `strategies` | further ways to find nodes, `[{Module, options}]` (`Mesh.Strategy`) |
  | `topologies` | those of `libcluster`, if it is installed (`MIX_TARGET`): any of its strategies then connects nodes |
  | `dist_port` | the port that this node's distribution listens on; default: that of `Mesh.Distribution.Epmd`, or 0 if there is an epmd to ask |
  | `allow` | what may open a distribution connection besides the fleet's nodes that are heard: addresses and networks, `["10.0.0.20", "10.0.1.0/24"]`; for nodes that were started with a carrier of the mesh (`Mesh.Distribution.Access`) |
  | `full_mesh` | up to this number of nodes each is connected to each; default 30 |
  | `degree` | above that, each is connected to about this many others, 2 to 30; default 8 |
  """
  alias Hal.{Options, RobotName}
  alias Mesh.{Interface, Secret, Strategy}
  alias Mesh.Distribution.Access.Networks
  alias Mesh.Protocol.Roster

  @gossip {{239, 255, 67, 86}, 4371}
  # The strategies check addresses.
  @table [
    secret_file: [{:path, "the path of the fleet's secret"}, default: nil],
    interface: [{:check, &Interface.read/1, Interface.allowed()}, default: {0, 0, 0, 0}],
    port: [{:integer, 0, 65_535}, default: 4370],
    dist_port: [{:integer, 0, 65_535}, default: nil],
    allow: [
      {:list,
       {:check, &__MODULE__.network?/1,
        ~s(an address or a network, "10.0.0.20" or "10.0.1.0/24",)}, 1_000},
      default: []
    ],
    full_mesh: [{:integer, 2, 1_000, "nodes"}, default: 30],
    degree: [{:integer, 2, 30, "nodes"}, default: 8],
    fleet: [Roster.type(), default: nil],
    secret: [{:struct, Secret}, default: nil],
    multicast: [{:check, &__MODULE__.given?/1, "a group and a port, or false,"}, default: @gossip],
    peers: [
      {:check, &Hal.Options.Type.list?/1, ~s(a list of addresses such as "10.0.0.7:4370")},
      default: []
    ],
    addresses: [
      {:list, {:check, &__MODULE__.peer?/1, ~s(address and port, such as "10.0.0.7:4370",)}, 8},
      default: []
    ],
    strategies: [{:check, &Hal.Options.Type.list?/1, "a list of {Module, options}"}, default: []],
    topologies: [{:check, &__MODULE__.topologies/1, "libcluster's"}, default: []]
  ]

  @written [
    multicast:
      {:or, false, {:tuple, [:ipv4, {:integer, 1, 65_535}], ~s({"239.255.67.86", 4371})}},
    peers:
      {:list, {:check, &__MODULE__.peer?/1, ~s(address and port, such as "10.0.0.7:4370",)},
       1_000}
  ]
  @in_file [
    :fleet,
    :secret_file,
    :interface,
    :port,
    :multicast,
    :peers,
    :addresses,
    :dist_port,
    :allow,
    :full_mesh,
    :degree
  ]

  defstruct Keyword.keys(@table) ++ [started: []]

  @typedoc """
  Checked options: `started` are the strategies with their states, and required options are not
  `nil` any more.
  """
  @type t :: %__MODULE__{
          secret: Secret.t(),
          secret_file: Path.t() | nil,
          fleet: [atom(), ...],
          interface: Interface.t(),
          port: :inet.port_number(),
          multicast: Strategy.address() | false,
          peers: [Strategy.address() | String.t()],
          addresses: [Strategy.address()],
          strategies: [{module(), term()}],
          topologies: keyword(),
          dist_port: :inet.port_number(),
          allow: [String.t()],
          full_mesh: pos_integer(),
          degree: pos_integer(),
          started: [{module(), state :: term()}]
        }

  @doc """
  The options that a robot file may set (`network:`): addresses are text, and there are no
  defaults.
  """
  @spec file_table() :: Options.table()
  def file_table, do: for(key <- @in_file, do: {key, @written[key] || hd(@table[key])})

  @doc "Checks options; an error is one line that names the option and what is allowed."
  @spec new(keyword()) :: {:ok, t()} | {:error, String.t()}
  def new(options) do
    with {:ok, options} <- Options.check(options, @table, "mesh"),
         options = struct!(__MODULE__, options),
         {:ok, fleet} <- fleet(options.fleet),
         {:ok, secret} <- secret(options),
         {:ok, started} <- start(options) do
      dist_port = options.dist_port || own_port()
      options = %{options | dist_port: dist_port, addresses: parsed(options.addresses)}
      {:ok, %{options | secret: secret, fleet: fleet, started: started}}
    end
  end

  @doc """
  Checks the configuration, and gives this node the fleet's cookie. A node without a name or a
  secret has no mesh, and the error says which is missing.
  """
  @spec prepare(keyword()) :: {:ok, t()} | {:error, String.t()}
  def prepare(options) do
    with {:ok, options} <- new(options),
         :ok <- Secret.apply_cookie(options.secret),
         do: {:ok, options}
  end

  @doc "The networks that may open a distribution connection by these options: those of `allow` and `peers`."
  @spec networks(t()) :: [Networks.t()]
  def networks(%__MODULE__{allow: allow, peers: peers}) do
    peers = for peer <- peers, {:ok, {ip, _port}} <- [Strategy.Static.address(peer)], do: ip
    for place <- allow ++ peers, {:ok, network} <- [Networks.read(place)], do: network
  end

  defp fleet(nil), do: {:ok, RobotName.usual()}
  defp fleet([_ | _] = names), do: {:ok, names}
  defp fleet([]), do: Options.refuse("mesh", [:fleet], [], "one robot's name at least")

  defp secret(%{secret: %Secret{} = secret}), do: {:ok, secret}
  defp secret(%{secret_file: nil}), do: Secret.from_env()
  defp secret(%{secret_file: file}), do: Secret.load(file)

  # Without an epmd, beacons tell the port to others.
  defp own_port do
    case :init.get_argument(:epmd_module) do
      {:ok, _without_epmd} ->
        [name | _host] = String.split(Atom.to_string(node()), "@")

        {:ok, port} = Mesh.Distribution.Epmd.listen_port_please(String.to_charlist(name), ~c"")

        port

      :error ->
        0
    end
  end

  defp parsed(texts) do
    for text <- texts, {:ok, address} = Strategy.Static.address(text), do: address
  end

  @doc false
  def peer?(text), do: is_binary(text) and match?({:ok, _address}, Strategy.Static.address(text))

  @doc false
  def network?(text), do: is_binary(text) and Networks.read(text) != :error

  # `nil` is not left out.
  @doc false
  def given?(group), do: group != nil

  @doc false
  def topologies([]), do: true

  def topologies(topologies) do
    cond do
      not Keyword.keyword?(topologies) ->
        Options.Wording.refuse(
          "[name: [strategy: Module, config: […]]] of libcluster",
          topologies
        )

      not Code.ensure_loaded?(Cluster.Supervisor) ->
        {:error, "need libcluster; build with MIX_TARGET=robot where Hex is, or use peers"}

      true ->
        true
    end
  end

  defp start(options) do
    gossip = if options.multicast == false, do: [], else: [{Strategy.Gossip, options.multicast}]

    static = if options.peers != [], do: [{Strategy.Static, options.peers}], else: []

    Enum.reduce_while(gossip ++ static ++ options.strategies, {:ok, []}, fn strategy,
                                                                            {:ok, done} ->
      case begin(strategy) do
        {:ok, state} -> {:cont, {:ok, done ++ [state]}}
        {:error, line} -> {:halt, {:error, "mesh option #{line}"}}
      end
    end)
  end

  defp begin({module, options}) when is_atom(module) do
    if Code.ensure_loaded?(module) and function_exported?(module, :targets, 4) do
      with {:ok, state} <- module.init(options), do: {:ok, {module, state}}
    else
      {:error, "strategies names #{inspect(module)}, which is not a Mesh.Strategy"}
    end
  end

  defp begin(other) do
    {:error, [{[], text}]} = Options.Wording.refuse("{Module, options}", other)
    {:error, "strategies: #{text}"}
  end
end
