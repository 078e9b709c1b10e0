defmodule Mesh.FreshnessTest do
  # That a datagram was made now, as functions: without sockets, and an hour is a number.
  use ExUnit.Case, async: true
  alias Mesh.Air
  alias Mesh.Protocol.{NodeTable, Packet}

  @hour_ms 3_600_000
  @foreign {{10, 9, 9, 9}, 4370}

  defp two(options \\ []) do
    air = Air.new() |> Air.join("a") |> Air.join("b", options) |> Air.run(1_000)
    %{air | out: [], tap: []}
  end

  defp beat(sequence), do: {:beat, :b, 1, sequence}

  defp hears(air, name) do
    for {node, _address} <- NodeTable.hears(air.stations[name].node_table, Air.time(air, name)),
        do: String.first(node)
  end

  defp delivered(air),
    do: for({_at, "a", {:deliver, _to, _node, message}} <- Enum.reverse(air.out), do: message)

  # What a node has sent, in order.
  defp tape(air, name) do
    sender = "#{name}@lab"

    for datagram <- Enum.reverse(air.tap),
        {:ok, {^sender, _, _}} <- [Packet.peek(datagram)],
        do: datagram
  end

  defp kind(datagram) do
    {:ok, packet} = Packet.open(datagram, Air.secret().key)
    packet.kind
  end

  # What a node would send to whoever sends it this.
  defp replies(air, to, datagram, address) do
    {_protocol, effects} =
      Mesh.Protocol.hear(air.stations[to], datagram, address, Air.time(air, to))

    for {:send, ^address, reply} <- effects, do: reply
  end

  test "who was jammed for a minute, and died, does not live again by the recording" do
    air = two()
    air = %{air | cut: [{"b", "a"}]}

    air =
      Enum.reduce(1..300, air, fn n, air ->
        air |> Air.speak("b", :all, beat(n)) |> Air.run(200)
      end)

    tape = tape(air, "b")
    assert length(tape) > 300
    air = %{Air.leave(air, "b") | cut: [], now: air.now + @hour_ms, out: []} |> Air.run(1_000)

    for address <- [air.addresses["b"], @foreign] do
      played = Enum.reduce(tape, air, &(Air.inject(&2, "a", &1, address) |> Air.run(10)))
      assert {delivered(played), hears(played, "a")} == {[], []}
      reason = if address == @foreign, do: :foreign, else: :stale
      assert played.stations["a"].rejected[reason] >= 300
      # Who may be behind a router is told of it, but not 300 times.
      told =
        for {_at, "a", {:event, :foreign, about}} <- played.out,
            do: Mesh.Log.line(:foreign, about)

      assert length(told) in if(address == @foreign, do: 3..4, else: [0])

      for {:warning, line} <- told,
          do: assert(line =~ "a datagram of b@lab came from 10.9.9.9:4370")

      # Distribution is dialled nowhere else than before.
      refute Enum.any?(played.out, &match?({_, _, {:learn, _, _, _}}, &1))
    end
  end

  test "a newcomer is believed after one round trip of its first beacon" do
    air = two() |> Map.put(:out, []) |> Air.join("c")
    air = Air.run(air, 200 - rem(air.now, 200)) |> Air.run(5)

    for {one, others} <- [{"a", ~w(b c)}, {"b", ~w(a c)}, {"c", ~w(a b)}],
        do: assert(hears(air, one) == others)
  end

  test "what is under way for less than 2 s counts, what is longer does not" do
    air = two()

    {_protocol, effects} =
      Mesh.Protocol.speak(air.stations["b"], :all, beat(1), Air.time(air, "b"))

    [{:send, _address, datagram} | _] = effects

    for {ms, messages} <- [{1_900, [beat(1)]}, {2_010, []}] do
      late = Air.inject(%{air | now: air.now + ms}, "a", datagram, air.addresses["b"])
      assert delivered(late) == messages
    end
  end

  test "an answer that was held back makes nothing younger" do
    air = two()
    air = %{air | cut: [{"b", "a"}]} |> Air.run(20_000)
    # Its answers to the challenges of 20 s, and a beat of the beginning.
    {answers, others} = Enum.split_with(tape(air, "b"), &(kind(&1) in [:answer, :challenge]))
    assert answers != [] and others != []
    air = %{Air.leave(air, "b") | out: []} |> Air.run(2_500)
    air = Enum.reduce(answers ++ others, air, &Air.inject(&2, "a", &1, air.addresses["b"]))
    assert hears(air, "a") == []
  end

  test "clocks that drift by 1 % each, in either direction, make nobody stale for a minute" do
    air = Air.new() |> Air.join("a", rate: 0.99) |> Air.join("b", rate: 1.01) |> Air.run(1_000)
    air = Air.run(air, 60_000)
    refute Enum.any?(air.out, &match?({_, _, {:node, :suspect, _}}, &1))
    assert {hears(air, "a"), hears(air, "b")} == {["b"], ["a"]}
    for name <- ["a", "b"], do: refute(is_map_key(air.stations[name].rejected, :stale))
  end

  test "a computer that was suspended is believed again with its next words, and believes others" do
    for ms <- [5_000, @hour_ms] do
      air = Air.suspend(two(), "b", ms)
      air = air |> Air.speak("b", :all, beat(1)) |> Air.run(10)
      assert delivered(air) == []
      # Its first words were too old, or too young; they were answered by a challenge.
      air = air |> Air.speak("b", :all, beat(2)) |> Air.run(10)
      assert delivered(air) == [beat(2)]
      air = Air.run(%{air | out: []}, 5_000)
      assert {hears(air, "a"), hears(air, "b")} == {["b"], ["a"]}
      refute Enum.any?(air.out, &match?({_, "a", {:node, :gone, _}}, &1))
    end
  end

  test "who replays datagrams of strangers from their addresses gets small answers, and few" do
    air = two()
    air = Air.run(air, 30_000)
    tape = tape(air, "b")
    # A new life of a, which knows nobody yet.
    a = air |> Air.leave("b") |> Air.join("a") |> Map.put(:tap, [])
    address = air.addresses["b"]

    {a, sent} =
      Enum.reduce(1..5_000, {a, []}, fn n, {a, sent} ->
        datagram = Enum.at(tape, rem(n, length(tape)))

        {protocol, effects} =
          Mesh.Protocol.hear(a.stations["a"], datagram, address, Air.time(a, "a") + div(n, 5))

        {put_in(a.stations["a"], protocol), for({:send, _, reply} <- effects, do: reply) ++ sent}
      end)

    # One second: one each 20 ms for those who are heard, one for those who ask.
    assert length(sent) in 10..102
    assert Enum.all?(sent, &(byte_size(&1) == 256 and kind(&1) == :challenge))
    protocol = a.stations["a"]

    assert {map_size(protocol.challenged), protocol.replay.senders, protocol.node_table.nodes} ==
             {2, %{}, %{}}

    {protocol, _sent} = Mesh.Protocol.tick(protocol, [], Air.time(a, "a") + 2_000, 0.5)
    assert protocol.challenged == %{}
  end

  test "an answer is as large as what asked for it, however many addresses a node has" do
    air = two()
    addresses = for n <- 1..20, do: {{10, 0, 1, n}, 4370}
    many = Mesh.Protocol.locate(air.stations["a"], [air.addresses["a"] | addresses])
    assert length(many.addresses) == Packet.most_addresses()
    air = put_in(air.stations["a"], many)
    [challenge | _] = for d <- tape(Air.run(air, 15_000), "b"), kind(d) == :challenge, do: d
    asked = Air.run(air, 15_000)
    [reply] = replies(%{asked | now: asked.now}, "a", fresh(asked, challenge), air.addresses["b"])
    assert {kind(reply), byte_size(reply)} == {:answer, byte_size(challenge)}
  end

  # The same challenge, made now.
  defp fresh(air, challenge) do
    {:ok, packet} = Packet.open(challenge, Air.secret().key)
    packet = %{packet | time_ms: Air.time(air, "b"), sequence: air.stations["b"].sequence + 1}
    Packet.seal(packet, Air.secret().key)
  end

  test "stamps of no sense are stale, and spoil nothing" do
    air = two()
    {:ok, packet} = Packet.open(hd(tape(Air.run(air, 1_000), "b")), Air.secret().key)

    for time_ms <- [-0x8000000000000000, 0, 0x7FFFFFFFFFFFFFFF] do
      packet = %{packet | time_ms: time_ms, sequence: 100_000}
      absurd = Air.inject(air, "a", Packet.seal(packet, Air.secret().key), air.addresses["b"])
      assert absurd.stations["a"].rejected[:stale] == 1
      absurd = absurd |> Air.run(10) |> Air.speak("b", :all, beat(1)) |> Air.run(10)
      assert delivered(absurd) == [beat(1)]
    end
  end

  test "a robot that moves is believed at its new address, and not any more at its old one" do
    air = two()
    old = air.addresses["b"]
    new = {{10, 0, 0, 77}, 4370}
    air = put_in(air.addresses["b"], new)
    air = %{air | stations: Map.update!(air.stations, "b", &Mesh.Protocol.locate(&1, [new]))}
    air = air |> Air.speak("b", :all, beat(1)) |> Air.run(10)
    assert delivered(air) == [beat(1)]
    assert NodeTable.addresses(air.stations["a"].node_table) == [new]

    {_protocol, [{:send, _, datagram} | _]} =
      Mesh.Protocol.speak(air.stations["b"], :all, beat(2), Air.time(air, "b"))

    air = Air.inject(air, "a", datagram, old)
    assert delivered(air) == [beat(1)]
    assert NodeTable.addresses(air.stations["a"].node_table) == [new]
  end
end
