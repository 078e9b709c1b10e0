defmodule Player.WireTest do
  use ExUnit.Case, async: true
  alias Player.{Client, Queue, Session, Wire, Xdr}
  doctest Xdr
  doctest Wire
  doctest Queue
  doctest Player.Devices
  doctest Player.Door

  @body %{
    profile: Hal.Profile.magellan(),
    sonars: Hal.Profile.magellan().sonars,
    pictures?: false
  }

  # The worked example of the protocol's sheet.
  test "writes what a real server writes" do
    session = Session.new(:mag1, @body, {127, 0, 0, 1}, 6701)
    said = fn message -> Session.hear(session, message, 0.0) end

    {:ok, pulling, []} = said.(Client.message({1, 0}, 3, 5, <<2::32>>))
    assert {[bytes], _} = Session.take(pulling)

    assert IO.iodata_to_binary(bytes) ==
             Base.decode16!(
               "0100007F00001A2D00000001000000000000000400000005" <>
                 "00000000000000000000000000000000"
             )

    dev = <<0::32, 0::32, 4::32, 0::32, 1::32, 0::32, 0::32>>
    {:ok, opened, [ask: {:position2d, 0}]} = said.(Client.message({1, 0}, 3, 3, dev))
    {[bytes], _} = Session.take(opened)

    assert binary_part(IO.iodata_to_binary(bytes), 36, 40) ==
             (Base.decode16!(
                "00000024" <>
                  "0100007F00001A2D0000000400000000" <> "00000001" <> "0000000700000007"
              ) <> "convoy" <> <<0, 0>>)
             |> binary_part(0, 40)
  end

  test "data has the bytes of the worked example" do
    speed = {0.2, 0.0, 0.1}

    assert <<_head::binary-size(32), payload::binary>> =
             Wire.encode({:position2d, 0}, :cmd, 1, %{speed: speed, on: 1}, 0.0)

    assert payload ==
             Base.decode16!(
               "3FC999999999999A" <> "0000000000000000" <> "3FB999999999999A" <> "00000001",
               case: :mixed
             )

    pressed =
      for k <- 0..15, into: "", do: <<if(k == 1, do: 4, else: if(k == 0, do: 1, else: 0))>>

    bumpers = Wire.encode({:bumper, 0}, :data, 1, %{bumpers: pressed}, 0.0)
    assert byte_size(bumpers) == 32 + 24
    blobs = Wire.encode({:blobfinder, 0}, :data, 1, %{width: 320, height: 240, blobs: []}, 0.0)
    assert binary_part(blobs, 32, 16) == Base.decode16!("00000140000000F00000000000000000")
    volts = %{valid: 1, volts: 1.0, percent: 0.0, joules: 0.0, watts: 0.0, charging: 0}
    assert byte_size(Wire.encode({:power, 0}, :data, 1, volts, 0.0)) == 32 + 24
  end

  test "numbers that are none, counts that lie and short payloads are no values" do
    for bad <- [
          <<1::32, 1::32>>,
          <<0xFFFFFFFF::32, 0xFFFFFFFF::32>>,
          <<1::32, 2::32, 0::32>>,
          <<1::32, 1::32, 0x7F800000::32>>
        ],
        do: assert(Xdr.decode({:list, :float}, bad) == :error)

    assert Xdr.decode(:bytes, <<5::32, 5::32, "abcde">>) == :error
  end

  defp new, do: Session.new(:mag1, @body, {127, 0, 0, 1}, 6665)

  # Messages that a client could have sent, with some bytes changed, cut or added, in pieces of any length.
  defp fuzz(count, seed) do
    rand = :rand.seed_s(:exsss, {seed, 56, 1})
    session = new()

    start = {session, %{most: 0, closed: 0, answered: 0, effects: MapSet.new()}, rand}

    {_session, seen, _rand} =
      Enum.reduce(1..count, start, fn nth, {session, seen, rand} ->
        {bytes, rand} = junk(rand)

        case Session.hear(session, bytes, 0.0) do
          {:ok, session, effects} ->
            {answers, session} = Session.take(session)
            size = if rem(nth, 100) == 0, do: :erts_debug.flat_size(session), else: 0

            seen = %{
              seen
              | most: max(seen.most, size),
                answered: seen.answered + length(answers),
                effects: Enum.reduce(effects, seen.effects, &MapSet.put(&2, elem(&1, 0)))
            }

            # What is left of a broken one swallows those after it: two of these, and another client comes.
            session = if byte_size(session.rest) > 200, do: new(), else: session
            {session, seen, rand}

          :error ->
            {new(), %{seen | closed: seen.closed + 1}, rand}
        end
      end)

    # The rules of a queue, and what is left of one message: words of the heap.
    assert seen.most < 100_000
    assert seen.closed > 0
    assert seen.answered > count / 5
    assert Enum.sort(seen.effects) == [:ask, :drive, :drop, :order, :say, :scene]
  end

  defp junk(rand) do
    {interface, rand} =
      pick([1, 1, 1, 2, 4, 4, 5, 7, 8, 10, 12, 14, 22, 25, 31, 42, 62, 99], rand)

    {type, rand} = pick([1, 2, 2, 3, 3, 3, 4, 5, 6, 200], rand)
    {subtype, rand} = :rand.uniform_s(12, rand)
    {words, rand} = :rand.uniform_s(16, rand)

    {payload, rand} =
      Enum.map_reduce(1..words, rand, fn _nth, rand ->
        {word, rand} = pick([0, 1, 2, 4, 5, 0x3F800000, 0x7FF00000, 0xFFFFFFFF], rand)
        {<<word::32>>, rand}
      end)

    bytes = Client.message({interface, 0}, type, subtype, IO.iodata_to_binary(payload))
    {how, rand} = :rand.uniform_s(20, rand)
    {at, rand} = :rand.uniform_s(byte_size(bytes), rand)
    <<before::binary-size(at - 1), byte, rest::binary>> = bytes

    case how do
      1 -> {before, rand}
      2 -> {<<before::binary, Bitwise.bxor(byte, 0x55), rest::binary>>, rand}
      3 -> {rest, rand}
      whole when whole < 12 -> {bytes, rand}
      _good -> good(how, rand)
    end
  end

  # One as clients send it, now and then with a word of its payload changed.
  defp good(how, rand) do
    dev = fn access -> <<0::64, 5::32, 0::32, access::32, 0::64>> end

    {{device, type, subtype, payload}, rand} =
      pick(
        [
          {{1, 0}, 3, 3, dev.(1)},
          {{1, 0}, 3, 3, dev.(2)},
          {{1, 0}, 3, 10, <<-1::32, -1::32, 1::32, how::32, 1::32>>},
          {{4, 0}, 2, 1, <<0.2::float, 0::64, 0.1::float, 1::32>>},
          {{4, 0}, 3, 5, <<1.0::float, 2.0::float, 0.5::float>>},
          {{4, 0}, 3, 2, <<0::32>>},
          {{12, 0}, 2, 1, <<5::32, 5::32, "hello", 0::24>>},
          {{31, 0}, 3, 1, <<4::32, 4::32, "mag1", -1::192>>},
          {{42, 0}, 3, 2, <<0::64, 9::32, 9::32, 0::96>>}
        ],
        rand
      )

    {at, rand} = :rand.uniform_s(div(byte_size(payload), 4), rand)
    size = 4 * (at - 1)
    <<before::binary-size(size), word::32, rest::binary>> = payload
    word = if how == 20, do: Bitwise.bxor(word, 0x40FF0001), else: word
    {Client.message(device, type, subtype, <<before::binary, word::32, rest::binary>>), rand}
  end

  defp pick(list, rand) do
    {nth, rand} = :rand.uniform_s(length(list), rand)
    {Enum.at(list, nth - 1), rand}
  end

  test "20,000 malformed messages: no crash, no growth", do: fuzz(20_000, 1)

  @tag :long
  test "10^6 malformed messages: no crash, no growth", do: fuzz(1_000_000, 2)
end
