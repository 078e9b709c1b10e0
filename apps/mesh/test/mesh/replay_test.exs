defmodule Mesh.ReplayTest do
  # What an attacker in radio range does with datagrams that the fleet has signed, on real sockets.
  use Mesh.PeerCase, async: false
  @moduletag :realtime

  @foreign {127, 0, 0, 2}
  @elsewhere {127, 0, 0, 3}
  @hour_ms 3_600_000

  # What `b` made an hour ago, while nobody could hear it: 300 heartbeats.
  defp tape(peer) do
    Enum.flat_map_reduce(1..300, peer, fn n, peer ->
      then_ms = now() - @hour_ms + 200 * n
      keep_back(peer, Mesh.Protocol.speak(peer.protocol, :all, {:beat, :b, 1, n}, then_ms))
    end)
  end

  defp play(tape, socket) do
    heard = Mesh.counts().heard
    for {address, datagram} <- tape, do: :gen_udp.send(socket, address, datagram)
    Hal.Lines.eventually(fn -> Mesh.counts().heard - heard >= length(tape) end)
  end

  test "what was recorded an hour ago and never received wakes no dead robot", %{peer: peer} do
    {tape, peer} = tape(peer)
    assert length(tape) == 300
    Hal.Lines.eventually(fn -> Mesh.view().nodes[other()].status == :gone end)

    {foreign, _address} = SocketPeer.open(@foreign)
    for socket <- [foreign, peer.socket], do: play(tape, socket)
    assert {Mesh.alive(), Mesh.robots(), Mesh.beat(:b)} == {[], %{}, nil}
    refute_received {:delivered, _to, _node, _message}
    Hal.Lines.eventually(fn -> match?(%{foreign: 300, stale: 300}, Mesh.rejected()) end)

    # It was not dead: its own word is believed again at once.
    peer = until(peer, fn _ -> Mesh.alive() == [other()] end)
    act(peer, Mesh.Protocol.speak(peer.protocol, :all, {:beat, :b, 1, 301}, now()))
    Hal.Lines.eventually(fn -> match?({1, 301, _age_ms}, Mesh.beat(:b)) end)
  end

  test "who forwards a datagram before it arrives does not become its sender", %{peer: peer} do
    {foreign, _address} = SocketPeer.open(@foreign)

    peer =
      Enum.reduce(1..20, peer, fn n, peer ->
        beat = {:beat, :b, 1, n}
        {tape, peer} = keep_back(peer, Mesh.Protocol.speak(peer.protocol, :all, beat, now()))
        for socket <- [foreign, peer.socket], do: play(tape, socket)
        assert_receive {:delivered, :all, _node, ^beat}
        refute_received {:delivered, :all, _node, ^beat}
        peer
      end)

    # The answers went to the sender.
    until(peer, &match?([_ | _], &1.protocol.node_table.nodes["#{node()}"].hears))
    refute_received {:udp, ^foreign, _ip, _port, _datagram}
    Hal.Lines.eventually(fn -> match?(%{foreign: 20}, Mesh.rejected()) end)
  end

  test "a robot that has moved to another address is heard from there, and answered", %{
    peer: peer
  } do
    peer = SocketPeer.move(peer, SocketPeer.open(@elsewhere))
    :ok = Mesh.speak(:all, {:letter, :a, "before"})
    said = fn peer -> peer |> Map.fetch!(:told) |> Enum.map(&elem(&1, 3)) end

    peer =
      until(peer, fn peer ->
        :ok = Mesh.speak(:all, {:letter, :a, "after"})
        {:letter, :a, "after"} in said.(peer)
      end)

    assert Mesh.alive() == [other()]
    refute {:letter, :a, "before"} in said.(peer)
  end

  test "a stop is taken however old it is, and whoever forwards it", %{peer: peer} do
    {foreign, _address} = SocketPeer.open(@foreign)
    other = other()
    Hal.Lines.eventually(fn -> Mesh.view().nodes[other()].status == :gone end)

    for {socket, n} <- [{foreign, 1}, {peer.socket, 2}], reduce: peer do
      peer ->
        stop =
          Mesh.Protocol.serve(peer.protocol, :stop, :everywhere, {:stop, n}, now() - @hour_ms)

        {tape, peer} = keep_back(peer, stop)
        play(tape, socket)
        assert_receive {:stop, ^other, {:stop, ^n}}
        # Once, and it says nothing of who is alive.
        play(tape, socket)
        refute_received {:stop, ^other, _term}
        assert Mesh.alive() == []
        peer
    end
  end
end
