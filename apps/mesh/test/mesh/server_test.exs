defmodule Mesh.ServerTest do
  use Mesh.PeerCase, async: false
  @moduletag :realtime

  test "what it hears goes to the consumer that it was given, and into the table", %{peer: peer} do
    {node, other} = {node(), other()}
    beat = {:beat, :b, 7, 9}
    peer = act(peer, Mesh.Protocol.speak(peer.protocol, :all, beat, now()))
    assert_receive {:delivered, :all, ^other, ^beat}
    assert {7, 9, _age_ms} = Mesh.beat(:b)
    assert Mesh.heard?(:b) and Mesh.robots() == %{b: other}

    letter = {:letter, :b, "to a"}
    until(peer, fn peer -> peer.protocol.node_table.nodes["#{node}"] != nil end)
    peer = act(peer, Mesh.Protocol.serve(peer.protocol, :rows, node, [1, 2], now()))
    assert_receive {:rows, ^other, [1, 2]}
    peer = act(peer, Mesh.Protocol.speak(peer.protocol, :all, letter, now()))
    assert_receive {:delivered, :all, ^other, ^letter}

    # A service that nobody takes, and a message that is of no sense.
    peer = act(peer, Mesh.Protocol.serve(peer.protocol, :hints, node, :x, now()))
    peer = act(peer, Mesh.Protocol.speak(peer.protocol, :all, :junk, now()))
    until(peer, fn _ -> match?(%{service: 1, message: 1}, Mesh.rejected()) end)
  end

  test "what it is given reaches the other node", %{peer: peer} do
    node = node()
    :ok = Mesh.speak(:all, {:letter, :a, "hello"})
    :ok = Mesh.cast(:rows, :row)
    :ok = Mesh.broadcast(:stop, :now)
    :ok = Mesh.cast(:nothing, :row)
    assert Mesh.cast(:rows, :binary.copy("x", 60_001)) == {:error, :too_big}

    peer = until(peer, &(length(&1.told) == 3))

    assert Enum.sort(peer.told) == [
             {:deliver, :all, node, {:letter, :a, "hello"}},
             {:serve, :rows, node, :row},
             {:serve, :stop, node, :now}
           ]
  end

  test "a command that has come over other nodes is handed on, and answered", %{peer: _peer} do
    [mine, other] = for _ <- 1..2, do: :erlang.alias([:reply])
    relay = fn robot, ref -> {:there, [], [node()], robot, {:command, :stop, ref}, ref} end
    GenServer.cast(Mesh.CommandRelay, relay.(:nobody, other))
    GenServer.cast(Mesh.CommandRelay, relay.(:a, mine))
    assert_receive {:command, :a, {:command, :stop, own}} when own != mine
    Mesh.Nonblocking.answer(own, :ok)
    assert_receive {^mine, :ok}
    refute_received {:command, :nobody, _request}
  end

  test "it is told when nobody speaks any more", %{peer: peer} do
    :gen_udp.close(peer.socket)
    Hal.Lines.eventually(fn -> Mesh.silent?(other()) end)
    assert Mesh.alive() == []
    Hal.Lines.eventually(fn -> Mesh.view().nodes[other()].status == :gone end)
  end
end
