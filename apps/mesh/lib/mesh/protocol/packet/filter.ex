defmodule Mesh.Protocol.Packet.Filter do
  @moduledoc false
  # Checks a datagram before it changes anything: whether it is new, signed, of the fleet and makes
  # sense. Pure. Whether it was made now, and by which node it was sent, `Mesh.Protocol.Admission` checks.
  alias Mesh.Consumer
  alias Mesh.Protocol.{Beacon, Challenge, NodeTable, Packet, Roster, WireTerm}
  alias Mesh.Protocol.Packet.ReplayProtection

  # The number of datagrams of unknown origin that are checked per second.
  @strange_per_second 2_000

  @type body ::
          Beacon.t()
          | {:all | [atom()], message :: term(), Consumer.about()}
          | {:challenge | :answer, Challenge.echo() | nil}
          | {:service, service :: atom(), term()}
  @type refusal ::
          Packet.refusal()
          | Packet.kind()
          | :own
          | :doubled
          | :throttled
          | :unknown_robot
          | {:unknown_node, String.t()}

  @doc """
  Reads a datagram from this address: the packet and its content. `:own` is this node's own datagram, heard by multicast.
  """
  @spec read(Mesh.Protocol.t(), binary(), Mesh.Strategy.address()) ::
          {:ok, Packet.t(), body()} | {:error, refusal()}
  def read(protocol, datagram, address) do
    with :ok <- original(Packet.peek(datagram), protocol.replay),
         :ok <- patience(protocol, address),
         {:ok, packet} <- Packet.open(datagram, protocol.secret.key),
         :ok <- foreign(packet, protocol),
         :ok <- welcome(packet.sender, protocol.roster),
         {:ok, body} <- content(packet, protocol) do
      {:ok, packet, body}
    end
  end

  # Each piece of garbage costs a signature check; beyond a limit only known senders are heard.
  defp patience(protocol, address) do
    if protocol.strange < @strange_per_second or
         address in NodeTable.addresses(protocol.node_table),
       do: :ok,
       else: {:error, :throttled}
  end

  defp foreign(%{sender: name, session: session}, %{name: name, session: session}),
    do: {:error, :own}

  defp foreign(_packet, _station), do: :ok

  defp welcome(name, roster) do
    if is_map_key(roster.nodes, name) or Roster.guest?(roster, name),
      do: :ok,
      else: {:error, {:unknown_node, name}}
  end

  # Half of all datagrams are copies, one by multicast and one by address: these cost no signature
  # check.
  defp original({:ok, {name, session, sequence}}, replay) do
    if ReplayProtection.copy?(replay, name, session, sequence), do: {:error, :doubled}, else: :ok
  end

  defp original(:error, _guard), do: :ok

  defp content(%{kind: kind, payload: payload}, _protocol) when kind in [:challenge, :answer] do
    case Challenge.read(payload) do
      {:ok, echo} -> {:ok, {kind, echo}}
      :error -> {:error, kind}
    end
  end

  defp content(packet, protocol) do
    with {:ok, term} <- Packet.unpack(packet.payload), do: body(packet.kind, term, protocol)
  end

  defp body(:beacon, term, protocol) do
    case Beacon.check(term) do
      {:ok, beacon} -> {:ok, Beacon.known(beacon, protocol.roster.nodes)}
      :error -> {:error, :beacon}
    end
  end

  defp body(:message, {to, term}, protocol) do
    with true <- to == :all or WireTerm.names?(to),
         {:ok, message, about} <- protocol.consumer.read(term) do
      if Enum.all?(about.robots, &Roster.robot?(protocol.roster, &1)),
        do: {:ok, {to, message, about}},
        else: {:error, :unknown_robot}
    else
      _malformed -> {:error, :message}
    end
  end

  defp body(:service, {service, term}, protocol) do
    if service in protocol.services,
      do: {:ok, {:service, service, term}},
      else: {:error, :service}
  end

  defp body(kind, _other, _protocol), do: {:error, kind}
end
