defmodule Mesh.Server do
  @moduledoc """
  Runs the process around `Mesh.Protocol`: owns the sockets, keeps the time and carries out effects. What others ask
  often is in a table that all processes can read (`Mesh.Table`). What it hears goes to the consumer that it gets at its
  start (`Mesh.Consumer`).

  It follows the cards and addresses of the machine, five times a second (`Mesh.Interface`). Sockets that cannot be
  opened are tried again with back-off; a robot without a network drives on, and says so (`Mesh.fault/0`).
  """
  use GenServer
  alias Mesh.Distribution
  alias Hal.Event
  alias Mesh.{Backoff, Fault, Interface, Nonblocking, Options, Secret, Sockets, Table}
  alias Mesh.Protocol.{NodeTable, Packet, Roster, WireTerm}
  alias Mesh.Distribution.Epmd
  alias Mesh.Dialer

  @tick_ms 200
  @rejoin_every 50

  @doc "Starts the server of this node, with the module that receives what it hears."
  @spec start_link({Options.t(), consumer :: module()}) :: GenServer.on_start()
  def start_link({%Options{}, _consumer} = start),
    do: GenServer.start_link(__MODULE__, start, name: __MODULE__)

  @impl GenServer
  def init({%Options{} = options, consumer}) do
    # Heartbeats must not wait behind a busy robot.
    Process.flag(:priority, :high)
    written = Table.new()
    :ok = Distribution.Access.configure(Options.networks(options))
    <<session::64>> = :crypto.strong_rand_bytes(8)
    services = consumer.services()

    protocol =
      Mesh.Protocol.new(
        secret: options.secret,
        roster: Roster.new(node(), options.fleet),
        session: session,
        strategies: options.started,
        port: options.dist_port,
        group: group(options),
        consumer: consumer,
        services: Map.keys(services),
        late: consumer.late()
      )

    s = %{
      options: options,
      consumer: consumer,
      services: services,
      protocol: protocol,
      machine: machine([]),
      sockets: nil,
      closed: nil,
      backoff: Backoff.new(Hal.Clock.now_ms()),
      fault: %Fault{},
      lately: :nothing,
      written: written,
      chance: :rand.seed_s(:exsss, session),
      ticks: 0,
      sent: 0,
      heard: 0,
      next: Hal.Clock.now_ms()
    }

    {:ok, s |> connect() |> publish() |> schedule()}
  end

  # Heartbeats go to each node by its address, and also by multicast, because either way may be
  # blocked. On the loopback neither is, and sending everything twice between thirty nodes takes
  # half of the machine.
  defp group(%{multicast: false}), do: nil
  defp group(%{interface: {127, _, _, _}}), do: nil
  defp group(%{multicast: group}), do: group

  # It has a name that other nodes send to, so anything may arrive here.
  @impl GenServer
  def handle_cast({:speak, to, message}, s) do
    if to == :all or WireTerm.names?(to),
      do: {:noreply, run(s, Mesh.Protocol.speak(s.protocol, to, message, Hal.Clock.now_ms()))},
      else: {:noreply, s}
  end

  def handle_cast({:serve, service, to, term}, %{services: services} = s)
      when is_map_key(services, service) and is_atom(to),
      do:
        {:noreply, run(s, Mesh.Protocol.serve(s.protocol, service, to, term, Hal.Clock.now_ms()))}

  # To a node that the distribution is connected to, for whatever reason.
  def handle_cast({:introduce, node}, s) when is_atom(node) do
    if s.sockets, do: Nonblocking.cast({__MODULE__, node}, {:knock, node(), s.sockets.port})
    {:noreply, s}
  end

  def handle_cast({:knock, node, port}, s) when is_atom(node) and port in 1..65_535 do
    case ip(node) do
      nil -> {:noreply, s}
      ip -> {:noreply, run(s, Mesh.Protocol.knock(s.protocol, {ip, port}, Hal.Clock.now_ms()))}
    end
  end

  def handle_cast(_unknown, s), do: {:noreply, s}

  @impl GenServer
  def handle_call(:counts, _from, s) do
    counts = %{sent: s.sent, heard: s.heard, rejected: s.protocol.rejected}
    {:reply, Map.put(counts, :port, s.sockets && s.sockets.port), s}
  end

  def handle_call({:sign, label, bytes}, {caller, _tag}, s)
      when is_binary(label) and is_binary(bytes) and node(caller) == node() do
    key = Secret.subkey(s.options.secret, label)
    {:reply, {:ok, :crypto.mac(:hmac, :sha256, key, bytes)}, s}
  end

  def handle_call(_unknown, _from, s), do: {:noreply, s}

  @impl GenServer
  def handle_info({:udp, socket, ip, port, datagram}, %{sockets: %Sockets{} = sockets} = s)
      when socket == sockets.own or socket == sockets.group do
    s = %{s | heard: s.heard + 1}
    {:noreply, run(s, Mesh.Protocol.hear(s.protocol, datagram, {ip, port}, Hal.Clock.now_ms()))}
  end

  def handle_info({:udp_passive, socket}, %{sockets: %Sockets{} = sockets} = s)
      when socket == sockets.own or socket == sockets.group do
    Sockets.again(socket)
    {:noreply, s}
  end

  def handle_info(:tick, s) do
    {chance, state} = :rand.uniform_s(s.chance)
    s = connect(%{s | chance: state, ticks: s.ticks + 1, machine: machine(s.machine)})
    s = run(s, Mesh.Protocol.tick(s.protocol, Dialer.links(), Hal.Clock.now_ms(), chance))
    {:noreply, s |> judge() |> publish() |> schedule()}
  end

  # Also a reset of the network, which shows as an error on the socket.
  def handle_info(_unknown, s), do: {:noreply, s}

  # Cards and addresses come and go at any time. If the system does not tell, they are as before.
  defp machine(before) do
    case Interface.machine() do
      {:ok, machine} -> machine
      {:error, _reason} -> before
    end
  end

  defp connect(s) do
    on = Interface.addresses(s.options.interface, s.machine)
    s |> open(bound(s.options.interface, on)) |> follow(on)
  end

  # The address that the node's own socket is bound to; `nil` while it is absent.
  defp bound({0, 0, 0, 0} = all, _on), do: all
  defp bound(_interface, on), do: List.first(on)

  defp open(%{sockets: nil} = s, nil), do: s

  defp open(%{sockets: nil} = s, ip),
    do: if(Backoff.due?(s.backoff, Hal.Clock.now_ms()), do: try_open(s, ip), else: s)

  defp open(%{sockets: %{ip: ip}} = s, ip), do: s

  defp open(s, ip) do
    :ok = Sockets.close(s.sockets)
    open(%{s | sockets: nil, backoff: Backoff.new(Hal.Clock.now_ms())}, ip)
  end

  defp try_open(s, ip) do
    case Sockets.open(s.options, ip) do
      {:ok, sockets} ->
        %{s | sockets: sockets, closed: nil}

      {:error, reason} ->
        {chance, state} = :rand.uniform_s(s.chance)
        closed = "no UDP on #{Interface.text(ip)}, port #{s.options.port}: #{words(reason)}"

        %{
          s
          | closed: closed,
            chance: state,
            backoff: Backoff.tried(s.backoff, Hal.Clock.now_ms(), chance)
        }
    end
  end

  defp follow(%{sockets: nil} = s, _on), do: s

  defp follow(s, on) do
    again? = rem(s.ticks, @rejoin_every) == 0
    sockets = if again?, do: Sockets.rejoin(s.sockets), else: s.sockets
    addresses = Sockets.addresses(sockets, s.options, s.machine)
    # What came from an address that a datagram does not name would be refused.
    named = for {ip, _port} <- Enum.take(addresses, Packet.most_addresses()), ip in on, do: ip

    %{
      s
      | sockets: Sockets.follow(sockets, named),
        protocol: Mesh.Protocol.locate(s.protocol, addresses)
    }
  end

  # A node that is heard shows that there is a network.
  defp judge(s) do
    heard? = NodeTable.addresses(s.protocol.node_table) != []
    {fault, news} = Fault.tick(s.fault, if(heard?, do: nil, else: trouble(s)), Hal.Clock.now_ms())

    case news do
      {:fault, line} ->
        Event.execute([:mesh, :no_network], %{at_ms: Hal.Clock.now_ms()}, %{line: line})

      :healed ->
        Event.execute([:mesh, :network], %{at_ms: Hal.Clock.now_ms()}, %{})

      nil ->
        :ok
    end

    %{s | fault: fault, lately: if(s.lately == :sent, do: :nothing, else: s.lately)}
  end

  defp trouble(s) do
    Interface.trouble(s.options.interface, s.machine) || (s.sockets == nil && s.closed) ||
      deaf(s.sockets) || lost(s.lately)
  end

  defp deaf(%{deaf: reason, multicast: {_group, port}}) when reason != nil,
    do: "no multicast is heard on UDP port #{port}: #{words(reason)}"

  defp deaf(_listening), do: nil

  defp lost({:error, reason}), do: "nothing can be sent: #{words(reason)}"
  defp lost(_sent), do: nil

  defp words(reason), do: reason |> :inet.format_error() |> List.to_string()

  defp run(s, {protocol, effects}) do
    changed? = Enum.any?(effects, &match?({:node, _, _}, &1))
    s = Enum.reduce(effects, %{s | protocol: protocol}, &carry_out/2)
    if changed?, do: publish(s), else: s
  end

  defp carry_out({:send, _address, _datagram}, %{sockets: nil} = s), do: s

  defp carry_out({:send, address, datagram}, s) do
    # What the network does not accept now is lost, as any datagram may be.
    case {Sockets.send(s.sockets, address, datagram), s.lately} do
      {:ok, _lately} -> %{s | sent: s.sent + 1, lately: :sent}
      {{:error, _reason}, :sent} -> %{s | sent: s.sent + 1}
      {{:error, reason}, _lately} -> %{s | sent: s.sent + 1, lately: {:error, reason}}
    end
  end

  defp carry_out({:beat, robot, node, beat}, s) do
    Table.beat(robot, node, beat, Hal.Clock.now_ms())
    s
  end

  defp carry_out({:deliver, to, node, message}, s) do
    s.consumer.deliver(to, node, message)
    s
  end

  defp carry_out({:serve, service, node, term}, s) do
    {m, f, a} = Map.fetch!(s.services, service)
    apply(m, f, a ++ [node, term])
    s
  end

  defp carry_out({:node, change, node}, s) do
    Event.execute([:mesh, change], %{at_ms: Hal.Clock.now_ms()}, %{node: node})
    Dialer.note(change, node)
    s
  end

  defp carry_out({:learn, name, ip, port}, s) do
    _ = Epmd.learn(name, ip, port)
    s
  end

  defp carry_out({:event, name, about}, s) do
    Event.execute([:mesh, name], %{at_ms: Hal.Clock.now_ms()}, about)
    s
  end

  # For processes that read it without asking.
  defp publish(%{protocol: %{node_table: node_table, roster: roster, rejected: rejected}} = s) do
    :ok =
      Distribution.Access.heard(
        for({ip, _port} <- NodeTable.addresses(node_table), do: ip),
        Hal.Clock.now_ms()
      )

    written =
      Table.write(s.written, node_table, roster, rejected, s.fault.told, Hal.Clock.now_ms())

    %{s | written: written}
  end

  # The address that the connection to a node goes to.
  defp ip(node) do
    with {:ok, info} <- :net_kernel.node_info(node),
         {:net_address, {{_, _, _, _} = ip, _port}, _host, _protocol, _family} <- info[:address] do
      ip
    else
      _not_connected -> nil
    end
  end

  defp schedule(s) do
    next = max(s.next + @tick_ms, Hal.Clock.now_ms())
    Process.send_after(self(), :tick, next, abs: true)
    %{s | next: next}
  end
end
