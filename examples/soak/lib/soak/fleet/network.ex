defmodule Soak.Fleet.Network do
  @moduledoc """
  Provides the network of a run: a namespace for each robot where this machine allows it (`Vm.Net`), so that links can
  be cut, else the loopback interface, where each node has ports of its own. Runs beside each other share nothing.
  """
  alias Mesh.Distribution.Epmd
  alias Mesh.Secret
  alias Vm.Net

  @loopback {127, 0, 0, 1}
  @udp 4370
  @gossip {{239, 255, 67, 86}, 4371}

  @enforce_keys [:robots, :secret, :net, :ports]
  defstruct @enforce_keys

  @typedoc "`net` is `nil` on loopback; `ports` are those of robots there, `{udp, tcp}`."
  @type t :: %__MODULE__{}

  @doc "Makes the network; with namespaces the folder goes with it."
  @spec create([atom()], Path.t(), namespaces? :: boolean()) :: t()
  def create(robots, folder, true),
    do: %__MODULE__{
      robots: robots,
      secret: Secret.random(),
      net: Net.create(robots, folder, [:stranger]),
      ports: %{}
    }

  def create(robots, _folder, false),
    do: %__MODULE__{robots: robots, secret: Secret.random(), net: nil, ports: ports(robots)}

  # All are open at the same time, so that no two are equal.
  defp ports(robots) do
    open =
      for robot <- robots do
        {:ok, udp} = :gen_udp.open(0, ip: @loopback)
        {:ok, tcp} = :gen_tcp.listen(0, ip: @loopback)
        {robot, udp, tcp}
      end

    for {robot, udp, tcp} <- open, into: %{} do
      {:ok, udp_port} = :inet.port(udp)
      {:ok, tcp_port} = :inet.port(tcp)
      :ok = :gen_udp.close(udp)
      :ok = :gen_tcp.close(tcp)
      {robot, {udp_port, tcp_port}}
    end
  end

  @doc "How the node of a robot is started: options of `Vm.start_one/1`."
  @spec vm(t(), atom()) :: Vm.options()
  def vm(network, robot) do
    flags = ~w(-start_epmd false -epmd_module Elixir.Mesh.Distribution.Epmd -setcookie none
               -kernel logger_level none -proto_dist Elixir.Mesh.Distribution.Tcp)

    {listen, env, through} =
      case network.net do
        nil ->
          {_udp, tcp} = network.ports[robot]
          {@loopback, [{"CONVOY_DIST_PORT", "#{tcp}"}], []}

        # On all addresses, for they may change.
        net ->
          {{0, 0, 0, 0}, [], ["ip", "netns", "exec", Net.space(net, robot)]}
      end

    [
      name: robot,
      host: "convoy",
      flags: Vm.fleet_flags(listen) ++ flags,
      env: env,
      through: through
    ]
  end

  @doc "The options of a robot's mesh."
  @spec mesh(t(), atom()) :: keyword()
  def mesh(%{net: nil, ports: ports} = network, robot) do
    {{udp, tcp}, others} = Map.pop!(ports, robot)
    peers = for {_robot, {port, _tcp}} <- Enum.sort(others), do: {@loopback, port}

    [interface: @loopback, port: udp, dist_port: tcp, multicast: false, peers: peers] ++
      same(network)
  end

  def mesh(network, robot),
    do:
      [port: @udp, dist_port: Epmd.default_port("#{robot}"), multicast: @gossip] ++ same(network)

  defp same(network), do: [secret: network.secret, fleet: network.robots]

  @doc """
  A socket of a stranger, who knows no secret, and to whom nobody speaks: what it hears is what all hear. On
  loopback nothing is spoken to all, so there it hears nothing.
  """
  @spec stranger(t()) :: {:ok, :gen_udp.socket()} | {:error, term()}
  def stranger(%{net: nil}), do: :gen_udp.open(0, [:binary, active: true, ip: @loopback])

  def stranger(%{net: net}) do
    {group, port} = @gossip
    space = "/var/run/netns/#{Net.space(net, :stranger)}"

    options = [
      :binary,
      active: true,
      netns: space,
      reuseaddr: true,
      add_membership: {group, Net.address(net, :stranger)}
    ]

    :gen_udp.open(port, options)
  end

  @doc "Where a robot's node hears datagrams."
  @spec address(t(), atom()) :: {:inet.ip4_address(), :inet.port_number()}
  def address(%{net: nil, ports: ports}, robot), do: {@loopback, elem(ports[robot], 0)}
  def address(%{net: net}, robot), do: {Net.address(net, robot), @udp}

  @doc "Changes the network as a deed of `Soak.Schedule` says; says who reaches whom from then on."
  @spec change(t(), tuple()) :: [{atom(), atom()}]
  def change(%{net: net}, {:block, a, b, _ms}) do
    :ok = Net.block(net, a, b)
    [{a, b}]
  end

  def change(%{net: net}, {:split, [one, other] = parts, _ms}) do
    :ok = Net.split(net, parts)
    for a <- one, b <- other, do: {a, b}
  end

  def change(%{net: net}, {:loss, share, _ms}) do
    :ok = Net.lose(net, share)
    []
  end

  @doc "Makes the network whole."
  @spec heal(t()) :: :ok
  def heal(%{net: nil}), do: :ok
  def heal(%{net: net}), do: Net.heal(net)

  @doc "Takes it away."
  @spec delete(t()) :: :ok
  def delete(%{net: nil}), do: :ok
  def delete(%{net: net}), do: Net.delete(net)
end
