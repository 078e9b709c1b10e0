defmodule Lab.Node.Network do
  @moduledoc """
  Says how nodes of robots are started and how they find each other, on one machine: options of `Vm.start_one/1` and of
  their mesh. Runs beside each other share nothing.

  | place | nodes |
  |---|---|
  | `:epmd` | `NAME@127.0.0.1`, on loopback, each with a known port of its own; people may attach |
  | `:group` | the same, but they find each other by multicast, so that others may join |
  | `:loopback` | `NAME@convoy` without a port mapper, on loopback, each with known ports of its own |
  | a `Vm.Net` | `NAME@convoy`, each in a namespace of its own, where links can be cut |
  """
  alias Mesh.Distribution.Epmd
  alias Mesh.Secret
  alias Vm.Net

  @host "127.0.0.1"
  @loopback {127, 0, 0, 1}
  @udp 4370
  @group {239, 255, 67, 86}
  @gossip {@group, 4371}
  @tcp ~w(-proto_dist Elixir.Mesh.Distribution.Tcp)
  @apart ~w(-start_epmd false -epmd_module Elixir.Mesh.Distribution.Epmd -setcookie none
           -kernel logger_level none)

  @enforce_keys [:place, :secret, :robots, :ports]
  defstruct @enforce_keys ++ [group: nil]

  @type place :: :epmd | :group | :loopback | Net.t()
  @typedoc "`ports` are those that are known, `{udp, tcp}` by name."
  @type t :: %__MODULE__{}

  @doc "A network of these robots, and of others that are no robots; its secret is random and in no file."
  @spec create(place(), [atom()], others :: [atom()]) :: {:ok, t()} | {:error, line :: String.t()}
  def create(place, robots, others \\ []) do
    names = if place in [:epmd, :loopback], do: robots ++ others, else: []

    with {:ok, ports} <- ports(names) do
      network = %__MODULE__{place: place, secret: Secret.random(), robots: robots, ports: ports}
      {:ok, %{network | group: {@group, 20_000 + :rand.uniform(20_000)}}}
    end
  end

  # All are open at the same time, so that no two are equal.
  defp ports(names) do
    opened =
      for name <- names,
          do: {name, :gen_udp.open(0, ip: @loopback), :gen_tcp.listen(0, ip: @loopback)}

    ports =
      for {name, {:ok, udp}, {:ok, tcp}} <- opened, into: %{} do
        [{:ok, udp_port}, {:ok, tcp_port}] = [:inet.port(udp), :inet.port(tcp)]
        {name, {udp_port, tcp_port}}
      end

    for {_name, {:ok, socket}, _tcp} <- opened, do: :gen_udp.close(socket)
    for {_name, _udp, {:ok, socket}} <- opened, do: :gen_tcp.close(socket)

    if map_size(ports) == length(names),
      do: {:ok, ports},
      else: {:error, "no port is free on #{@host} for each of #{length(names)} nodes"}
  end

  @doc "The name of a node."
  @spec node_name(t(), atom()) :: node()
  def node_name(network, name), do: :"#{name}@#{host(network)}"

  defp host(%{place: place}) when place in [:epmd, :group], do: @host
  defp host(_network), do: "convoy"

  @doc """
  How a node is started. `carrier` are the arguments that choose the carrier of its distribution. Secret and cookie are
  on no command line: the mesh gets them when it begins.
  """
  @spec vm(t(), atom(), carrier :: [String.t()]) :: Vm.options()
  def vm(network, name, carrier \\ @tcp) do
    own = [name: name, host: host(network)]

    case network.place do
      place when place in [:epmd, :group] ->
        own ++ [longnames: true, flags: Vm.fleet_flags() ++ carrier]

      :loopback ->
        {_udp, tcp} = network.ports[name]
        flags = Vm.fleet_flags() ++ @apart ++ carrier
        own ++ [flags: flags, env: [{"CONVOY_DIST_PORT", "#{tcp}"}]]

      # On all addresses, for they may change.
      net ->
        flags = Vm.fleet_flags({0, 0, 0, 0}) ++ @apart ++ carrier
        own ++ [flags: flags, through: ["ip", "netns", "exec", Net.space(net, name)]]
    end
  end

  @doc "The options of a node's mesh."
  @spec mesh(t(), atom()) :: keyword()
  def mesh(network, name),
    do: [secret: network.secret, fleet: network.robots] ++ found(network, name)

  defp found(%{place: %Net{}}, name),
    do: [port: @udp, dist_port: Epmd.default_port("#{name}"), multicast: @gossip]

  defp found(%{place: :group, group: group}, _name),
    do: [interface: @loopback, port: 0, multicast: group]

  defp found(%{place: place, ports: ports}, name) do
    {{udp, tcp}, others} = Map.pop!(ports, name)
    peers = for {_name, {port, _tcp}} <- Enum.sort(others), do: {@loopback, port}
    listens = if place == :loopback, do: [dist_port: tcp], else: []
    [interface: @loopback, port: udp, multicast: false, peers: peers] ++ listens
  end

  @doc """
  A socket of a stranger, who knows no secret, and to whom nobody speaks: what it hears is what all hear, as the guest
  `:stranger` of a `Vm.Net`. On loopback nothing is spoken to all, so there it hears nothing.
  """
  @spec stranger(t()) :: {:ok, :gen_udp.socket()} | {:error, term()}
  def stranger(%{place: %Net{} = net}) do
    {group, port} = @gossip
    space = "/var/run/netns/#{Net.space(net, :stranger)}"
    member = [reuseaddr: true, add_membership: {group, Net.address(net, :stranger)}]
    :gen_udp.open(port, [:binary, active: true, netns: space] ++ member)
  end

  def stranger(_loopback), do: :gen_udp.open(0, [:binary, active: true, ip: @loopback])

  @doc "Where a robot's node hears datagrams, if that is known."
  @spec address(t(), atom()) :: {:inet.ip4_address(), :inet.port_number()}
  def address(%{place: %Net{} = net}, robot), do: {Net.address(net, robot), @udp}
  def address(%{ports: ports}, robot), do: {@loopback, elem(ports[robot], 0)}
end
