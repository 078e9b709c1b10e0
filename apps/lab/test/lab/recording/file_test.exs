defmodule Lab.Recording.FileTest do
  use Lab.LockstepCase, async: true
  import Swarm.Case, only: [eventually: 1]
  alias Lab.{Recorder, Recording, Replay, Trial}
  @moduletag :tmp_dir

  # A file system of its own, where this may be done.
  @probe Path.join(System.tmp_dir!(), "sim-#{System.pid()}")
  File.mkdir_p!(@probe)
  @probed "mount -t tmpfs -o size=1m none \"$1\" && umount \"$1\""
  {_said, status} = System.cmd("sh", ["-c", @probed, "sh", @probe], stderr_to_stdout: true)
  File.rmdir!(@probe)
  @mounts status == 0

  defp write(path, ticks) do
    # What has words of its own for people is a term here.
    script = [{0.5, {:tell, :mag1, {:formation, :wedge, 1.0}}}]
    options = %{robots: [:mag1, :mag2], seed: 5, blobs: :direct, script: script}
    {:ok, setup} = Trial.setup(options)
    {:ok, recorder} = Recorder.start_link(path, setup)

    trial =
      Enum.reduce(1..ticks, Trial.begin(setup, record: true), fn _tick, trial ->
        {entries, trial} = trial |> Trial.step() |> Trial.take_entries()
        :ok = Recorder.tick(recorder, {trial.at_ms, entries}, Trial.scene(trial))
        trial
      end)

    {Recorder.close(recorder), setup, trial}
  end

  test "a run from a file replays, and one seed gives one file", %{tmp_dir: folder} do
    [one, other] = for name <- ["one", "other"], do: Path.join(folder, name <> ".mcap")
    assert {:ok, setup, trial} = write(one, 60)
    assert {:ok, _setup, _trial} = write(other, 60)
    assert File.read!(one) == File.read!(other)

    {:ok, reader} = Mcap.Reader.open(one)
    log = for {"/log", _, _, bytes} <- Mcap.Reader.messages(reader, topics: ["/log"]), do: bytes
    assert Enum.any?(log, &(&1 =~ "told command {:formation, :wedge, 1.0}"))
    assert {:ok, file} = Recording.File.open(one)
    assert {file.whole?, file.setup, Recording.File.last_ms(file)} == {true, setup, 6_000}

    replay =
      Enum.reduce(Recording.File.ticks(file), Replay.new(file.setup), fn tick, replay ->
        assert {replay, []} = Replay.step(replay, tick)
        replay
      end)

    assert Replay.trial(replay).world == trial.world
    assert [{2_100, _entries} | _] = Enum.to_list(Recording.File.ticks(file, from_ms: 2_100))
  end

  unless @mounts, do: @tag(skip: "no file system can be mounted here")

  test "on a full disk the file ends whole, with what found room", %{tmp_dir: folder} do
    {_said, 0} = System.cmd("mount", ["-t", "tmpfs", "-o", "size=400k", "none", folder])
    on_exit(fn -> {_said, 0} = System.cmd("umount", ["-l", folder]) end)
    path = Path.join(folder, "run.mcap")
    {closed, setup, _trial} = write(path, 400)
    assert closed == {:error, "#{path} cannot be written: no space left on device"}

    assert {:ok, %{whole?: true, setup: ^setup} = file} = Recording.File.open(path)
    ticks = for {at_ms, _entries} <- Recording.File.ticks(file), do: at_ms
    assert length(ticks) in 10..399
    assert ticks == for(n <- 1..length(ticks), do: 100 * n)

    # Every byte belongs to a whole record.
    assert Recording.File.last_ms(file) == List.last(ticks)
    assert String.ends_with?(File.read!(path), Mcap.magic())
  end

  # A pipe that nothing empties is such a disk.
  test "a disk that hangs is told after a second, with the file, and the recording is whole", %{
    tmp_dir: folder
  } do
    [pipe, path] = for name <- ~w(pipe.mcap run.mcap), do: Path.join(folder, name)
    {_said, 0} = System.cmd("mkfifo", [pipe])
    # The first opening makes the file, the second writes it.
    script = ~S(exec 3<"$1"; read go; cat <&3 >"$2")
    sh = [:binary, :exit_status, args: ["-c", script, "sh", pipe, path]]
    reader = Port.open({:spawn_executable, "/bin/sh"}, sh)

    ExUnit.CaptureIO.capture_io(:stderr, fn ->
      writer = Task.async(fn -> write(pipe, 60) end)
      said = fn -> :standard_error |> Process.whereis() |> StringIO.contents() |> elem(1) end
      eventually(fn -> said.() =~ "#{pipe}: its disk does not answer; the run waits for it" end)
      assert Task.yield(writer, 0) == nil
      Port.command(reader, "go\n")
      assert {:ok, _setup, _trial} = Task.await(writer, 30_000)
    end)

    assert_receive {^reader, {:exit_status, 0}}, 10_000
    assert {:ok, %{whole?: true} = file} = Recording.File.open(path)
    assert Recording.File.last_ms(file) == 6_000
  end

  test "a file that was cut is read as far as it is whole", %{tmp_dir: folder} do
    path = Path.join(folder, "run.mcap")
    {:ok, _setup, _trial} = write(path, 50)
    bytes = File.read!(path)
    {:ok, file} = Recording.File.open(path)
    all = Enum.to_list(Recording.File.ticks(file))

    cut = Path.join(folder, "cut.mcap")
    File.write!(cut, binary_part(bytes, 0, 1_000))
    assert {:error, _line} = Recording.File.open(cut)

    # After the start and the floor plan.
    for share <- [0.6, 0.7, 0.8, 0.9] do
      File.write!(cut, binary_part(bytes, 0, round(share * byte_size(bytes))))
      assert {:ok, %{whole?: false} = file} = Recording.File.open(cut)
      ticks = Enum.to_list(Recording.File.ticks(file))
      assert ticks == Enum.take(all, length(ticks))
      assert length(ticks) in 1..49
    end
  end

  test "what is not a recording of a run is refused in one line", %{tmp_dir: folder} do
    path = Path.join(folder, "other.mcap")

    for bytes <- ["", "no recording", :binary.copy(<<0>>, 10_000)] do
      File.write!(path, bytes)
      assert {:error, line} = Recording.File.open(path)
      assert line =~ path and not (line =~ "\n")
    end

    {writer, head} = Mcap.Writer.new()
    {id, writer} = Mcap.Writer.channel(writer, "/other", "json", nil)
    {writer, bytes} = Mcap.Writer.message(writer, id, 0, "{}")
    File.write!(path, [head, bytes, Mcap.Writer.finish(writer)])
    assert {:error, line} = Recording.File.open(path)
    assert line == "#{path} is not a recording of a run: it has no topic /convoy/start"

    assert {:error, line} = Recording.File.open(Path.join(folder, "none.mcap"))
    assert line =~ "none.mcap"
  end

  test "a place that cannot be written is an error, before or at the end", %{tmp_dir: folder} do
    {:ok, setup} = Trial.setup(%{robots: [:mag1], seed: 5, blobs: :direct})
    missing = Path.join([folder, "none", "run.mcap"])
    line = "#{missing} cannot be written: no such file or directory"
    assert Recorder.start_link(missing, setup) == {:error, line}

    assert {{:error, line}, _setup, _trial} = write("/dev/full", 30)
    assert line == "/dev/full cannot be written: no space left on device"
  end
end
