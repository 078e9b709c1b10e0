defmodule Record.RecorderTest do
  @moduledoc "Robots of processes, recorded and replayed; and what a recorder that fails does to a robot."
  use Robot.Case, async: true
  import Record.Replayed, only: [replay: 1]
  alias Mcap.FileWriter.Folder
  alias Record.{Recorder, Recording, Replay}
  alias Record.Recorder.Queue
  @moduletag :realtime
  @moduletag :tmp_dir
  @moduletag :capture_log

  # A small file system, where this may be done.
  @probe Path.join(System.tmp_dir!(), "recorder-#{System.pid()}")
  File.mkdir_p!(@probe)
  @words ~w(-t tmpfs -o size=1m none #{@probe})
  {_said, status} = System.cmd("mount", @words, stderr_to_stdout: true)
  if status == 0, do: System.cmd("umount", [@probe])
  File.rmdir!(@probe)
  @mounts status == 0

  # One that can be frozen, so that every write to it waits.
  tools = Enum.all?(~w(mkfs.ext4 fsfreeze losetup), &System.find_executable/1)
  loop = tools and match?({_path, 0}, System.cmd("losetup", ["-f"], stderr_to_stdout: true))
  @freezes @mounts and loop

  defp image, do: Path.join(System.tmp_dir!(), "recorder-#{System.pid()}.img")

  defp mounted(folder) do
    File.write!(image(), :binary.copy(<<0>>, 4_000_000))
    {_said, 0} = System.cmd("mkfs.ext4", ["-q", "-F", image()], stderr_to_stdout: true)
    {_said, 0} = System.cmd("mount", ["-o", "loop", image(), folder], stderr_to_stdout: true)
    :ok
  end

  defp recorder(options) do
    id = make_ref()
    start_supervised!(%{id: id, start: {Recorder, :start_link, [options]}, restart: :temporary})
  end

  defp replayed(path) do
    {:ok, file} = Recording.File.open(path)
    {replay, differences} = replay(file)
    {file, Map.new(Replay.counts(replay)), differences}
  end

  # From now on.
  defp ticks(count) do
    forget()
    for _ <- 1..count, do: assert_receive({:mission, {:tick, _}})
  end

  defp forget do
    receive do
      {:mission, _event} -> forget()
    after
      0 -> :ok
    end
  end

  defp rolling_on(id, more \\ []) do
    roll = {:goal, :roll, {Acts.Roll, twist: Twist.new(0.3, 0.1)}}

    robot(
      id,
      [
        mission: {Acts.Mission, test: self(), effects: [roll, {:look, 0.5}]},
        ptz: {Hal.FakePtz, test: self(), device: :ptz},
        trace: {Recorder, :trace, [id]}
      ] ++ more
    )
  end

  # An entry as a gate would send it, that no compression makes small.
  defp entry(n, bytes) do
    {junk, _state} = :rand.bytes_s(bytes, :rand.seed_s(:exsss, n))
    {:gate, :input, {:wish, junk}, n}
  end

  test "a recorded robot replays with equal decisions, after crashes too", %{tmp_dir: folder} do
    path = Path.join(folder, "run.mcap")
    recorder = recorder(robots: [:rec1], file: [path: path])
    id = rolling_on(:rec1)
    :ok = Pilot.start(id)
    ticks(5)
    :ok = Gate.estop(id)
    :ok = Gate.reset(id)
    :ok = Pilot.stop(id)
    crash(id, :executive)
    ticks(3)
    crash(id, :gate)
    ticks(3)
    stop_supervised!(id)
    assert Recorder.close(recorder) == :ok

    {file, counts, differences} = replayed(path)
    assert differences == []
    assert file.whole?
    assert Recording.File.ids(file) == [:rec1]
    assert counts[{:rec1, :gate}].begun == 2
    assert counts[{:rec1, :executive}].begun == 3
    assert counts[{:rec1, :pilot}].begun == 3
    for {_key, role} <- counts, do: assert(role.decisions > 5 and role.lost == 0)
    for {_key, role} <- counts, do: assert(role.skipped == 0)

    {:ok, reader} = Mcap.Reader.open(path)
    topics = reader |> Mcap.Reader.messages() |> Enum.map(&elem(&1, 0)) |> Enum.uniq()
    for topic <- ~w(/convoy/robot /convoy/trace /log /rec1/state), do: assert(topic in topics)
  end

  test "a robot whose file says so is recorded by its node, which starts the recorder again", %{
    tmp_dir: folder
  } do
    file = %Robot.File{
      id: :rec10,
      profile: Hal.Profile.magellan(),
      start: Hal.Pose.new(0, 0),
      drive: {Hal.FakeDrive, test: self(), device: :drive},
      record: [folder: folder, limit_mb: 4]
    }

    assert {:ok, config} = Swarm.MemberSpec.config(file)
    assert config.trace == {Recorder, :trace, [:rec10]}
    {:ok, [child]} = Swarm.MemberSpec.recorders(file)
    start_supervised!({Swarm.Supervisor.BackoffSupervisor, child})
    {first, _queue} = Names.lookup(:rec10, :recorder)
    Process.exit(first, :kill)
    again = fn -> with {pid, _queue} <- Names.lookup(:rec10, :recorder), do: pid != first end
    Swarm.Case.eventually(again)
    {recorder, _queue} = Names.lookup(:rec10, :recorder)

    rolling_on(:rec10)
    :ok = Pilot.start(:rec10)
    ticks(3)
    stop_supervised!(:rec10)
    assert %{failed: nil, lost: 0, file: path} = Recorder.status(recorder)
    assert Recorder.close(recorder) == :ok
    assert {_file, counts, []} = replayed(path)
    assert counts[{:rec10, :gate}].decisions > 0
  end

  # Kills it, and starts the mission again: in the next pilot, since the one before ends after what was killed.
  defp crash(id, role) do
    before = Names.whereis(id, :pilot)
    kill(id, role)
    start_next(id, before, 400)
  end

  defp start_next(id, before, left) when left > 0 do
    case Names.whereis(id, :pilot) do
      pid when pid in [nil, before] ->
        receive(do: (:never -> :ok), after: (20 -> start_next(id, before, left - 1)))

      _next ->
        :ok = Pilot.start(id)
    end
  end

  test "so does a robot in a dry run", %{tmp_dir: folder} do
    path = Path.join(folder, "run.mcap")
    recorder = recorder(robots: [:rec2], file: [path: path])
    id = rolling_on(:rec2, dry_run: true)
    :ok = Pilot.start(id)
    ticks(3)
    stop_supervised!(id)
    assert Recorder.close(recorder) == :ok
    assert {_file, %{{:rec2, :gate} => %{decisions: decisions}}, []} = replayed(path)
    assert decisions > 3
  end

  test "a queue sends only so much, and tells a role's loss before its next entry" do
    queue = Queue.new(3)
    for n <- 1..5, do: Queue.send_entry(queue, self(), :q, {:gate, :input, :step, n})
    Queue.send_entry(queue, self(), :q, {:pilot, :input, :stop, 6})
    for n <- 1..3, do: assert_receive({:entry, :q, {:gate, :input, :step, ^n}, _now})
    assert_receive {:entry, :q, {:pilot, :input, :stop, 6}, _now}
    refute_received {:entry, :q, _entry, _now}

    Queue.taken(queue, :gate)
    Queue.taken(queue, :gate)
    Queue.send_entry(queue, self(), :q, {:gate, :input, :step, 7})
    assert_receive {:entry, :q, {:gate, :lost, 2, 7}, _now}
    assert_receive {:entry, :q, {:gate, :input, :step, 7}, _now}
  end

  test "what was lost last is told at the end, though no entry follows it", %{tmp_dir: folder} do
    path = Path.join(folder, "run.mcap")
    recorder = recorder(robots: [:rec8], file: [path: path], bound: 2)
    :ok = :sys.suspend(recorder)
    for n <- 1..5, do: Recorder.trace(:rec8, {:gate, :input, :step, n})
    :ok = :sys.resume(recorder)
    assert %{lost: 3} = Recorder.status(recorder)
    assert Recorder.close(recorder) == :ok
    assert {_file, %{{:rec8, :gate} => %{lost: 3}}, []} = replayed(path)
  end

  test "a checkpoint is made only if one is wanted: first, on demand, and after a loss" do
    queue = Queue.new(2)
    me = self()

    state = fn ->
      send(me, :asked)
      {:state, %{}}
    end

    offer = fn -> Queue.send_entry(queue, me, :q, {:gate, :checkpoint, state, 1}) end
    offer.()
    assert_received :asked
    assert_received {:entry, :q, {:gate, :checkpoint, {:state, %{}}, 1}, _now}
    offer.()
    refute_received :asked

    Queue.ask(queue)
    offer.()
    assert_received :asked
    # Two are under way, so this one is lost.
    Queue.send_entry(queue, me, :q, {:gate, :input, :step, 2})
    for _ <- 1..2, do: Queue.taken(queue, :gate)
    Queue.send_entry(queue, me, :q, {:gate, :input, :step, 3})
    for _ <- 1..2, do: Queue.taken(queue, :gate)
    offer.()
    assert_received :asked
  end

  test "what a recorder that is slow could not take is lost, counted, and never called equal",
       %{tmp_dir: folder} do
    path = Path.join(folder, "run.mcap")
    recorder = recorder(robots: [:rec3], file: [path: path], bound: 20)
    id = rolling_on(:rec3)
    :ok = Pilot.start(id)
    ticks(2)
    :ok = :sys.suspend(recorder)
    ticks(25)
    {:messages, waiting} = Process.info(recorder, :messages)
    assert Enum.count(waiting, &match?({:entry, _, {:gate, _, _, _}, _}, &1)) <= 21
    :ok = :sys.resume(recorder)
    ticks(5)
    stop_supervised!(id)
    assert %{lost: lost, failed: nil} = Recorder.status(recorder)
    assert lost > 0
    assert Recorder.close(recorder) == :ok
    assert {_file, counts, []} = replayed(path)
    assert counts |> Enum.map(fn {_key, role} -> role.lost end) |> Enum.sum() == lost
    # It went on from the state that a loss asks for.
    assert counts[{:rec3, :gate}].decisions > 20
  end

  test "a crash of the recorder does not touch the robot; the next one begins another file",
       %{tmp_dir: folder} do
    options = [robots: [:rec4], file: [path: folder, limit_bytes: 5_000_000]]
    first = recorder(options)
    id = rolling_on(:rec4)
    :ok = Pilot.start(id)
    ticks(3)
    roles = [:gate, :executive, :pilot, :drive]
    before = for role <- roles, do: Names.whereis(id, role)
    monitor = Process.monitor(first)
    Process.exit(first, :kill)
    assert_receive {:DOWN, ^monitor, _, _, :killed}
    ticks(3)
    second = recorder(options)
    ticks(4)
    assert for(role <- roles, do: Names.whereis(id, role)) == before
    stop_supervised!(id)
    assert Recorder.close(second) == :ok

    assert {_file, counts, []} = replayed(Path.join(folder, Folder.name(2)))
    # From the checkpoint that the second one asked for.
    assert counts[{:rec4, :gate}].begun == 0
    assert counts[{:rec4, :gate}].decisions > 3
    assert counts[{:rec4, :executive}].decisions > 3
  end

  test "a file of a folder that begins in the middle replays by itself", %{tmp_dir: folder} do
    recorder = recorder(robots: [:rec5, :fill5], file: [path: folder, limit_bytes: 5_000_000])
    id = rolling_on(:rec5)
    :ok = Pilot.start(id)
    ticks(2)
    # As much as many minutes of a robot, so that the next file begins.
    for n <- 1..8, do: send(recorder, {:entry, :fill5, entry(n, 100_000), 1})
    turned(recorder, Folder.name(1), 400)
    ticks(15)
    stop_supervised!(id)
    %{file: last} = Recorder.status(recorder)
    assert Recorder.close(recorder) == :ok
    assert {file, counts, []} = replayed(last)
    assert file.robots[:rec5].offset_ms != nil
    assert counts[{:rec5, :gate}].begun == 0
    assert counts[{:rec5, :gate}].decisions > 3
  end

  defp turned(recorder, name, left) when left > 0 do
    %{file: file} = Recorder.status(recorder)

    if Path.basename(file) == name,
      do: receive(do: (:never -> :ok), after: (20 -> turned(recorder, name, left - 1)))
  end

  test "a folder that cannot be written is told once, tried again, and does not touch the robot",
       %{tmp_dir: folder} do
    place = Path.join(folder, "runs")
    File.write!(place, "a file in its way")
    listen(:rec6, [:robot, :recorder, :failed])
    listen(:rec6, [:robot, :recorder, :healed])
    file = [path: place, limit_bytes: 5_000_000]
    recorder = recorder(robots: [:rec6], file: file, again_ms: 0)
    assert_receive {[:robot, :recorder, :failed], %{line: line}}
    assert line =~ "runs cannot be written: not a directory"
    assert %{failed: ^line, file: nil} = Recorder.status(recorder)
    id = rolling_on(:rec6)
    :ok = Pilot.start(id)
    ticks(12)
    refute_received {[:robot, :recorder, :failed], _about}
    File.rm!(place)
    assert_receive {[:robot, :recorder, :healed], %{file: path}}, 10_000
    ticks(5)
    stop_supervised!(id)
    assert Recorder.close(recorder) == :ok
    assert {_file, counts, []} = replayed(path)
    assert counts[{:rec6, :executive}].decisions > 0
  end

  # Asked out of turn, so that it does not depend on the second in which the recorder writes.
  test "a file that does not answer is told a second after it was asked, and given up", %{
    tmp_dir: folder
  } do
    path = Path.join(folder, "run.mcap")
    listen(:fill9, [:robot, :recorder, :failed])
    recorder = recorder(robots: [:fill9], file: [path: path], given_up_ms: 1_200)
    writer = written(recorder, 400)
    :ok = :sys.suspend(writer)
    1 = :erlang.trace(writer, true, [:receive, :monotonic_timestamp])
    for n <- 1..5_000, do: send(recorder, {:entry, :fill9, {:gate, :input, :step, n}, 1})
    assert_receive {:trace_ts, ^writer, :receive, {:"$gen_call", _from, :written}, asked}
    assert_receive {[:robot, :recorder, :failed], %{line: line}}, 10_000
    waited = System.convert_time_unit(System.monotonic_time() - asked, :native, :millisecond)
    assert line == "#{path}: its disk does not answer"
    assert waited in 999..1_500
    assert_receive {[:robot, :recorder, :failed], %{line: line}}, 10_000
    assert line == "#{path}: its disk has not answered for 1 s"
    assert %{failed: ^line, file: nil} = Recorder.status(recorder)
    refute Process.alive?(writer)
  end

  # Its file is open, and what was asked is answered.
  defp written(recorder, left) when left > 0 do
    case :sys.get_state(recorder).output do
      %{file: path, question: nil, writer: writer} when path != nil -> writer
      _asked -> receive(do: (:never -> :ok), after: (20 -> written(recorder, left - 1)))
    end
  end

  describe "on a full disk" do
    unless @mounts, do: @describetag(skip: "no file system can be mounted here")

    test "the recording ends with what found room, and says so once", %{tmp_dir: folder} do
      {_said, 0} = System.cmd("mount", ["-t", "tmpfs", "-o", "size=1m", "none", folder])
      on_exit(fn -> {_said, 0} = System.cmd("umount", ["-l", folder]) end)
      path = Path.join(folder, "run.mcap")
      listen(:fill7, [:robot, :recorder, :failed])
      recorder = recorder(robots: [:fill7, :rec7], file: [path: path], again_ms: 0)
      id = rolling_on(:rec7)
      :ok = Pilot.start(id)
      ticks(15)
      for n <- 1..20, do: send(recorder, {:entry, :fill7, entry(n, 100_000), 1})
      assert_receive {[:robot, :recorder, :failed], %{line: line}}, 10_000
      assert line == "#{path} cannot be written: no space left on device"
      ticks(12)
      refute_received {[:robot, :recorder, :failed], _about}
      stop_supervised!(id)
      assert Recorder.close(recorder) == {:error, line}
      assert {_file, counts, []} = replayed(path)
      assert counts[{:rec7, :gate}].decisions > 3
    end
  end

  describe "a disk that hangs" do
    unless @freezes, do: @describetag(skip: "no file system can be frozen here")

    test "is told a second after its next write, costs the robot nothing, and loses what it had no room for",
         %{
           tmp_dir: folder
         } do
      :ok = mounted(folder)

      on_exit(fn ->
        _whole = System.cmd("fsfreeze", ["-u", folder], stderr_to_stdout: true)
        {_said, 0} = System.cmd("umount", ["-l", folder])
        File.rm!(image())
      end)

      runs = Path.join(folder, "runs")
      listen(:rec9, [:robot, :recorder, :failed])
      listen(:rec9, [:robot, :recorder, :healed])
      recorder = recorder(robots: [:rec9], file: [path: runs, limit_bytes: 0x40_0000], bound: 40)
      id = rolling_on(:rec9)
      :ok = Pilot.start(id)
      ticks(12)

      {_said, 0} = System.cmd("fsfreeze", ["-f", folder])
      asked_ms = Hal.Clock.now_ms()
      assert_receive {[:robot, :recorder, :failed], %{line: line}}, 10_000
      # The recorder writes once a second.
      assert Hal.Clock.now_ms() - asked_ms < 2_500
      assert line == "#{runs}: its disk does not answer"
      assert %{failed: ^line} = Recorder.status(recorder)
      ticks(40)
      {_said, 0} = System.cmd("fsfreeze", ["-u", folder])
      assert_receive {[:robot, :recorder, :healed], _about}, 10_000
      assert %{failed: nil, lost: lost} = Recorder.status(recorder)
      assert lost > 0

      ticks(12)
      stop_supervised!(id)
      assert Recorder.close(recorder) == :ok
      assert {_file, counts, []} = replayed(Path.join(runs, Folder.name(1)))
      assert counts[{:rec9, :executive}].lost > 0
      assert counts[{:rec9, :executive}].decisions > 20
    end
  end
end
