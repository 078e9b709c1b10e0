defmodule Mesh.ProtocolTest do
  use ExUnit.Case, async: true
  alias Mesh.Air
  alias Mesh.Protocol.{NodeTable, Packet}

  defp beat(id, sequence), do: {:beat, id, 1, sequence}

  defp hears(air, name) do
    for {node, _address} <- NodeTable.hears(air.stations[name].node_table, Air.time(air, name)),
        do: String.first(node)
  end

  defp changes(air, name),
    do: for({at, ^name, {:node, change, node}} <- Enum.reverse(air.out), do: {at, change, node})

  test "three nodes find each other by multicast, within a second" do
    air = Air.new() |> Air.join("a") |> Air.join("b") |> Air.join("c") |> Air.run(1_000)
    for name <- ~w(a b c), do: assert(hears(air, name) == ~w(a b c) -- [name])
  end

  test "without multicast one address that is up is enough for all" do
    air =
      Air.new()
      |> Air.join("a", multicast: false)
      |> Air.join("b", multicast: false, peers: ["a"])
      |> Air.join("c", multicast: false, peers: ["a"])
      |> Air.run(2_000)

    # Those who know only the one learn of each other by its beacons.
    for name <- ~w(a b c), do: assert(hears(air, name) == ~w(a b c) -- [name])
  end

  test "who falls silent is suspect after 1 s and gone after 2 s, and comes back by itself" do
    air = Air.new() |> Air.join("a") |> Air.join("b") |> Air.run(1_000)
    air = air |> Map.put(:out, []) |> Air.leave("b") |> Air.run(20_000)
    assert [{suspect, :suspect, :b@lab}, {gone, :gone, :b@lab}] = changes(air, "a")
    assert suspect in 2_000..2_200 and gone in 3_000..3_200

    # A new session of the same name is let in at once, for the old one is silent.
    air = air |> Map.put(:out, []) |> Air.join("b") |> Air.run(6_000)
    assert [{_at, :up, :b@lab}] = changes(air, "a")
    assert hears(air, "b") == ["a"]
  end

  test "without multicast, too, the one who was away for long is found again, for ever" do
    peers = [multicast: false, peers: ["a"]]
    air = Air.new() |> Air.join("a", multicast: false) |> Air.join("b", peers) |> Air.run(1_000)
    air = %{air | cut: [{"a", "b"}, {"b", "a"}]} |> Air.run(60_000)
    assert hears(air, "a") == [] and hears(air, "b") == []
    air = %{air | cut: []} |> Air.run(7_000)
    assert hears(air, "a") == ["b"] and hears(air, "b") == ["a"]
  end

  # Signed, as a node with a bug would.
  defp packet(air, name, sequence, kind, payload) do
    %Packet{
      sender: "#{name}@lab",
      session: air.stations[name].session,
      sequence: sequence,
      time_ms: Air.time(air, name),
      addresses: [air.addresses[name]],
      kind: kind,
      payload: payload
    }
  end

  defp inject(air, to, packet, address),
    do: Air.inject(air, to, Packet.seal(packet, Air.secret().key), address)

  test "a beacon that tells of numbers and nodes of no sense spoils nobody else's" do
    air = Air.new() |> Air.join("a") |> Air.join("b") |> Air.join("c") |> Air.run(1_000)
    huge = :binary.decode_unsigned(<<1, :rand.bytes(20_000)::binary>>)
    place = {{10, 0, 0, 7}, 4370}
    many = for n <- 1..900, do: {"#{n}#{String.duplicate("x", 200)}@lab", place}
    names = for {name, _place} <- many, do: name

    for told <- [{[{"c@lab", {{10, 0, 0, 7}, huge}}], [], 0}, {[], [], huge}, {many, names, 0}] do
      beacon = packet(air, "a", 100_000, :beacon, Packet.pack(told))
      spoilt = inject(air, "b", beacon, air.addresses["a"])
      spoilt = %{spoilt | tap: []} |> Air.run(5_000)
      assert "c" in hears(spoilt, "b") and "b" in hears(spoilt, "c")
      # What a tells is refused, or, of nodes that nobody knows, not told any further.
      assert spoilt.stations["b"].node_table.leads == %{}
      assert map_size(spoilt.stations["b"].node_table.nodes) == 2

      said =
        for datagram <- spoilt.tap,
            {:ok, {"b@lab", _, _}} <- [Packet.peek(datagram)],
            do: datagram

      assert said != [] and Enum.all?(said, &(byte_size(&1) < 1_000))
    end
  end

  test "a robot that is of no fleet is not heard by way of another either" do
    air = Air.new() |> Air.join("a") |> Air.join("b") |> Air.run(1_000)
    air = air |> Air.speak("b", :all, beat(:b, 1)) |> Air.run(5) |> Map.put(:out, [])

    [none, one] =
      for id <- [:undefined, :c] do
        air |> Air.speak("a", [:b], {:passed_on, :a, beat(id, 1)}) |> Air.run(5)
      end

    assert delivered(none) == []
    assert none.stations["b"].rejected[:unknown_robot] == 1
    assert [{_at, "b", {:deliver, [:b], :a@lab, _}}] = delivered(one)
  end

  test "a heartbeat arrives once though it comes by multicast and by name" do
    air = Air.new() |> Air.join("a") |> Air.join("b") |> Air.run(1_000)
    air = air |> Air.speak("a", :all, beat(:a, 1)) |> Air.run(5)
    assert [{_at, "b", {:deliver, :all, :a@lab, message}}] = delivered(air)
    assert message == beat(:a, 1)
    assert air.stations["b"].rejected == %{doubled: 1}
  end

  test "other messages go to the nodes of the robots named only" do
    air = Air.new() |> Air.join("a") |> Air.join("b") |> Air.join("c") |> Air.run(1_000)
    air = air |> Air.speak("b", :all, beat(:b, 1)) |> Air.run(5) |> Map.put(:out, [])
    air = air |> Air.speak("a", [:b, :c], beat(:a, 1)) |> Air.run(5)
    assert [{_at, "b", {:deliver, [:b, :c], :a@lab, _message}}] = delivered(air)
  end

  defp delivered(air), do: Enum.filter(air.out, &match?({_, _, {:deliver, _, _, _}}, &1))

  test "another fleet on the same group is not heard, and hears nothing" do
    air = Air.new() |> Air.join("a") |> Air.join("b", secret: Air.secret("x")) |> Air.run(2_000)
    assert hears(air, "a") == [] and hears(air, "b") == []
    assert %{unsigned: n} = air.stations["a"].rejected
    assert n > 0
  end

  # From the sender's own address, which is easily forged, and from one of the attacker's.
  defp play(air, tape, to) do
    own = air.addresses["b"]

    for address <- [own, {{10, 9, 9, 9}, 1}], datagram <- tape, reduce: air do
      air -> Air.inject(air, to, datagram, address)
    end
  end

  defp without_events(air), do: Enum.reject(air.out, &match?({_, _, {:event, _, _}}, &1))

  test "what was recorded lets nobody in: neither in the same life nor in another" do
    air = Air.new() |> Air.join("a") |> Air.join("b") |> Air.run(1_000)
    air = Air.speak(air, "b", :all, beat(:b, 1)) |> Air.run(5)

    tape =
      for datagram <- Enum.reverse(air.tap),
          {:ok, {"b@lab", _, _}} <- [Packet.peek(datagram)],
          do: datagram

    # In the same life: every datagram is known.
    again = play(%{air | out: []}, tape, "a")
    assert without_events(again) == []

    # After b has gone: nothing of its tape wakes it again.
    gone = air |> Air.leave("b") |> Air.run(5_000) |> Map.put(:out, [])
    gone = play(gone, tape, "a") |> Air.run(500)
    assert hears(gone, "a") == [] and changes(gone, "a") == []

    # After a has started anew and knows nothing: the tape names a session that is over.
    fresh = air |> Air.leave("a") |> Air.leave("b") |> Air.run(5_000) |> Air.join("a")
    fresh = play(%{fresh | out: []}, tape, "a") |> Air.run(500)
    assert hears(fresh, "a") == [] and delivered(fresh) == []
  end

  test "a session that is over is not believed again, though it told the right number once" do
    air = Air.new() |> Air.join("a") |> Air.join("b") |> Air.run(1_000)
    tape = Enum.reverse(air.tap)
    air = air |> Air.leave("b") |> Air.run(3_000) |> Air.join("b") |> Air.run(2_000)
    air = air |> Air.leave("b") |> Air.run(3_000) |> Map.put(:out, [])
    air = play(air, tape, "a") |> Air.run(500)
    assert hears(air, "a") == []
    assert air.stations["a"].rejected[:replayed] > 0
  end

  test "a second node of one name is kept out while the first is heard, and told of" do
    air = Air.new() |> Air.join("a") |> Air.join("b") |> Air.run(1_000)
    first = air.stations["a"]
    twin = Map.put(air.addresses, "twin", {{10, 0, 0, 99}, 4370})
    air = %{air | addresses: twin} |> Air.join("twin")
    impostor = %{air.stations["twin"] | name: "a@lab", node_table: NodeTable.new("a@lab")}
    impostor = %{impostor | roster: first.roster}
    air = put_in(air.stations["twin"], impostor) |> Map.put(:out, []) |> Air.run(3_000)

    # b goes on with the first; both of the name learn of each other, once.
    assert changes(air, "b") == []
    assert [%{address: {10, 0, 0, 99}, node: :a@lab}] = told(air, "a", :duplicate_node)
    assert [_once] = told(air, "twin", :duplicate_node)

    air = Air.run(%{air | out: []}, 290_000)
    assert told(air, "a", :duplicate_node) == []
    air = Air.run(air, 10_000)
    assert [_again] = told(air, "a", :duplicate_node)

    # When it is gone this is told, once, and others hear the one that is left.
    air = %{air | out: []} |> Air.leave("a") |> Air.run(30_000)
    assert [%{node: :a@lab}] = told(air, "twin", :unique_node)
    assert told(air, "twin", :duplicate_node) == []
    assert hears(air, "b") == ["a"]
  end

  defp told(air, station, event),
    do: for({_at, ^station, {:event, ^event, about}} <- air.out, do: about)

  # Ten in a row are lost once in some two hundred such minutes: of this one it is known.
  test "loss of a third of all datagrams makes nobody suspect for long" do
    :rand.seed(:exsss, 1)
    air = Air.new(loss: 0.33) |> Air.join("a") |> Air.join("b") |> Air.run(3_000)
    air = Air.run(%{air | out: []}, 60_000)
    refute Enum.any?(changes(air, "a"), &match?({_, :gone, _}, &1))
  end

  test "names that cannot be let in are counted and told of; no name becomes an atom before it was shown to be fresh" do
    air = Air.new() |> Air.join("a") |> Air.join("b") |> Air.run(1_000) |> Map.put(:out, [])
    address = {{10, 0, 0, 99}, 4370}

    say = fn names, air ->
      Enum.reduce(names, air, fn name, air ->
        packet = packet(air, "b", 1, :beacon, Packet.pack({[], [], 0}))
        inject(air, "a", %{packet | sender: name, addresses: [address]}, address)
      end)
    end

    strange = for n <- 1..50, do: "Rover#{n}_#{:rand.uniform(1_000_000_000)}@lab"
    air = say.(strange, air)
    assert air.stations["a"].rejected.unknown_node == 50
    assert [{_, "a", {:event, :unknown_node, %{name: "Rover1_" <> _}}}] = air.out

    # Signed once, and recorded perhaps: who says this now is asked first.
    guests = for n <- 1..50, do: "rover#{n}_#{:rand.uniform(1_000_000_000)}@lab"
    air = say.(guests, air)
    assert air.stations["a"].rejected.unknown_node == 50

    # Of these names, not of all: other tests make atoms meanwhile.
    for name <- strange ++ guests,
        do: assert_raise(ArgumentError, fn -> String.to_existing_atom(name) end)
  end

  test "a node with the secret is let in by any name, and so many of them" do
    air = Air.new() |> Air.join("a") |> Air.join("laptop") |> Air.run(1_000)

    assert {"a", :up, :laptop@lab} in Enum.map(changes(air, "a"), fn {_ms, change, node} ->
             {"a", change, node}
           end)

    assert {"b", :up, :a@lab} in Enum.map(changes(air, "laptop"), fn {_ms, change, node} ->
             {"b", change, node}
           end)

    air = Enum.reduce(1..70, air, &Air.join(&2, "guest#{&1}"))
    air = Air.run(air, 3_000)
    a = air.stations["a"]
    assert a.roster.guests == 64
    assert map_size(a.node_table.nodes) == 64
    assert a.rejected.unknown_node > 0
  end

  test "random, cut, and turned-over datagrams are counted and change nothing" do
    air = Air.new() |> Air.join("a") |> Air.join("b") |> Air.run(1_000)
    tape = air.tap
    air = %{air | out: []}

    garbage =
      for _ <- 1..2_000 do
        case :rand.uniform(3) do
          1 ->
            :crypto.strong_rand_bytes(:rand.uniform(1_500))

          2 ->
            tape |> Enum.random() |> flip()

          3 ->
            tape |> Enum.random() |> then(&binary_part(&1, 0, :rand.uniform(byte_size(&1)) - 1))
        end
      end

    after_all = Enum.reduce(garbage, air, &Air.inject(&2, "a", &1))
    assert after_all.out == []

    assert Map.drop(after_all.stations["a"].rejected, [
             :doubled,
             :unsigned,
             :not_ours,
             :version,
             :throttled
           ]) ==
             Map.drop(air.stations["a"].rejected, [
               :doubled,
               :unsigned,
               :not_ours,
               :version,
               :throttled
             ])
  end

  defp flip(datagram) do
    at = :rand.uniform(byte_size(datagram)) - 1
    {head, <<byte, tail::binary>>} = :erlang.split_binary(datagram, at)
    <<head::binary, Bitwise.bxor(byte, :rand.uniform(255)), tail::binary>>
  end

  test "a flood of garbage from one address does not keep known nodes out" do
    air = Air.new() |> Air.join("a") |> Air.join("b") |> Air.run(2_000) |> Map.put(:out, [])
    junk = :crypto.strong_rand_bytes(100)
    flooded = Enum.reduce(1..10_000, air, fn _, air -> Air.inject(air, "a", junk) end)
    assert flooded.stations["a"].rejected.throttled == 8_000
    flooded = flooded |> Air.speak("b", :all, beat(:b, 1)) |> Air.run(3)
    assert [_one] = delivered(flooded)
  end

  test "a signed message that no robot may act on is refused" do
    air = Air.new() |> Air.join("a") |> Air.join("b") |> Air.run(1_000) |> Map.put(:out, [])

    for {term, reason} <- [
          {{:all, beat(:zed, 1)}, :unknown_robot},
          {{:all, :junk}, :message},
          {{[1, 2], beat(:b, 1)}, :message},
          {:junk, :message}
        ] do
      packet = packet(air, "b", 100_000, :message, Packet.pack(term))
      air = inject(air, "a", packet, air.addresses["b"])
      assert air.stations["a"].rejected[reason] == 1
      assert air.out == []
    end
  end

  test "a small datagram that unpacks to a large one is refused" do
    bomb = :erlang.term_to_binary(:binary.copy(<<0>>, 10_000_000), compressed: 9)
    assert byte_size(bomb) < 20_000
    assert Packet.unpack(bomb) == {:error, :payload}
    assert {:error, :payload} = Packet.unpack(binary_part(bomb, 0, 100))
  end
end
