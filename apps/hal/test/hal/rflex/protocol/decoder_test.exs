defmodule Hal.RFlex.Protocol.DecoderTest do
  use ExUnit.Case, async: true
  alias Hal.RFlex.Protocol.{Decoder, Packet}
  doctest Hal.RFlex.Protocol.Decoder

  setup do
    :rand.seed(:exsss, {18, 2, 27})
    :ok
  end

  defp all(decoder \\ Decoder.new(), bytes), do: Decoder.feed(decoder, bytes)

  # A report as a controller might send it; `seasoned` ones have far more 1B than come by chance.
  defp packet(seasoned? \\ true) do
    {port, opcode, first, n} =
      Enum.random([
        {2, 33, <<>>, 25},
        {4, 2, <<>>, 8 + 3 * :rand.uniform(16)},
        {6, 1, <<2>>, 26},
        {5, 1, <<>>, 7},
        {1, 1, <<>>, 9}
      ])

    bytes = if seasoned?, do: [0, 0, 0x1B, 2, 3], else: [0, 0, 0]
    data = for _ <- 1..n, into: first, do: <<Enum.random([:rand.uniform(256) - 1 | bytes])>>
    %Packet{port: port, id: :rand.uniform(256) - 1, opcode: opcode, data: data}
  end

  defp cut(<<>>), do: []

  defp cut(bytes) do
    n = min(:rand.uniform(40), byte_size(bytes))
    {piece, rest} = :erlang.split_binary(bytes, n)
    [piece | cut(rest)]
  end

  defp feed_pieces(pieces) do
    {packets, decoder} =
      Enum.reduce(pieces, {[], Decoder.new()}, fn piece, {packets, decoder} ->
        {more, decoder} = all(decoder, piece)
        {Enum.reverse(more, packets), decoder}
      end)

    {Enum.reverse(packets), decoder}
  end

  # A ghost after each 1B of these parts.
  defp ghostly(packet, parts, ghost \\ 0x1B) do
    <<0x1B, 2, head::binary-3, n, rest::binary>> = Packet.encode(packet)
    size = byte_size(rest) - 3
    {data, <<sum, 0x1B, 3>>} = :erlang.split_binary(rest, size)
    double = fn bytes -> :binary.replace(bytes, <<0x1B>>, <<0x1B, ghost>>, [:global]) end
    part = fn bytes, name -> if name in parts, do: double.(bytes), else: bytes end

    <<0x1B, 2, part.(head, :head)::binary, part.(<<n>>, :n)::binary, part.(data, :data)::binary,
      part.(<<sum>>, :sum)::binary, 0x1B, 3>>
  end

  test "the same packets, wherever the stream is cut" do
    for _ <- 1..300 do
      packets = for _ <- 1..10, do: packet()
      stream = packets |> Enum.map(&Packet.encode/1) |> IO.iodata_to_binary()
      assert {^packets, %{given_up: 0, skipped: 0, rest: <<>>}} = all(stream)
      assert {^packets, %{given_up: 0, skipped: 0, rest: <<>>}} = feed_pieces(cut(stream))
      assert {^packets, _} = feed_pieces(for <<byte <- stream>>, do: <<byte>>)
    end
  end

  test "damage or not: the same result, wherever the stream is cut" do
    for _ <- 1..500 do
      stream =
        for(_ <- 1..8, do: Packet.encode(packet())) |> IO.iodata_to_binary() |> damage(0.02)

      {packets, whole} = all(stream)
      {^packets, cut} = feed_pieces(cut(stream))
      assert whole == cut
    end
  end

  test "a beginning that is none takes no sound frame along" do
    good = %Packet{port: 5, opcode: 1, data: <<0::32, 0x40, 0, 5>>}
    frame = Packet.encode(good)

    for start <- [
          <<0x1B, 2>>,
          <<0x1B, 2, 2, 7, 33, 25>>,
          <<0x1B, 2, 4, 0, 2, 14, 1, 2, 3>>,
          <<0x1B>>,
          "noise"
        ] do
      assert {packets, decoder} = all(start <> frame <> :binary.copy(<<0>>, 300))
      assert good in packets
      assert decoder.given_up <= 2
    end
  end

  test "a damaged length of a report that is known holds nothing up" do
    <<head::binary-5, 25, rest::binary>> =
      Packet.encode(%Packet{port: 2, opcode: 33, data: <<0::200>>})

    good = %Packet{port: 5, opcode: 1, data: <<0::32, 0x40, 0, 5>>}
    assert {[^good], _} = all(head <> <<200>> <> rest <> Packet.encode(good))
  end

  test "ghost bytes, wherever the controller puts them" do
    ways = [[:n], [:n, :data], [:n, :data, :sum], [:head, :n, :data, :sum], [:head, :n, :data]]

    for way <- ways do
      packets = for _ <- 1..500, do: packet()
      stream = packets |> Enum.map(&ghostly(&1, way)) |> IO.iodata_to_binary()
      {found, decoder} = feed_pieces(cut(stream))
      lost = length(packets -- found)
      # What is not unique by its form may be lost, or cut the next one; of these packets every
      # second has a 1B, mostly several.
      assert lost <= 10, "#{inspect(way)}: #{lost} of 500 lost"
      assert length(found -- packets) <= 3
      assert decoder.ghosts > 20
    end
  end

  test "a single ghost after any 1B of a frame with several" do
    for _ <- 1..300 do
      data = for _ <- 1..25, into: <<>>, do: <<Enum.random([0, 7, 0x1B])>>
      data = :binary.replace(data, <<0x1B, 0x1B>>, <<0x1B, 0>>, [:global])

      case :binary.matches(data, <<0x1B>>) do
        [] ->
          :ok

        places ->
          {at, 1} = Enum.random(places)
          packet = %Packet{port: 2, opcode: 33, data: data}
          {before, <<0x1B, behind::binary>>} = :erlang.split_binary(data, at)
          <<head::binary-6, _::binary-25, tail::binary>> = Packet.encode(packet)
          bytes = head <> before <> <<0x1B, 0x1B>> <> behind <> tail
          assert {[^packet], %{ghosts: 1}} = all(bytes)
      end
    end
  end

  test "another ghost value is learnt from two infrared reports in a row" do
    ir = %Packet{port: 6, opcode: 1, data: <<2, 0::208>>}
    # An N of 1B in a report with a 1B in its data.
    axis = %Packet{port: 2, opcode: 33, data: <<0x1B, 0::192>>}
    {[], decoder} = all(ghostly(axis, [:data], 0x55) <> <<0::80>>)
    {[^ir], decoder} = all(decoder, ghostly(ir, [:n], 0x55))
    {[^ir], decoder} = all(decoder, ghostly(ir, [:n], 0x55))
    assert {[^axis], _} = all(decoder, ghostly(axis, [:data], 0x55) <> <<0::80>>)
  end

  test "an idle line gives up what is unfinished, and keeps what is whole within it" do
    good = %Packet{port: 5, opcode: 1, data: <<0::32, 0x40, 0, 5>>}
    assert {[], decoder} = all(<<0x1B, 2, 9, 0, 9, 200>> <> Packet.encode(good) <> <<0x1B, 2, 1>>)
    assert Decoder.waiting?(decoder)
    assert {[^good], decoder} = Decoder.idle(decoder)
    refute Decoder.waiting?(decoder)
    assert {[], _} = Decoder.idle(Decoder.new())
  end

  test "up to 2 % of all bytes dropped, doubled or flipped: the sound frames, and what no checksum can see",
    do: bytes_damaged(5_000)

  @tag :long
  test "up to 2 % of all bytes dropped, doubled or flipped, 20000 frames",
    do: bytes_damaged(20_000)

  defp bytes_damaged(frames) do
    for rate <- [0.005, 0.01, 0.02] do
      packets = for _ <- 1..frames, do: packet(false)
      stream = packets |> Enum.map(&Packet.encode/1) |> IO.iodata_to_binary()
      size = byte_size(stream) / frames
      stream = damage(stream, rate)
      {found, decoder} = stream |> cut() |> feed_pieces()
      sent = MapSet.new(packets)
      {right, wrong} = Enum.split_with(found, &(&1 in sent))
      untouched = frames * :math.pow(1 - rate, size)
      assert length(right) >= untouched * 0.97
      assert byte_size(decoder.rest) < 530

      # A wrong one either is on the line word for word, with a checksum that fits (two flips of
      # the same bit; a byte lost and one doubled that are equal), or by taking out a ghost.
      {seen, guessed} =
        Enum.split_with(wrong, &(:binary.match(stream, Packet.encode(&1)) != :nomatch))

      damaged = frames - untouched

      IO.puts(
        "damage #{rate}: #{length(right)} of #{frames} found (#{round(untouched)} untouched), " <>
          "wrong: #{length(seen)} fit by their checksum, #{length(guessed)} by a ghost"
      )

      assert length(guessed) <= damaged / 256
      assert length(seen) <= damaged * 0.02
    end
  end

  test "one byte damaged in a frame is always found", do: one_byte_damaged(1_500)

  @tag :long
  test "one byte damaged in a frame is always found, 6000 times", do: one_byte_damaged(6_000)

  defp one_byte_damaged(times) do
    for n <- 1..times do
      packet = %{packet(false) | port: 2, opcode: 33}
      frame = Packet.encode(packet)
      at = :rand.uniform(byte_size(frame)) - 1
      {before, <<byte, behind::binary>>} = :erlang.split_binary(frame, at)

      bytes =
        case rem(n, 3) do
          0 -> <<Bitwise.bxor(byte, Bitwise.bsl(1, :rand.uniform(8) - 1))>>
          1 -> <<>>
          2 -> <<byte, byte>>
        end

      {found, _} = all(before <> bytes <> behind <> <<0::8000>>)
      assert found in [[], [packet]], inspect({packet, at, bytes})
    end
  end

  # OTP 27 counts the bits of a binary that lies on the heap, which has no other behind it.
  defp holds_little?(rest) do
    held = :binary.referenced_byte_size(rest)
    held <= 2 * byte_size(rest) + 256 or (byte_size(rest) <= 64 and held == bit_size(rest))
  end

  test "20,000 random buffers: no crash, no growth", do: random_buffers(20_000)

  @tag :long
  test "10^6 random buffers: no crash, no growth", do: random_buffers(1_000_000)

  defp random_buffers(count) do
    started = System.monotonic_time(:millisecond)
    # Cut anew each time from pools: noise; beginnings and ends without sense; damaged reports.
    pool = min(count, 200_000)
    noise = :rand.bytes(5 * pool)
    ends = for _ <- 1..pool, into: <<>>, do: Enum.random([<<0x1B>>, <<2>>, <<3>>, <<255>>])

    reports = for(_ <- 1..div(pool, 10), into: <<>>, do: Packet.encode(packet())) |> damage(0.05)

    {decoder, longest} =
      Enum.reduce(1..count, {Decoder.new(), 0}, fn n, {decoder, longest} ->
        bytes =
          case rem(n, 4) do
            0 -> slice(noise, 64)
            1 -> <<0x1B, 2, slice(noise, 16)::binary>>
            2 -> slice(ends, 32)
            3 -> slice(reports, 100)
          end

        {_packets, decoder} = all(decoder, bytes)
        assert holds_little?(decoder.rest)
        {decoder, max(longest, byte_size(decoder.rest))}
      end)

    took = System.monotonic_time(:millisecond) - started

    IO.puts(
      "#{count} random buffers into the decoder: #{took} ms, longest rest #{longest} bytes, #{decoder.packets} packets"
    )

    assert longest <= 530
  end

  defp slice(pool, most) do
    size = :rand.uniform(most)
    binary_part(pool, :rand.uniform(byte_size(pool) - size), size)
  end

  test "a long binary is not kept for its end" do
    # Short ends are copied by the machine anyway.
    rest = <<0x1B, 2, 9, 0, 9, 200, 0::800>>
    {_, decoder} = all(:binary.copy(<<0>>, 1_000_000) <> rest)
    assert decoder.rest == rest
    assert :binary.referenced_byte_size(decoder.rest) == byte_size(rest)
  end

  # Each byte is dropped, doubled or has a bit flipped with this probability.
  defp damage(bytes, rate) do
    for <<byte <- bytes>>, into: <<>> do
      if :rand.uniform() < rate do
        case :rand.uniform(3) do
          1 -> <<>>
          2 -> <<byte, byte>>
          3 -> <<Bitwise.bxor(byte, Bitwise.bsl(1, :rand.uniform(8) - 1))>>
        end
      else
        <<byte>>
      end
    end
  end
end
