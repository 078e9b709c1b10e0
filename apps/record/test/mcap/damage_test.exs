defmodule Mcap.DamageTest do
  @moduledoc "Files that are not as they were written, or never were whole: errors are lines, and nothing else happens."
  use ExUnit.Case, async: true
  alias Mcap.{DamagedError, Reader, Samples}

  @moduletag :tmp_dir

  defp write(dir, bytes) do
    path = Path.join(dir, "run.mcap")
    File.write!(path, bytes)
    path
  end

  defp flip(file, at, bits) do
    <<before::binary-size(at), byte, behind::binary>> = file
    <<before::binary, Bitwise.bxor(byte, bits), behind::binary>>
  end

  # All that can be had of a file, and the line of what is wrong.
  defp salvage(path) do
    case Reader.open(path) do
      {:ok, t} ->
        {take(t, :raise), take(t, :skip)}

      {:error, line} ->
        assert line =~ path and not (line =~ "\n")
        {{[], line}, {[], nil}}
    end
  end

  defp take(t, damaged) do
    {for({topic, _, ns, data} <- Reader.messages(t, damaged: damaged), do: {topic, ns, data}),
     nil}
  rescue
    error in DamagedError -> {[], error.message}
  end

  defp sample(state, count \\ 40) do
    {messages, _state} = Samples.messages(count, state)
    {file, pieces} = Samples.file(messages)
    {messages, file, pieces}
  end

  describe "random damage" do
    defp wound(file, state) do
      {kind, state} = :rand.uniform_s(4, state)
      {at, state} = :rand.uniform_s(byte_size(file), state)

      case kind do
        1 -> {binary_part(file, 0, at - 1), state}
        2 -> wound(binary_part(file, 0, at - 1), state, 2)
        n -> wound(file, state, n - 2)
      end
    end

    defp wound(file, state, 0), do: {file, state}
    defp wound("", state, _flips), do: {"", state}

    defp wound(file, state, flips) do
      {at, state} = :rand.uniform_s(byte_size(file), state)
      {bits, state} = :rand.uniform_s(255, state)
      wound(flip(file, at - 1, bits), state, flips - 1)
    end

    # What is returned was written, in order; whatever else may be lost.
    defp survive(dir, count, seed) do
      {messages, file, _pieces} = sample(:rand.seed_s(:exsss, seed))
      known = MapSet.new(messages)

      Enum.reduce(1..count, {:rand.seed_s(:exsss, seed), 0}, fn _n, {state, had} ->
        {file, state} = wound(file, state)
        {{all, _line}, {some, nil}} = salvage(write(dir, file))

        for found <- [all, some] do
          assert Enum.all?(found, &(&1 in known))
          assert found == Enum.sort_by(found, fn {_topic, ns, _data} -> ns end)
        end

        {state, had + length(some)}
      end)
    end

    test "never crashes, and never shows what was not written", %{tmp_dir: dir} do
      {_state, had} = survive(dir, 200, 11)
      assert had > 200 * 10
    end

    @tag :long
    test "never crashes, very often", %{tmp_dir: dir} do
      for seed <- 1..10, do: survive(dir, 1000, seed)
    end
  end

  test "each checksum is looked at", %{tmp_dir: dir} do
    {messages, file, [head, note, first, second | _]} = sample(:rand.seed_s(:exsss, 2), 15)
    third = byte_size(head) + byte_size(note) + byte_size(first) + byte_size(second)
    <<0x06, bytes::little-64, _::binary>> = binary_part(file, third, 9)

    # Data of the third chunk: those before it come, then the line; or those of the others.
    path = write(dir, flip(file, third + 9 + bytes - 1, 1))
    {:ok, t} = Reader.open(path)
    test = self()

    assert_raise DamagedError, "#{path} is damaged at byte #{third}: its checksum is wrong", fn ->
      for {topic, _, ns, data} <- Reader.messages(t), do: send(test, {topic, ns, data})
    end

    for message <- Enum.take(messages, 9), do: assert_received(^message)
    assert Samples.read(path, damaged: :skip) == Enum.take(messages, 10)
    assert Samples.read(path, to_ns: messages |> Enum.at(8) |> elem(1)) != []

    # The summary's: it is not believed, but scanned for.
    path = write(dir, flip(file, byte_size(file) - 9, 1))
    {:ok, t} = Reader.open(path)
    assert %{whole?: true, cut_at: nil, count: 15, chunks: 3} = Reader.summary(t)
    assert Samples.read(path) == messages

    # In the middle of a file without an end it is damage, at its very end part of the cut.
    cut = binary_part(file, 0, third + 9 + bytes)
    path = write(dir, flip(cut, third - byte_size(second) + 100, 1))
    assert {{[], line}, {rest, nil}} = salvage(path)
    assert line =~ "checksum"
    assert rest == Enum.take(messages, 5) ++ Enum.drop(messages, 10)
    path = write(dir, flip(cut, byte_size(cut) - 1, 1))
    assert Samples.read(path) == Enum.take(messages, 10)
    {:ok, t} = Reader.open(path)
    assert %{whole?: false, cut_at: ^third, chunks: 2} = Reader.summary(t)
  end

  test "what is no recording is one line", %{tmp_dir: dir} do
    path = Path.join(dir, "run.mcap")
    assert Reader.open(path) == {:error, "#{path} cannot be read: no such file or directory"}
    assert Reader.open(dir) == {:error, "#{dir} cannot be read: it is a directory, not a file"}
    write(dir, "")

    assert Reader.open(path) ==
             {:error, "#{path} has no messages: it ends within its first 8 bytes"}

    for text <- ["x", "a text", String.duplicate("text ", 100), <<0x89, "MCAP1\r\n">>] do
      write(dir, text)

      assert Reader.open(path) ==
               {:error, "#{path} is not an MCAP file of version 0: it does not begin like one"}
    end
  end

  test "lengths are not believed", %{tmp_dir: dir} do
    head = IO.iodata_to_binary([Mcap.magic(), Mcap.Record.header("", "x")])
    huge = for n <- [0x7FFF_FFFF_FFFF_FFFF, 0x8000_0000_0000_0000, 0xFFFF_FFFF_FFFF_FFFF], do: n

    for n <- huge, opcode <- [0x03, 0x05, 0x06, 0x0C, 0x80] do
      write(dir, [head, <<opcode, n::little-64>>, String.duplicate("x", 100)])
      assert {:ok, t} = Reader.open(Path.join(dir, "run.mcap"))
      assert %{count: 0, cut_at: cut} = Reader.summary(t)
      assert cut == byte_size(head)
    end

    write(dir, [Mcap.magic(), <<0x01, hd(huge)::little-64>>])
    assert {:error, line} = Reader.open(Path.join(dir, "run.mcap"))
    assert line =~ "its header is cut or damaged"

    # Within a chunk, where the framing fits.
    for n <- huge do
      chunk = [<<0::little-64, 0::little-64, n::little-64, 0::little-96>>, <<n::little-64>>, "x"]
      write(dir, [head, Mcap.Record.frame(0x06, chunk), Mcap.Record.metadata("a", %{})])
      assert {{[], line}, {[], nil}} = salvage(Path.join(dir, "run.mcap"))
      assert line == nil or line =~ "its lengths do not fit"
    end
  end

  test "an index that has become a message is none", %{tmp_dir: dir} do
    {messages, file, [head, note, first | _]} = sample(:rand.seed_s(:exsss, 2), 15)
    <<0x06, n::little-64, _::binary>> = first
    at = byte_size(head) + byte_size(note) + 9 + n
    assert binary_part(file, at, 1) == <<0x07>>
    cut = binary_part(file, 0, byte_size(file) - 1)
    assert Samples.read(write(dir, flip(cut, at, 0x07 - 0x05))) == messages
  end

  test "a compression that we do not have is named", %{tmp_dir: dir} do
    head = [Mcap.magic(), Mcap.Record.header("", "x")]

    for name <- ["zstd", "lz4"] do
      content = [
        <<0::little-128, 9::little-64, 0::little-32>>,
        Mcap.Record.text(name),
        <<3::little-64>>,
        "xyz"
      ]

      path = write(dir, [head, Mcap.Record.frame(0x06, content)])
      line = "#{path} is compressed with #{name}: only files without compression can be read"
      assert Reader.open(path) == {:error, line}
    end
  end

  describe "files of other writers" do
    # Not in chunks, not in order, with records that we do not know.
    test "may have no chunks", %{tmp_dir: dir} do
      channel = %Mcap.Channel{
        id: 3,
        topic: "/n",
        message_encoding: "text",
        schema: nil,
        metadata: %{}
      }

      message = fn n, ns -> [Mcap.Record.message_head(3, n, ns, 2), <<n::16>>] end

      file = [
        [Mcap.magic(), Mcap.Record.header("ros2", "x"), Mcap.Record.frame(0x91, "private")],
        [Mcap.Record.channel(channel, 0), for(n <- 1..300, do: message.(n, 1000 - n))],
        [Mcap.Record.metadata("a", %{}), message.(301, 5000), Mcap.Record.data_end(0)],
        [Mcap.Record.frame(0x02, <<0::160>>), Mcap.magic()]
      ]

      path = write(dir, file)
      {:ok, t} = Reader.open(path)

      assert %{count: 301, start_ns: 700, end_ns: 5000, whole?: true, cut_at: nil} =
               Reader.summary(t)

      assert Reader.summary(t).counts == %{3 => 301}
      numbers = for {"/n", _channel, _ns, <<n::16>>} <- Reader.messages(t), do: n
      assert numbers == Enum.to_list(300..1//-1) ++ [301]
    end

    test "may have chunks that overlap, and equal times in all of them", %{tmp_dir: dir} do
      {messages, _state} =
        Enum.map_reduce(1..200, :rand.seed_s(:exsss, 9), fn n, state ->
          {ns, state} = :rand.uniform_s(20, state)
          {{"/a", ns, "#{n}"}, state}
        end)

      {file, _pieces} = Samples.file(messages, each: 7)
      path = write(dir, file)
      assert Samples.read(path) == Enum.sort_by(messages, fn {_topic, ns, _data} -> ns end)
      cut = write(dir, binary_part(file, 0, byte_size(file) - 1))
      assert Samples.read(cut) == Enum.sort_by(messages, fn {_topic, ns, _data} -> ns end)
    end
  end
end
