defmodule Mesh.ServerTest do
  # The mesh of this VM has names; the node that it hears is the protocol on a socket of the test's.
  use ExUnit.Case, async: false
  alias Mesh.{Air, FakeConsumer, Options, Protocol}
  alias Mesh.Protocol.Roster

  @loopback {127, 0, 0, 1}

  # This node is of the fleet by whatever name it has.
  defp fleet, do: [own(0), :a, :b]
  defp other, do: :"b@#{own(1)}"
  defp own(part), do: "#{node()}" |> String.split("@") |> Enum.at(part) |> String.to_atom()

  setup do
    Process.register(self(), FakeConsumer)
    {:ok, socket} = :gen_udp.open(0, [:binary, active: true, ip: @loopback])
    {:ok, port} = :inet.port(socket)

    {:ok, options} =
      Options.new(
        secret: Air.secret(),
        fleet: fleet(),
        interface: @loopback,
        port: 0,
        multicast: false,
        peers: [{@loopback, port}],
        dist_port: 0
      )

    start_supervised!({Mesh.Supervisor, {options, FakeConsumer}})

    protocol =
      Protocol.new(
        secret: Air.secret(),
        roster: Roster.new(other(), fleet()),
        session: :rand.uniform(1_000_000_000),
        strategies: [],
        port: 0,
        consumer: FakeConsumer,
        services: [:rows, :stop]
      )

    %{peer: until(%{socket: socket, protocol: protocol, told: []}, fn _ -> met?() end)}
  end

  defp met?, do: Mesh.alive() == [other()]
  defp now, do: System.monotonic_time(:millisecond)

  # Lets the other node live until it is so.
  defp until(peer, done?, turns \\ 400) do
    cond do
      done?.(peer) ->
        peer

      turns == 0 ->
        flunk("it did not come to pass")

      true ->
        peer
        |> act(Protocol.tick(peer.protocol, [], now(), 0.5))
        |> listen()
        |> until(done?, turns - 1)
    end
  end

  defp listen(peer) do
    receive do
      {:udp, _socket, ip, port, datagram} ->
        peer |> act(Protocol.hear(peer.protocol, datagram, {ip, port}, now())) |> listen()
    after
      50 -> peer
    end
  end

  defp act(peer, {protocol, effects}) do
    for {:send, address, datagram} <- effects, do: :gen_udp.send(peer.socket, address, datagram)
    told = for effect <- effects, elem(effect, 0) in [:deliver, :serve], do: effect
    %{peer | protocol: protocol, told: told ++ peer.told}
  end

  test "what it hears goes to the consumer that it was given, and into the table", %{peer: peer} do
    {node, other} = {node(), other()}
    beat = {:beat, :b, 7, 9}
    peer = act(peer, Protocol.speak(peer.protocol, :all, beat, now()))
    assert_receive {:delivered, :all, ^other, ^beat}
    assert {7, 9, _age_ms} = Mesh.beat(:b)
    assert Mesh.heard?(:b) and Mesh.robots() == %{b: other}

    letter = {:letter, :b, "to a"}
    until(peer, fn peer -> peer.protocol.node_table.nodes["#{node}"] != nil end)
    peer = act(peer, Protocol.serve(peer.protocol, :rows, node, [1, 2]))
    assert_receive {:rows, ^other, [1, 2]}
    peer = act(peer, Protocol.speak(peer.protocol, :all, letter, now()))
    assert_receive {:delivered, :all, ^other, ^letter}

    # A service that nobody takes, and a message that is of no sense.
    peer = act(peer, Protocol.serve(peer.protocol, :hints, node, :x))
    peer = act(peer, Protocol.speak(peer.protocol, :all, :junk, now()))
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
