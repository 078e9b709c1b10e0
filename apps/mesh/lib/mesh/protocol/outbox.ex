defmodule Mesh.Protocol.Outbox do
  @moduledoc false
  # Describes what a node sends: signed datagrams, each with the next number of its session, the time and its
  # own addresses. Pure.
  alias Mesh.Protocol.{Beacon, Challenge, NodeTable, Packet, Rejections}

  @doc "A beacon for these addresses: which nodes are heard here, and which are connected."
  @spec beacon(Mesh.Protocol.t(), integer(), [Mesh.Protocol.address()]) ::
          {Mesh.Protocol.t(), [Mesh.Protocol.effect()]}
  def beacon(protocol, _now_ms, []), do: {protocol, []}

  def beacon(protocol, now_ms, addresses) do
    beacon = %Beacon{
      hears: NodeTable.hears(protocol.node_table, now_ms),
      links: protocol.links,
      port: protocol.port
    }

    seal(protocol, :beacon, Beacon.term(beacon), addresses, now_ms)
  end

  @doc """
  A challenge, or only an answer, for these addresses; `echo` is the challenge that it answers.
  """
  @spec clock(
          Mesh.Protocol.t(),
          :challenge | :answer,
          Challenge.echo() | nil,
          [Mesh.Protocol.address()],
          integer()
        ) :: {Mesh.Protocol.t(), [Mesh.Protocol.effect()]}
  def clock(protocol, _kind, _echo, [], _now_ms), do: {protocol, []}

  def clock(protocol, kind, echo, addresses, now_ms) do
    packet = packet(protocol, kind, Challenge.payload(echo), now_ms)
    sign(protocol, %{packet | payload: packet.payload <> Packet.padding(packet)}, addresses)
  end

  @doc """
  A term for these addresses. It is sealed once: a node that hears it twice, by multicast and by name,
  counts it once. What is too large for a datagram is counted as rejected.
  """
  @spec seal(
          Mesh.Protocol.t(),
          :beacon | :message | :service,
          term(),
          [Mesh.Protocol.address()],
          integer()
        ) ::
          {Mesh.Protocol.t(), [Mesh.Protocol.effect()]}
  def seal(protocol, _kind, _term, [], _now_ms), do: {protocol, []}

  def seal(protocol, kind, term, addresses, now_ms) do
    payload = Packet.pack(term)

    if byte_size(payload) > Packet.largest(),
      do: Rejections.reject(protocol, :too_big, nil),
      else: sign(protocol, packet(protocol, kind, payload, now_ms), addresses)
  end

  defp packet(protocol, kind, payload, now_ms) do
    %Packet{
      sender: protocol.name,
      session: protocol.session,
      sequence: protocol.sequence + 1,
      time_ms: now_ms,
      addresses: protocol.addresses,
      kind: kind,
      payload: payload
    }
  end

  defp sign(protocol, packet, addresses) do
    datagram = Packet.seal(packet, protocol.secret.key)
    sends = for address <- Enum.uniq(addresses), do: {:send, address, datagram}
    {%{protocol | sequence: packet.sequence}, sends}
  end
end
