defmodule Mcap.WriterTest do
  use ExUnit.Case, async: true
  alias Mcap.Writer
  doctest Mcap.Record
  doctest Mcap.Writer

  # The whole file, of 592 bytes, checked with other readers; by offset.
  @t1 "00ca9a3b00000000"
  @t2 "0094357700000000"
  @schema "033a00000000000000010001000000580a0000006a736f6e736368656d61210000007b2274797065223a226f626a656374222c2270726f70657274696573223a7b7d7d"
  @channel "04160000000000000001000100020000002f70040000006a736f6e00000000"
  @example Enum.join([
             "894d434150300d0a",
             "010900000000000000000000000100000078",
             "06d600000000000000#{@t1}#{@t2}ae00000000000000269ea52100000000ae00000000000000",
             @schema,
             @channel,
             "051d00000000000000010000000000#{@t1}#{@t1}7b2278223a317d",
             "051d00000000000000010001000000#{@t2}#{@t2}7b2278223a327d",
             "072600000000000000010020000000#{@t1}6200000000000000#{@t2}8800000000000000",
             "0f0400000000000000e2061c71",
             @schema,
             @channel,
             "0b38000000000000000200000000000000010001000000000000000000000001000000#{@t1}#{@t2}0a00000001000200000000000000",
             "084a00000000000000#{@t1}#{@t2}1a00000000000000df000000000000000a0000000100f9000000000000002f0000000000000000000000ae00000000000000ae00000000000000",
             "021400000000000000350100000000000000000000000000005e62ecbc",
             "894d434150300d0a"
           ])

  test "the example byte for byte" do
    {t, head} = Writer.new(library: "x", summary_offsets: false)
    schema = {"X", "jsonschema", ~s({"type":"object","properties":{}})}
    {id, t} = Writer.channel(t, "/p", "json", schema, %{})
    {t, []} = Writer.message(t, id, 1_000_000_000, ~s({"x":1}))
    {t, []} = Writer.message(t, id, 2_000_000_000, ~s({"x":2}))
    file = IO.iodata_to_binary([head, Writer.finish(t)])
    assert byte_size(file) == 592
    assert Base.encode16(file, case: :lower) == @example
    assert :erlang.crc32(file) == 0x17CE4BCA
  end

  @ms 1_000_000

  defp record(t, id, count) do
    Enum.reduce(1..count, {t, []}, fn n, {t, out} ->
      {t, more} = Writer.message(t, id, n * @ms, :binary.copy("x", 100))
      {t, [out | more]}
    end)
  end

  test "a chunk closes when it is full, and when a message is late" do
    {t, _head} = Writer.new(chunk_bytes: 500, chunk_ns: 10 * @ms)
    {id, t} = Writer.channel(t, "/a", "text", nil)
    {t, out} = record(t, id, 3)
    assert IO.iodata_length(out) == 0 and t.chunk.bytes in 393..499
    {full, _out} = record(t, id, 1)
    assert full.chunk.bytes == 0

    {in_time, []} = Writer.message(t, id, 11 * @ms - 1, "")
    assert in_time.chunk.bytes == t.chunk.bytes + 31
    {late, closed} = Writer.message(t, id, 11 * @ms, "")
    assert <<0x06, _::binary>> = IO.iodata_to_binary(closed)
    # The channel's record once more, and the message.
    assert late.chunk.bytes < 31 + 50
  end

  test "the same messages give the same bytes, and finish_bytes is enough" do
    file = fn ->
      {t, head} = Writer.new(chunk_bytes: 1000)

      {id, t} =
        Writer.channel(t, "/a", "json", Mcap.Foxglove.schema("foxglove.Log"), %{"a" => "b"})

      {t, note} = Writer.metadata(t, "note", Map.new(1..50, &{"#{&1}", "x"}))
      {t, out} = record(t, id, 100)
      {t, last} = Writer.flush(t)
      rest = Writer.finish(t)
      bytes = IO.iodata_length(rest)
      assert bytes <= Writer.finish_bytes(t) and Writer.finish_bytes(t) - bytes < 100
      assert Writer.bytes(t) == IO.iodata_length([head, note, out, last])
      IO.iodata_to_binary([head, note, out, last, rest])
    end

    assert file.() == file.()
  end

  test "one more file has the same ids; what is dropped is nowhere" do
    {t, head} = Writer.new()
    {_a, t} = Writer.channel(t, "/a", "text", nil)
    {b, t} = Writer.channel(t, "/b", "text", nil)
    {t, _open} = record(t, b, 3)
    {t, ^head} = Writer.next(t)
    {^b, t} = Writer.channel(t, "/b", "text", nil)
    {t, []} = Writer.message(t, b, 1, "once")
    empty = IO.iodata_to_binary([head | Writer.finish(Writer.drop(t))])
    # No schema, no channel, no chunk; its summary has statistics alone.
    assert byte_size(empty) == 8 + 23 + 13 + 55 + 26 + 29 + 8

    assert :binary.matches(IO.iodata_to_binary([head | Writer.finish(t)]), "once") |> length() ==
             1
  end

  test "what does not fit is one line" do
    {t, _head} = Writer.new()
    assert_raise ArgumentError, "no channel 1", fn -> Writer.message(t, 1, 0, "") end

    assert_raise ArgumentError, ~r/^not UTF-8 text/, fn ->
      Writer.channel(t, <<0xFF>>, "", nil)
    end

    assert_raise ArgumentError, ~r/^not UTF-8 text/, fn ->
      Writer.metadata(t, "a", %{"b" => 1})
    end

    assert_raise ArgumentError, ~r/^no schema/, fn -> Writer.channel(t, "/a", "", {"name"}) end

    assert_raise ArgumentError,
                 ~r/^recording option chunk_byte is not known.*chunk_bytes\?$/,
                 fn ->
                   Writer.new(chunk_byte: 5)
                 end
  end

  @tag :slow
  test "ids are of two bytes" do
    {t, _head} = Writer.new()
    t = Enum.reduce(1..0xFFFF, t, fn n, t -> t |> Writer.channel("/#{n}", "", nil) |> elem(1) end)

    assert_raise ArgumentError, "a file has room for 65535 channels", fn ->
      Writer.channel(t, "/a", "", nil)
    end
  end
end
