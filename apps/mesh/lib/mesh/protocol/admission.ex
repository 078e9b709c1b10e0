defmodule Mesh.Protocol.Admission do
  @moduledoc """
  What becomes of a packet that is signed, of the fleet and of sense: taken, answered or refused.
  Pure.

  A stranger, whose session this node does not know, gets a beacon that tells it its session, and
  so asks for its word (`Mesh.Protocol.Packet.ReplayProtection`).
  """
  alias Mesh.Protocol
  alias Mesh.Protocol.{Beacon, NodeTable, Outbox, Packet, Rejections, Roster}
  alias Mesh.Protocol.Packet.ReplayProtection

  # An answer to a stranger, no more often than this for each.
  @answer_ms 20

  @doc "Takes a packet that the filter has read, if it was made now; or counts why not."
  @spec admit(
          Protocol.t(),
          Packet.t(),
          node(),
          Packet.Filter.body(),
          Protocol.address(),
          integer()
        ) :: {Protocol.t(), [Protocol.effect()]}
  def admit(protocol, packet, node, body, address, now_ms) do
    told =
      with %Beacon{sessions: sessions} <- body,
           {_name, session} <- List.keyfind(sessions, protocol.name, 0),
           do: session,
           else: (_none -> nil)

    admitted =
      ReplayProtection.admit(
        protocol.guard,
        packet.sender,
        packet.session,
        packet.sequence,
        told,
        now_ms
      )

    case admitted do
      {:ok, guard} ->
        new? = ReplayProtection.session(protocol.guard, packet.sender) != packet.session

        {node_table, changes} =
          NodeTable.hear(protocol.node_table, packet.sender, address, now_ms)

        protocol = %{protocol | guard: guard, node_table: node_table}
        {protocol, taken} = take(protocol, packet, node, body, address, now_ms)

        # Those who have just been let in need this node's word as soon.
        {protocol, sent} =
          if new?, do: answer(protocol, packet, address, now_ms), else: {protocol, []}

        {protocol, Roster.changes(protocol.roster, changes) ++ taken ++ sent}

      {:error, :stranger, guard} ->
        answer(%{protocol | guard: guard}, packet, address, now_ms)

      {:error, reason, guard} ->
        Rejections.reject(%{protocol | guard: guard}, reason, address)
    end
  end

  defp take(protocol, packet, node, %Beacon{} = beacon, {ip, _port}, now_ms) do
    learn = if beacon.port > 0, do: [{:learn, packet.sender, ip, beacon.port}], else: []

    rival =
      if node == protocol.roster.me, do: [{:event, :duplicate_node, %{node: node}}], else: []

    {%{
       protocol
       | node_table: NodeTable.beacon(protocol.node_table, packet.sender, beacon, now_ms)
     }, learn ++ rival}
  end

  # A heartbeat that is meant for some only is passed on: its robot is elsewhere.
  defp take(
         protocol,
         packet,
         node,
         {:all, message, %{beat: {_, _} = beat} = about},
         _from,
         now_ms
       ) do
    from = hd(about.robots)
    node_table = NodeTable.robot(protocol.node_table, packet.sender, from, beat, now_ms)

    {%{protocol | node_table: node_table},
     [{:beat, from, node, beat}, {:deliver, :all, node, message}]}
  end

  defp take(protocol, _packet, node, {to, message, _about}, _address, _now_ms),
    do: {protocol, [{:deliver, to, node, message}]}

  defp take(protocol, _packet, node, {service, term}, _address, _now_ms),
    do: {protocol, [{:serve, service, node, term}]}

  # A beacon that tells the stranger its session, and so asks for its word.
  defp answer(protocol, packet, address, now_ms) do
    node_table = NodeTable.claim(protocol.node_table, packet.sender, packet.session)
    protocol = %{protocol | node_table: node_table}

    if now_ms - Map.get(protocol.answered, packet.sender, now_ms - @answer_ms) >= @answer_ms do
      protocol = put_in(protocol.answered[packet.sender], now_ms)
      Outbox.beacon(protocol, now_ms, [address])
    else
      {protocol, []}
    end
  end
end
