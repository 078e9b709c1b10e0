defmodule Mesh.Protocol.Outbox do
  @moduledoc """
  What a node sends: terms as signed datagrams, each with the next number of its session. Pure.
  """
  alias Mesh.Protocol
  alias Mesh.Protocol.{Beacon, NodeTable, Packet, Rejections}
  alias Mesh.Protocol.Packet.ReplayProtection

  @doc "A beacon for these addresses: who is heard here, in which session, and who is connected."
  @spec beacon(Protocol.t(), integer(), [Protocol.address()]) ::
          {Protocol.t(), [Protocol.effect()]}
  def beacon(protocol, _now_ms, []), do: {protocol, []}

  def beacon(protocol, now_ms, addresses) do
    beacon = %Beacon{
      sessions:
        NodeTable.sessions(protocol.node_table, ReplayProtection.sessions(protocol.guard), now_ms),
      hears: NodeTable.hears(protocol.node_table, now_ms),
      links: protocol.links,
      port: protocol.port
    }

    seal(protocol, :beacon, Beacon.term(beacon), addresses)
  end

  @doc """
  A term for these addresses. It is sealed once: who hears it twice, by multicast and by name,
  counts it once. What is too large for a datagram is counted as rejected.
  """
  @spec seal(Protocol.t(), Packet.kind(), term(), [Protocol.address()]) ::
          {Protocol.t(), [Protocol.effect()]}
  def seal(protocol, _kind, _term, []), do: {protocol, []}

  def seal(protocol, kind, term, addresses) do
    payload = Packet.pack(term)

    if byte_size(payload) > Packet.largest() do
      Rejections.reject(protocol, :too_big, nil)
    else
      sequence = protocol.sequence + 1

      datagram =
        Packet.seal(
          %Packet{
            sender: protocol.name,
            session: protocol.session,
            sequence: sequence,
            kind: kind,
            payload: payload
          },
          protocol.secret.key
        )

      sends = for address <- Enum.uniq(addresses), do: {:send, address, datagram}
      {%{protocol | sequence: sequence}, sends}
    end
  end
end
