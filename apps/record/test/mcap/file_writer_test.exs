defmodule Mcap.FileWriterTest do
  use ExUnit.Case, async: true
  alias Mcap.{FileWriter, Reader, Samples}
  doctest Mcap.FileWriter.Folder

  @moduletag :tmp_dir

  # A file system of 1 MiB, where this may be done.
  @full "mount -t tmpfs -o size=1m none \"$1\" && umount \"$1\""
  @probe Path.join(System.tmp_dir!(), "mcap-#{System.pid()}")
  File.mkdir_p!(@probe)
  {_said, status} = System.cmd("sh", ["-c", @full, "sh", @probe], stderr_to_stdout: true)
  File.rmdir!(@probe)
  @mounts status == 0

  defp record(recorder, id, numbers, bytes \\ 300) do
    for n <- numbers do
      text = "#{n}"
      data = [text, :binary.copy(" ", max(bytes - byte_size(text), 0))]
      :ok = FileWriter.message(recorder, id, 1_000_000_000 + n * 1_000_000, data)
    end
  end

  defp numbers(path) do
    {:ok, t} = Reader.open(path)

    for {_topic, _channel, _ns, data} <- Reader.messages(t),
        do: data |> String.trim() |> String.to_integer()
  end

  test "a file has what was sent, and its notes", %{tmp_dir: dir} do
    path = Path.join(dir, "run.mcap")
    {:ok, recorder} = FileWriter.start_link(path: path, library: "tests")
    {:ok, id} = FileWriter.channel(recorder, "/n", "text", nil, %{"unit" => "1"})
    assert {:ok, ^id} = FileWriter.channel(recorder, "/n", "text", nil, %{"unit" => "1"})
    assert :ok = FileWriter.metadata(recorder, "run", %{"robot" => "mag1"})
    record(recorder, id, 1..5000)
    assert :ok = FileWriter.sync(recorder)
    assert :ok = FileWriter.close(recorder)

    assert numbers(path) == Enum.to_list(1..5000)
    {:ok, t} = Reader.open(path)
    # Five seconds of log time.
    assert %{whole?: true, chunks: 5, metadata: [{"run", %{"robot" => "mag1"}}]} =
             Reader.summary(t)

    assert {:error, "the recorder has ended"} = FileWriter.sync(recorder)
    assert :ok = FileWriter.message(recorder, id, 1, "too late")
  end

  test "what was flushed, and what is a second old, is in the file", %{tmp_dir: dir} do
    path = Path.join(dir, "run.mcap")
    {:ok, recorder} = FileWriter.start_link(path: path)
    {:ok, id} = FileWriter.channel(recorder, "/n", "text", nil)
    record(recorder, id, 1..10)
    assert :ok = FileWriter.sync(recorder)
    assert numbers(path) == []
    assert :ok = FileWriter.flush(recorder)
    assert numbers(path) == Enum.to_list(1..10)
    record(recorder, id, [20, 1019])
    assert :ok = FileWriter.sync(recorder)
    assert numbers(path) == Enum.to_list(1..10)
    record(recorder, id, [1020])
    assert :ok = FileWriter.sync(recorder)
    assert numbers(path) == Enum.to_list(1..10) ++ [20, 1019]
    # What its timer says a second after a message.
    assert is_reference(:sys.get_state(recorder).timer)
    send(recorder, :flush)
    assert :ok = FileWriter.sync(recorder)
    assert numbers(path) == Enum.to_list(1..10) ++ [20, 1019, 1020]
    assert :ok = FileWriter.close(recorder)
  end

  @tag :capture_log
  test "the file is ended when whoever started it ends", %{tmp_dir: dir} do
    path = Path.join(dir, "run.mcap")
    test = self()

    {owner, monitor} =
      spawn_monitor(fn ->
        {:ok, recorder} = FileWriter.start_link(path: path)
        {:ok, id} = FileWriter.channel(recorder, "/n", "text", nil)
        record(recorder, id, 1..3)
        send(test, {:recorder, recorder})
        receive do: (:end -> exit(:kaput))
      end)

    assert_receive {:recorder, recorder}
    ended = Process.monitor(recorder)
    send(owner, :end)
    assert_receive {:DOWN, ^monitor, _, _, :kaput}
    assert_receive {:DOWN, ^ended, _, _, _}
    assert numbers(path) == [1, 2, 3]
    {:ok, t} = Reader.open(path)
    assert Reader.summary(t).whole?
  end

  test "errors are lines, and end nobody", %{tmp_dir: dir} do
    missing = Path.join([dir, "none", "run.mcap"])
    {:ok, recorder} = FileWriter.start_link(path: missing)
    line = "#{missing} cannot be written: no such file or directory"
    assert {:error, ^line} = FileWriter.channel(recorder, "/n", "text", nil)
    assert {:error, ^line} = FileWriter.metadata(recorder, "a", %{})
    assert :ok = FileWriter.message(recorder, 1, 1, "lost")
    assert {:error, ^line} = FileWriter.sync(recorder)
    assert {:error, ^line} = FileWriter.flush(recorder)
    assert {:error, ^line} = FileWriter.close(recorder)

    there = Path.join(dir, "there.mcap")
    File.write!(there, "of somebody")
    {:ok, recorder} = FileWriter.start_link(path: there)
    assert {:error, line} = FileWriter.close(recorder)
    assert line == "#{there} cannot be written: there is such a file already"
    assert File.read!(there) == "of somebody"

    {:ok, recorder} = FileWriter.start_link(path: Path.join(dir, "run.mcap"))

    assert {:error, "not UTF-8 text: <<255>>"} =
             FileWriter.channel(recorder, <<255>>, "text", nil)

    {:ok, id} = FileWriter.channel(recorder, "/n", "text", nil)
    :ok = FileWriter.message(recorder, 9, 1, "lost")
    record(recorder, id, [1])
    assert {:error, line} = FileWriter.sync(recorder)
    assert line == "#{dir}/run.mcap has no channel 9"
    # The rest is kept.
    assert {:error, ^line} = FileWriter.close(recorder)
    assert numbers(Path.join(dir, "run.mcap")) == [1]

    assert_raise ArgumentError,
                 ~r/^recording option limit_byte is not known.*did you mean limit_bytes/,
                 fn ->
                   FileWriter.start_link(path: dir, limit_byte: 5)
                 end
  end

  describe "with a limit" do
    @limit 0x40_0000

    defp folder(dir) do
      for name <- Enum.sort(File.ls!(dir)), do: {name, File.stat!(Path.join(dir, name)).size}
    end

    defp bytes(dir), do: dir |> folder() |> Enum.map(&elem(&1, 1)) |> Enum.sum()

    # The recorder also writes by itself, a second later: a file that it deletes while this looks would count, and so
    # would the one that takes its place.
    defp bytes(dir, recorder) do
      :ok = :sys.suspend(recorder)
      bytes = bytes(dir)
      :ok = :sys.resume(recorder)
      bytes
    end

    @tag :realtime
    test "the oldest files are deleted, and the folder never exceeds it", %{tmp_dir: dir} do
      dir = Path.join(dir, "runs")
      options = [path: dir, limit_bytes: @limit]
      {:ok, recorder} = FileWriter.start_link(options)

      {:ok, id} =
        FileWriter.channel(recorder, "/n", "text", Mcap.Foxglove.schema("foxglove.Grid"))

      :ok = FileWriter.metadata(recorder, "run", %{"robot" => "mag1"})

      for from <- 1..30_000//500 do
        record(recorder, id, from..(from + 499))
        assert :ok = FileWriter.sync(recorder)
        assert bytes(dir, recorder) <= @limit
      end

      assert :ok = FileWriter.close(recorder)
      assert bytes(dir) in div(@limit, 2)..@limit

      files = for {name, _bytes} <- folder(dir), do: Path.join(dir, name)
      refute hd(files) =~ "0001"
      kept = Enum.flat_map(files, &numbers/1)
      assert kept == Enum.to_list(hd(kept)..30_000)

      for file <- files do
        {:ok, t} = Reader.open(file)
        assert %{whole?: true, metadata: [{"run", %{"robot" => "mag1"}}]} = Reader.summary(t)
        assert [%{id: ^id, topic: "/n"}] = Reader.summary(t).channels
      end

      # Once more: it goes on with the next number, and what lies there counts.
      File.write!(Path.join(dir, "notes"), "of somebody")
      last = List.last(files)
      {:ok, recorder} = FileWriter.start_link(options)
      {:ok, id} = FileWriter.channel(recorder, "/n", "text", nil)

      for from <- 1..4000//500 do
        record(recorder, id, from..(from + 499))
        assert :ok = FileWriter.sync(recorder)
        assert bytes(dir, recorder) <= @limit + 11
      end

      assert :ok = FileWriter.close(recorder)
      names = for {"run-" <> _ = name, _bytes} <- folder(dir), do: Path.join(dir, name)
      assert last in names
      assert Enum.flat_map(Enum.filter(names, &(&1 > last)), &numbers/1) == Enum.to_list(1..4000)
      assert File.read!(Path.join(dir, "notes")) == "of somebody"
    end

    @tag :realtime
    test "writers that begin at the same time have a file each", %{tmp_dir: dir} do
      for round <- 1..20 do
        folder = Path.join(dir, "#{round}")

        begun =
          1..4
          |> Enum.map(fn _ ->
            Task.async(fn ->
              {:ok, writer} =
                FileWriter.start_link(path: folder, library: "tests", limit_bytes: 4_194_304)

              FileWriter.close(writer)
            end)
          end)
          |> Task.await_many()

        assert Enum.all?(begun, &(&1 == :ok))
        assert length(File.ls!(folder)) == 4
      end
    end

    test "large messages of many channels, notes between", %{tmp_dir: dir} do
      {:ok, recorder} = FileWriter.start_link(path: dir, limit_bytes: @limit)

      _state =
        Enum.reduce(1..60, :rand.seed_s(:exsss, 5), fn n, state ->
          {bytes, state} = :rand.uniform_s(div(@limit, 4), state)
          {:ok, id} = FileWriter.channel(recorder, "/n#{rem(n, 20)}", "text", nil)
          record(recorder, id, [n], bytes)
          :ok = FileWriter.metadata(recorder, "n", %{"n" => String.duplicate("#{n}", 1000)})
          assert bytes(dir, recorder) <= @limit
          state
        end)

      assert :ok = FileWriter.close(recorder)
      assert bytes(dir) <= @limit
      kept = Enum.flat_map(folder(dir), fn {name, _bytes} -> numbers(Path.join(dir, name)) end)
      assert List.last(kept) == 60
    end

    test "a message that is too large is an error", %{tmp_dir: dir} do
      {:ok, recorder} = FileWriter.start_link(path: dir, limit_bytes: @limit)
      {:ok, id} = FileWriter.channel(recorder, "/n", "text", nil)
      record(recorder, id, [1])
      record(recorder, id, [2], div(@limit, 4) + 1)
      record(recorder, id, [3])
      assert {:error, line} = FileWriter.close(recorder)

      assert line =~
               "a message of 1048577 bytes on channel 1 is more than a quarter of limit_bytes"

      assert numbers(Path.join(dir, "run-0001.mcap")) == [1, 3]
    end
  end

  describe "on a full disk" do
    @describetag :slow
    unless @mounts, do: @describetag(skip: "no file system can be mounted here")

    setup %{tmp_dir: dir} do
      {_said, 0} = System.cmd("mount", ["-t", "tmpfs", "-o", "size=6m", "none", dir])
      on_exit(fn -> {_said, 0} = System.cmd("umount", ["-l", dir]) end)
    end

    test "the file ends whole with what found room", %{tmp_dir: dir} do
      path = Path.join(dir, "run.mcap")
      {:ok, recorder} = FileWriter.start_link(path: path, chunk_bytes: 300_000)
      {:ok, id} = FileWriter.channel(recorder, "/n", "text", nil)
      record(recorder, id, 1..30_000)
      assert {:error, line} = FileWriter.sync(recorder)
      assert line == "#{path} cannot be written: no space left on device"
      assert {:error, ^line} = FileWriter.close(recorder)
      kept = numbers(path)
      assert kept == Enum.to_list(1..length(kept))
      assert length(kept) > 10_000
      {:ok, t} = Reader.open(path)
      assert Reader.summary(t).whole?
    end

    test "of a folder the oldest files make room", %{tmp_dir: dir} do
      {:ok, recorder} = FileWriter.start_link(path: dir, limit_bytes: 20_000_000)
      {:ok, id} = FileWriter.channel(recorder, "/n", "text", nil)

      for from <- 1..60_000//1000 do
        record(recorder, id, from..(from + 999))
        assert :ok = FileWriter.sync(recorder)
      end

      assert :ok = FileWriter.close(recorder)
      kept = dir |> File.ls!() |> Enum.sort() |> Enum.flat_map(&numbers(Path.join(dir, &1)))
      assert kept == Enum.to_list(hd(kept)..60_000)
      assert length(kept) > 5000
    end
  end

  test "Samples: the pieces of a file are the file", %{tmp_dir: dir} do
    {messages, _} = Samples.messages(10, :rand.seed_s(:exsss, 1))
    {file, pieces} = Samples.file(messages)
    assert IO.iodata_to_binary(pieces) == file
    File.write!(Path.join(dir, "run.mcap"), file)
    assert Samples.read(Path.join(dir, "run.mcap")) == messages
  end
end
