defmodule Mesh.Protocol.Admission do
  @moduledoc """
  Describes what becomes of a packet that is signed, of the fleet and of sense: taken, answered or refused.
  Pure.

  It is refused if it comes from an address that its sender does not name as its own: another has
  forwarded it. A sender whose session or clock this node does not know is challenged
  (`Mesh.Protocol.Challenge`). Terms of the services that the consumer accepts late, such as a
  stop, are taken in both cases, if the session was once accepted.
  """
  alias Mesh.Protocol.{Beacon, Namesake, NodeTable, Outbox, Packet, Rejections, Roster}
  alias Mesh.Protocol.Packet.ReplayProtection

  # A challenge to an address of a node, no more often than this, once because it is heard and once
  # because it asks, and to so many of them: a replay of strangers' datagrams gains nothing.
  @challenge_ms 20
  @most_challenged 1_000

  @doc "Takes a packet that the filter has read, if it was made now; or counts why not."
  @spec admit(
          Mesh.Protocol.t(),
          Packet.t(),
          Packet.Filter.body(),
          Mesh.Protocol.address(),
          integer()
        ) :: {Mesh.Protocol.t(), [Mesh.Protocol.effect()]}
  def admit(protocol, packet, body, address, now_ms) do
    if address in packet.addresses,
      do: judge(protocol, packet, body, address, now_ms),
      else: take_late(protocol, packet, body, {:foreign, packet.sender}, address, now_ms)
  end

  @doc "Time: forgets senders that it challenged a while ago."
  @spec tick(Mesh.Protocol.t(), integer()) :: Mesh.Protocol.t()
  def tick(protocol, now_ms) do
    lately = fn {_whom, at_ms} -> now_ms - at_ms < @challenge_ms end
    %{protocol | challenged: Map.filter(protocol.challenged, lately)}
  end

  defp judge(protocol, packet, body, address, now_ms) do
    case ReplayProtection.admit(protocol.replay, packet, echo(body), now_ms) do
      {:ok, replay} ->
        # Only now its name becomes an atom: it has signed this, and just now.
        {:ok, node, roster} = Roster.enter(protocol.roster, packet.sender)
        protocol = %{protocol | roster: roster}
        new? = ReplayProtection.session(protocol.replay, packet.sender) != packet.session

        {node_table, changes} =
          NodeTable.hear(protocol.node_table, packet.sender, address, now_ms)

        protocol = %{protocol | replay: replay, node_table: node_table}
        {protocol, taken} = take(protocol, packet, node, body, address, now_ms)

        # Nodes that have just been let in need this node's word as soon.
        {protocol, sent} =
          if new?, do: Outbox.beacon(protocol, now_ms, [address]), else: {protocol, []}

        {protocol, Roster.changes(protocol.roster, changes) ++ taken ++ sent}

      {:error, :stranger, replay} ->
        protocol = Rejections.strange(%{protocol | replay: replay})
        challenge(protocol, packet, body, address, now_ms)

      {:error, :stale, replay} ->
        {protocol, taken} =
          take_late(%{protocol | replay: replay}, packet, body, :stale, address, now_ms)

        {protocol, sent} = challenge(protocol, packet, body, address, now_ms)
        {protocol, taken ++ sent}

      {:error, reason, replay} ->
        Rejections.reject(%{protocol | replay: replay}, reason, address)
    end
  end

  defp echo({kind, echo}) when kind in [:challenge, :answer], do: echo
  defp echo(_other), do: nil

  # What is taken at any age, and from anywhere; all else is rejected for that reason.
  defp take_late(protocol, packet, body, why, address, now_ms) do
    with {:service, service, _term} <- body,
         true <- service in protocol.late,
         {:ok, node} <- Roster.node(protocol.roster, packet.sender),
         {:ok, replay} <- ReplayProtection.admit_late(protocol.replay, packet, now_ms) do
      take(%{protocol | replay: replay}, packet, node, body, address, now_ms)
    else
      {:error, reason, replay} -> Rejections.reject(%{protocol | replay: replay}, reason, address)
      _not_late -> Rejections.reject(protocol, why, address)
    end
  end

  defp take(protocol, packet, node, %Beacon{} = beacon, {ip, _port}, now_ms) do
    learn = if beacon.port > 0, do: [{:learn, packet.sender, ip, beacon.port}], else: []
    node_table = NodeTable.beacon(protocol.node_table, packet.sender, beacon, now_ms)
    {protocol, told} = namesake(%{protocol | node_table: node_table}, node, ip, now_ms)
    {protocol, learn ++ told}
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

  defp take(protocol, _packet, node, {:service, service, term}, _address, _now_ms),
    do: {protocol, [{:serve, service, node, term}]}

  defp take(protocol, packet, _node, {:challenge, _echo}, address, now_ms),
    do: Outbox.clock(protocol, :answer, {packet.session, packet.time_ms}, [address], now_ms)

  defp take(protocol, _packet, _node, {:answer, _echo}, _address, _now_ms), do: {protocol, []}

  defp take(protocol, _packet, node, {to, message, _about}, _address, _now_ms),
    do: {protocol, [{:deliver, to, node, message}]}

  defp namesake(%{roster: %{me: me}} = protocol, me, ip, now_ms) do
    {tell?, namesake} = Namesake.hear(protocol.namesake, ip, now_ms)
    told = if tell?, do: [{:event, :duplicate_node, %{node: me, address: ip}}], else: []
    {%{protocol | namesake: namesake}, told}
  end

  defp namesake(protocol, _other, _ip, _now_ms), do: {protocol, []}

  # A sender that cannot be believed yet may challenge this node, too, and then gets both in one.
  defp challenge(protocol, packet, body, address, now_ms) do
    asks? = match?({:challenge, _echo}, body)
    echo = if asks?, do: {packet.session, packet.time_ms}
    whom = {asks?, packet.sender, address}
    last_ms = Map.get(protocol.challenged, whom, now_ms - @challenge_ms)

    if now_ms - last_ms >= @challenge_ms and map_size(protocol.challenged) < @most_challenged do
      protocol = put_in(protocol.challenged[whom], now_ms)
      Outbox.clock(protocol, :challenge, echo, [address], now_ms)
    else
      {protocol, []}
    end
  end
end
