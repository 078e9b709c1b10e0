defmodule Hal.Visca.DecoderTest do
  use ExUnit.Case, async: true
  alias Hal.Visca.{Decoder, Reply}
  doctest Hal.Visca.Decoder
  doctest Hal.Visca.Reply

  defp hex(text), do: text |> String.replace(" ", "") |> Base.decode16!(case: :lower)

  # Every answer of the fact sheet, sections 3, 4 and 7.
  @examples [
    {"88 30 02 ff", {:cameras, 1}},
    {"88 01 00 01 ff", :cleared},
    {"90 50 ff", {:result, ""}},
    {"90 50 00 20 04 02 01 00 02 ff", {:result, <<0, 0x20, 4, 2, 1, 0, 2>>}},
    {"90 50 02 ff", {:result, <<2>>}},
    {"90 50 00 00 00 00 00 00 00 00 ff", {:result, <<0::64>>}},
    {"90 50 00 00 00 00 ff", {:result, <<0::32>>}},
    {"90 41 ff", {:ack, 1}},
    {"90 42 ff", {:ack, 2}},
    {"90 51 ff", {:done, 1}},
    {"90 52 ff", {:done, 2}},
    {"90 60 01 ff", {:error, 0, :length}},
    {"90 60 02 ff", {:error, 0, :syntax}},
    {"90 60 03 ff", {:error, 0, :full}},
    {"90 61 04 ff", {:error, 1, :cancelled}},
    {"90 61 05 ff", {:error, 1, :no_socket}},
    {"90 62 41 ff", {:error, 2, :not_executable}},
    {"90 60 77 ff", {:error, 0, {:code, 0x77}}},
    {"90 38 ff", :network_change}
  ]

  test "the answers of the fact sheet" do
    for {bytes, reply} <- @examples do
      assert {[^reply], decoder} = Decoder.feed(Decoder.new(1), hex(bytes))
      assert decoder == Decoder.new(1)
    end
  end

  test "what the answers to inquiries mean" do
    assert Reply.value(:version, hex("00 20 04 02 01 00 02")) ==
             {:ok, %{vendor: 0x20, model: 0x402, rom: 0x100, sockets: 2}}

    assert Reply.value(:power, <<2>>) == {:ok, true}
    assert Reply.value(:power, <<3>>) == {:ok, false}
    assert Reply.value(:position, <<0::64>>) == {:ok, {0, 0}}
    assert Reply.value(:position, hex("0f 0c 09 00 00 01 02 0c")) == {:ok, {-880, 300}}
    assert Reply.value(:position, hex("00 03 07 00 0f 0e 0d 04")) == {:ok, {880, -300}}
    assert Reply.value(:zoom, hex("00 02 03 08")) == {:ok, 568}
    assert Reply.value(:max_speed, <<0x18, 0x14>>) == {:ok, {24, 20}}
    assert Reply.value(:status, <<0x12, 0x34>>) == {:ok, 0x1234}
    assert Reply.value(:screen, <<2>>) == {:ok, :on}
    assert Reply.value(:screen, <<3>>) == {:ok, :off}
    assert Reply.value(:video, <<1>>) == {:ok, :pal}
    assert Reply.value(:focus, <<3>>) == {:ok, :manual}

    for inquiry <- [:version, :power, :zoom, :position, :max_speed, :status, :focus],
        wrong <- [<<>>, <<9>>, <<1, 2, 3>>, <<0x10, 0::56>>],
        do: assert(Reply.value(inquiry, wrong) == :error)
  end

  test "any split of the stream gives the same replies" do
    stream = @examples |> Enum.map(&hex(elem(&1, 0))) |> IO.iodata_to_binary()
    whole = Decoder.feed(Decoder.new(1), stream)
    assert elem(whole, 0) == Enum.map(@examples, &elem(&1, 1))
    assert by_pieces(stream, fn -> 1 end) == whole
    for _ <- 1..500, do: assert(by_pieces(stream, fn -> :rand.uniform(9) end) == whole)
  end

  test "rubbish before a header, and a message that lost its end, cost no other message" do
    assert {[{:ack, 1}], %{garbage: 3}} = Decoder.feed(Decoder.new(1), hex("00 37 91 90 41 ff"))

    assert {[{:result, <<2>>}, {:done, 1}], %{garbage: 2}} =
             Decoder.feed(Decoder.new(1), hex("90 41 90 50 02 ff 90 51 ff"))

    long = :binary.copy(<<0x90>>, 1000)
    assert {[], decoder} = Decoder.feed(Decoder.new(1), long)
    assert byte_size(decoder.rest) == 15
    assert {[{:ack, 2}], _} = Decoder.feed(decoder, hex("ff 90 42 ff"))
  end

  test "other cameras of the chain are counted, and a camera hears its own number only" do
    stream = hex("90 41 ff a0 51 ff 88 30 03 ff f0 38 ff")
    assert {[{:ack, 1}, {:cameras, 2}], %{others: 2}} = Decoder.feed(Decoder.new(1), stream)
    assert {[{:done, 1}, {:cameras, 2}], %{others: 2}} = Decoder.feed(Decoder.new(2), stream)
    assert {[{:cameras, 2}], %{others: 3, garbage: 0}} = Decoder.feed(Decoder.new(3), stream)
  end

  test "with bytes lost, doubled and flipped, what follows is read again after the next 0xFF" do
    good = Enum.map(@examples, &hex(elem(&1, 0)))
    last = hex("ff 90 42 ff")

    for _ <- 1..3000 do
      stream = good |> Enum.take_random(6) |> IO.iodata_to_binary() |> spoil()
      {replies, decoder} = Decoder.feed(Decoder.new(1), stream <> last)
      assert List.last(replies) == {:ack, 2}
      assert decoder.rest == <<>>
    end
  end

  test "random buffers neither crash it nor fill it", do: random_buffers(20_000)

  @tag :long
  test "a million random buffers neither crash it nor fill it", do: random_buffers(1_000_000)

  defp random_buffers(count) do
    decoder =
      Enum.reduce(1..count, Decoder.new(1), fn _, decoder ->
        {replies, decoder} = Decoder.feed(decoder, noise())
        true = is_list(replies)
        true = byte_size(decoder.rest) <= 15
        decoder
      end)

    assert decoder.garbage > 0
    {_, decoder} = Decoder.feed(decoder, <<0xFF>>)
    assert {[{:ack, 1}], _} = Decoder.feed(decoder, <<0x90, 0x41, 0xFF>>)
  end

  test "each byte is in a reply, garbage, or kept" do
    for _ <- 1..2000 do
      stream = for _ <- 1..20, into: <<>>, do: noise()
      {replies, decoder} = Decoder.feed(Decoder.new(1), stream)
      # One reply is at least 3 bytes long, and at most 16.
      known = length(replies) + decoder.others
      left = byte_size(stream) - decoder.garbage - byte_size(decoder.rest)
      assert left >= 3 * known and left <= 16 * known
    end
  end

  # Bytes as they are likely on this line, so that a good part are nearly messages.
  defp noise do
    for _ <- 1..:rand.uniform(12)//1, into: <<>> do
      case :rand.uniform(4) do
        1 -> <<Enum.random([0x90, 0x88, 0xFF, 0x41, 0x50, 0x60])>>
        2 -> <<:rand.uniform(16) - 1>>
        _ -> <<:rand.uniform(256) - 1>>
      end
    end
  end

  defp spoil(stream) do
    for <<byte <- stream>>, into: <<>> do
      case :rand.uniform(30) do
        1 -> <<>>
        2 -> <<byte, byte>>
        3 -> <<Bitwise.bxor(byte, Bitwise.bsl(1, :rand.uniform(8) - 1))>>
        _ -> <<byte>>
      end
    end
  end

  defp by_pieces(stream, size) do
    {replies, decoder} = pieces(stream, size, {[], Decoder.new(1)})
    {replies, decoder}
  end

  defp pieces(<<>>, _size, result), do: result

  defp pieces(stream, size, {replies, decoder}) do
    n = min(size.(), byte_size(stream))
    {piece, rest} = :erlang.split_binary(stream, n)
    {more, decoder} = Decoder.feed(decoder, piece)
    pieces(rest, size, {replies ++ more, decoder})
  end
end
