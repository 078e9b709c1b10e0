defmodule Record.IncidentsTest do
  @moduledoc "What a robot knows of its last minute is a recording after an incident, and only then."
  use Robot.Case, async: true
  import Record.Replayed, only: [replay: 1]
  alias Hal.Event
  alias Record.{Incidents, Recorder, Recording, Replay}
  @moduletag :realtime
  @moduletag :tmp_dir
  @moduletag :capture_log

  defp keeping(id, folder, more \\ []) do
    options = [robots: [id], folder: folder, limit_mb: 4] ++ more
    pid = start_supervised!(%{id: make_ref(), start: {Incidents, :start_link, [options]}})

    for what <- [:kept, :failed] do
      event = [:robot, :incident, what]
      :ok = Event.attach({self(), id, what}, event, &__MODULE__.tell/4, {self(), id})
      on_exit(fn -> Event.detach({self(), id, what}) end)
    end

    roll = {:goal, :roll, {Acts.Roll, twist: Twist.new(0.3, 0.1)}}
    mission = {Acts.Mission, test: self(), effects: [roll]}
    robot(id, mission: mission, trace: {Recorder, :trace, [id]})
    :ok = Pilot.start(id)
    pid
  end

  def tell([_, _, what], _measured, %{robot: id} = about, {test, id}),
    do: send(test, {what, about})

  def tell(_event, _measured, _about, _other), do: :ok

  defp ticks(count), do: for(_ <- 1..count, do: assert_receive({:mission, {:tick, _}}))

  defp replayed(path) do
    {:ok, file} = Recording.File.open(path)
    {replay, differences} = replay(file)
    {file, Map.new(Replay.counts(replay)), differences}
  end

  test "an emergency stop is written with what came before and after it, and replays", c do
    keeping(:inc1, c.tmp_dir)
    ticks(8)
    :ok = Gate.estop(:inc1)
    assert_receive {:kept, %{file: file, why: ["inc1: emergency stop"]}}, 6_000
    assert Path.dirname(file) == c.tmp_dir
    assert {%{whole?: true}, counts, []} = replayed(file)
    for {_key, role} <- counts, do: assert(role.lost == 0)
    assert counts[{:inc1, :gate}].decisions > 20
    # What the robot made of it is in it, too.
    {:ok, reader} = Mcap.Reader.open(file)
    %{start_ns: from_ns, end_ns: to_ns} = Mcap.Reader.summary(reader)
    assert to_ns - from_ns > 1_500_000_000
  end

  test "a crash of its mission does it, a person may ask, and there is a file for each", c do
    keeping(:inc2, c.tmp_dir)
    ticks(3)
    kill(:inc2, :executive)
    ref = make_ref()
    GenServer.cast(Names.via(:inc2, :incidents), {:keep, :inc2, alias_of(ref)})
    assert_receive {:kept, %{file: first, why: ["inc2: a person asked"]}}, 6_000
    about = %{robot: :inc2, stage: :crashed, crash: "(RuntimeError) boom"}
    Event.execute([:robot, :stage], %{at_ms: 0}, about)
    assert_receive {:kept, %{file: second, why: ["inc2: crashed: (RuntimeError) boom"]}}, 6_000
    assert first != second and length(File.ls!(c.tmp_dir)) == 2
  end

  # The address for the answer; nothing waits for it here.
  defp alias_of(_ref), do: :erlang.alias()

  test "what is older is forgotten, and never more is kept than asked for", c do
    pid = keeping(:inc3, c.tmp_dir, seconds: 1, most: 300)
    ticks(60)
    %{count: count, entries: entries} = :sys.get_state(pid)
    assert count <= 300 and count == :queue.len(entries)
    {{:value, {first_ms, _}}, _rest} = :queue.out(entries)
    assert Hal.Clock.now_ms() - first_ms < 5_000
  end

  test "a folder that cannot be is one line, and the next incident is tried again", c do
    folder = Path.join(c.tmp_dir, "file")
    File.write!(folder, "")
    keeping(:inc4, folder)
    ticks(3)
    :ok = Gate.estop(:inc4)
    assert_receive {:failed, %{line: line}}, 6_000
    assert line =~ folder
    File.rm!(folder)
    :ok = Gate.reset(:inc4)
    :ok = Gate.estop(:inc4)
    assert_receive {:kept, %{file: _file}}, 6_000
  end
end
