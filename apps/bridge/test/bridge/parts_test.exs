defmodule Bridge.PartsTest do
  use ExUnit.Case, async: true
  alias Bridge.{Broker, Client, Frames, Request, Topics}

  doctest Broker
  doctest Frames
  doctest Bridge.Cbor
  doctest Bridge.Connection
  doctest Bridge.Json
  doctest Bridge.Ros
  doctest Bridge.Rosapi
  doctest Request
  doctest Topics

  describe "frames" do
    # The messages of a stream that comes in pieces of this size.
    defp read(stream, size) do
      stream
      |> :binary.bin_to_list()
      |> Enum.chunk_every(size)
      |> Enum.reduce_while({[], %Frames{}}, fn piece, {said, frames} ->
        case Frames.read(frames, :binary.list_to_bin(piece)) do
          {:ok, more, frames} -> {:cont, {said ++ more, frames}}
          error -> {:halt, error}
        end
      end)
    end

    test "are the same, however the stream is cut" do
      long = String.duplicate("ä", 20_000)

      stream =
        Client.bytes(1, "{}") <>
          Client.bytes(9, "alive") <>
          Client.bytes(1, "spl", 0) <>
          Client.bytes(10, "") <>
          Client.bytes(0, "it") <>
          Client.bytes(2, :binary.copy(<<7>>, 126)) <>
          Client.bytes(1, long) <> Client.bytes(8, "")

      expected = [
        {:text, "{}"},
        {:ping, "alive"},
        :pong,
        {:text, "split"},
        {:binary, :binary.copy(<<7>>, 126)},
        {:text, long},
        :close
      ]

      for size <- [1, 2, 3, 7, 100, 8_192, byte_size(stream)],
          do: assert({^expected, %Frames{buffer: ""}} = read(stream, size))
    end

    test "that are none, or too long, end the connection by their status" do
      for {bytes, status} <- [
            # Not masked.
            {<<0x81, 2, "hi">>, 1002},
            # An extension that was not asked for.
            {<<0xC1, 0x80, 0::32>>, 1002},
            # A continuation of nothing, a message in another, a control frame in parts or too long.
            {Client.bytes(0, "x"), 1002},
            {Client.bytes(1, "x", 0) <> Client.bytes(1, "x"), 1002},
            {Client.bytes(9, "x", 0), 1002},
            {Client.bytes(9, String.duplicate("x", 126)), 1002},
            {Client.bytes(3, "x"), 1002},
            {Client.bytes(1, <<0xFF>>), 1007},
            # Refused by its header alone, and as a sum of parts.
            {<<0x81, 0xFF, 1_000_000_000::64>>, 1009},
            {Client.bytes(1, String.duplicate("x", 40_000), 0) <>
               Client.bytes(0, String.duplicate("x", 40_000)), 1009}
          ],
          do: assert({:error, status} == read(bytes, 1_000))
    end

    test "of noise never take more memory than the longest message, and never raise" do
      for _nth <- 1..300 do
        noise = :rand.bytes(:rand.uniform(400))

        case read(<<0x81, 0x80 + :rand.uniform(126), noise::bytes>>, 50) do
          {said, %Frames{} = frames} when is_list(said) -> assert byte_size(frames.buffer) <= 500
          {:error, status} -> assert status in 1002..1009
        end
      end
    end

    test "that are written are read by another" do
      for size <- [0, 125, 126, 65_535, 65_536] do
        data = String.duplicate("x", size)
        bytes = IO.iodata_to_binary(Frames.write({:text, data}))
        assert {{1, ^data}, _client} = Client.next(%Client{buffer: bytes})
      end
    end
  end

  describe "the broker" do
    setup do
      broker =
        [{"/tf", 100}, {"/map", :once}, {"/log", :events}, {:parameters, :changes}]
        |> Broker.new()
        |> Broker.join(:ann)
        |> Broker.join(:bob)

      %{broker: broker}
    end

    test "keeps a slow client's newest of what is as it is, and the newest hundred of what happens",
         %{broker: broker} do
      broker = broker |> Broker.ask(:ann, "/tf", 1) |> Broker.ask(:ann, "/log", 2)

      broker =
        for n <- 1..250, reduce: broker do
          broker -> broker |> Broker.say("/tf", n, n * 100) |> Broker.say("/log", n, n * 100)
        end

      {messages, broker} = Broker.take(broker, :ann)
      assert length(messages) == 101
      assert for({1, n} <- messages, do: n) == [250]
      assert for({2, n} <- messages, do: n) == Enum.to_list(151..250)
      assert {[], _broker} = Broker.take(broker, :ann)
      refute Broker.waiting?(broker, :bob)
    end

    test "says what is said once, or when it changes, also to those that come later", %{
      broker: broker
    } do
      broker = broker |> Broker.ask(:ann, "/map", 1) |> Broker.ask(:ann, :parameters, 2)
      assert Broker.due(broker, 0) == [:parameters, "/map"]
      broker = broker |> Broker.say("/map", :walls, 0) |> Broker.say(:parameters, 1, 0)
      assert Broker.due(broker, 5_000) == [:parameters]

      broker =
        broker
        |> Broker.say(:parameters, 1, 100)
        |> Broker.ask(:bob, "/map", 7)
        |> Broker.ask(:bob, :parameters, 8)

      assert {[{1, :walls}, {2, 1}], broker} = Broker.take(broker, :ann)
      assert {[{7, :walls}, {8, 1}], broker} = Broker.take(broker, :bob)
      broker = Broker.say(broker, :parameters, 1, 200)
      refute Broker.waiting?(broker, :ann)
      assert Broker.waiting?(Broker.say(broker, :parameters, 2, 300), :ann)
    end

    test "gives a client a topic as rarely as it asked for it", %{broker: broker} do
      broker = broker |> Broker.ask(:ann, "/tf", 1, 250) |> Broker.ask(:bob, "/tf", 1)

      {got, _broker} =
        Enum.map_reduce(0..9, broker, fn n, broker ->
          broker = Broker.say(broker, "/tf", n, n * 100)
          {ann, broker} = Broker.take(broker, :ann)
          {bob, broker} = Broker.take(broker, :bob)
          {{ann, bob}, broker}
        end)

      assert for({[{1, n}], _bob} <- got, do: n) == [0, 3, 6, 9]
      assert for({_ann, [{1, n}]} <- got, do: n) == Enum.to_list(0..9)
    end

    test "forgets those that have gone, and knows no topic that there is not", %{broker: broker} do
      gone = broker |> Broker.ask(:ann, "/tf", 1) |> Broker.leave(:ann)
      assert Broker.due(gone, 0) == []
      assert Broker.say(gone, "/tf", 1, 0).clients == Map.delete(broker.clients, :ann)
      assert Broker.ask(gone, :ann, "/tf", 1) == gone
      assert Broker.ask(broker, :bob, "/nothing", 1) == broker

      dropped =
        broker
        |> Broker.ask(:bob, "/tf", 1)
        |> Broker.say("/tf", 1, 0)
        |> Broker.drop(:bob, "/tf")

      assert {Broker.due(dropped, 999), Broker.waiting?(dropped, :bob)} == {[], false}
    end
  end

  test "requests become lines that a prompt understands, and nothing else does" do
    robots = [:mag1, :min1]

    for {service, request, command} <- [
          {"/stop", %{}, {:tell, :all, :stop}},
          {"/stop", %{"robot" => "min1"}, {:tell, [:min1], :stop}},
          {"/estop", %{}, :estop},
          {"/reset", %{}, :reset},
          {"/goto", %{"robot" => "mag1", "x" => 1.0e-4, "y" => -3},
           {:tell, [:mag1], {:goto, 1.0e-4, -3.0, nil}}},
          {"/formation", %{"kind" => "line", "spacing" => 2}, {:formation, {:line, 2.0}}},
          {"/formation", %{"kind" => "line"}, {:formation, {:line, nil}}}
        ] do
      assert {:ok, line} = Request.line(service, request, robots)
      assert {service, Console.Prompt.parse(line, robots)} == {service, {:ok, command}}
    end

    for {service, request} <- [
          {"/stop", %{"robot" => "mag1 estop"}},
          {"/stop", %{"robot" => ["mag1"]}},
          {"/goto", %{"robot" => "mag1", "x" => "1", "y" => 2}},
          {"/goto", %{"robot" => "mag1", "x" => 1.0e300, "y" => 2}},
          {"/goto", %{"x" => 1, "y" => 2}},
          {"/formation", %{"kind" => "line\nestop"}},
          {"/formation", %{"spacing" => 2}},
          {"/formation", %{"kind" => "line", "spacing" => "2"}}
        ],
        do: assert({:error, _line} = Request.line(service, request, robots))
  end
end
