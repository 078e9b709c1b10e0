defmodule Mcap.ReaderTest do
  use ExUnit.Case, async: true
  alias Mcap.{Reader, Samples}
  doctest Mcap.Record.Parse

  @moduletag :tmp_dir

  defp sample(dir, count, options \\ []) do
    {messages, _} = Samples.messages(count, :rand.seed_s(:exsss, 7))
    {file, pieces} = Samples.file(messages, options)
    path = Path.join(dir, "run.mcap")
    File.write!(path, file)
    {path, messages, pieces}
  end

  test "what was written is read", %{tmp_dir: dir} do
    {path, messages, pieces} = sample(dir, 100, library: "tests")
    assert Samples.read(path) == messages

    {:ok, t} = Reader.open(path)
    summary = Reader.summary(t)
    assert %{whole?: true, cut_at: nil, count: 100, chunks: 20, library: "tests"} = summary
    assert summary.metadata == [{"made by", %{"a" => "1", "b" => "2"}}]
    assert summary.bytes == IO.iodata_length(pieces)
    {_topic, first, _data} = hd(messages)
    {_topic, last, _data} = List.last(messages)
    assert {summary.start_ns, summary.end_ns} == {first, last}

    for channel <- summary.channels do
      assert summary.counts[channel.id] == Enum.count(messages, &(elem(&1, 0) == channel.topic))
      assert channel.metadata == %{"topic" => channel.topic}
      assert channel.message_encoding == "json"
      assert is_nil(channel.schema) == (channel.topic == "/plain")
    end

    middle = div(first + last, 2)

    assert Samples.read(path, topics: ["/a", "/none"]) ==
             Enum.filter(messages, &(elem(&1, 0) == "/a"))

    assert Samples.read(path, from_ns: middle) == Enum.filter(messages, &(elem(&1, 1) >= middle))
    assert Samples.read(path, to_ns: last) == Enum.filter(messages, &(elem(&1, 1) < last))
  end

  @tag :slow
  test "cut at every byte, all whole chunks are read", %{tmp_dir: dir} do
    {path, messages, pieces} = sample(dir, 12)
    file = IO.iodata_to_binary(pieces)
    [head, note | chunks] = Enum.drop(pieces, -1)

    # Without the indexes of its messages a chunk is whole.
    {ends, _} =
      Enum.map_reduce(chunks, byte_size(note) + byte_size(head), fn piece, offset ->
        <<0x06, n::little-64, _::binary>> = piece
        {offset + 9 + n, offset + byte_size(piece)}
      end)

    for cut <- 0..(byte_size(file) - 1) do
      File.write!(path, binary_part(file, 0, cut))
      whole = Enum.count(ends, &(&1 <= cut))

      case Reader.open(path) do
        {:ok, t} ->
          assert for({topic, _, ns, data} <- Reader.messages(t), do: {topic, ns, data}) ==
                   Enum.take(messages, 5 * whole)

          refute Reader.summary(t).whole?

        {:error, line} ->
          assert whole == 0 and line =~ path
          assert cut < byte_size(hd(pieces))
      end
    end
  end
end
