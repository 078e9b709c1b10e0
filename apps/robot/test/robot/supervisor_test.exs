defmodule Robot.SupervisorTest do
  @moduledoc "Who falls, and what happens: each row of the architecture's table within one robot."
  use Robot.Case, async: true
  @moduletag :realtime
  @moduletag :capture_log
  import ExUnit.CaptureLog

  @zero Twist.zero()
  @above [:executive, :pilot]

  defp open_of(list) do
    {:ok, agent} = Agent.start_link(fn -> list end)

    fn ->
      Agent.get_and_update(agent, fn
        [last] -> {last, [last]}
        [next | rest] -> {next, rest}
      end)
    end
  end

  defp idle?(id) do
    assert_receive {[:robot, :executive, :start], %{robot: ^id}}
    assert_receive {[:robot, :pilot, :phase], %{state: :idle}}
    {:ok, %{state: :idle}, _} = Board.fetch(Board.find!(id), :mission, 1_000)
  end

  defp listen(id) do
    listen(id, [:robot, :executive, :start])
    listen(id, [:robot, :pilot, :phase])
    listen(id, [:robot, :gate, :start])
  end

  test "a robot starts idle, and its wheels are told to stand before anything else" do
    id = robot(:fall0)
    assert_receive {:drive, first, _}
    assert first == :init
    assert_receive {:drive, {:drive, twist}, _} when twist == @zero
    stands(150)
    board = Board.find!(id)
    assert {:ok, %{twist: twist}, _} = Board.fetch(board, :driving, :infinity)
    assert Twist.zero?(twist)
    assert {:ok, %{state: :idle}, _} = Board.fetch(board, :mission, :infinity)
    assert {:ok, :online, _} = Board.fetch(board, {:health, :drive}, :infinity)
  end

  test "what the executive that fell had wished is forgotten at once, not braked for slowly" do
    goal = {:goal, :roll, {Acts.Roll, twist: Twist.new(0.5, 0.0)}}
    id = rolling(:fall9, mission: {Acts.Mission, effects: [goal]})
    full_speed(id)
    kill(id, :executive)
    # Up to the stop nothing but full speed; and from then on nothing but stops.
    assert until_slower() == 0.0
    stands(200)
  end

  # With sonars that see nothing: a robot without them does not go so fast.
  defp full_speed(id) do
    send(Names.whereis(id, :drive), {:readings, [{:sonar, List.duplicate(5.1, 16)}]})
    assert_receive {:drive, {:drive, %Twist{linear: v}}, _}
    if v < 0.5, do: full_speed(id), else: forget_drives()
  end

  defp until_slower do
    assert_receive {:drive, {:drive, %Twist{linear: v}}, _}
    if v == 0.5, do: until_slower(), else: v
  end

  test "a behaviour raises: executive, pilot and companions restart idle, the gate stops" do
    test = self()
    id = rolling(:fall1, companions: [{Acts.Companion, test: test}])
    rolls()
    assert_receive {:companion, ^id, companion}
    [gate, drive] = parts(id, [:gate, :drive])
    before = parts(id, @above)
    listen(id)
    listen(id, [:robot, :stage])

    log =
      capture_log(fn ->
        Executive.goal(id, :roll, {Acts.Roll, raise: "a bad behaviour"})
        idle?(id)
        assert_receive {:companion, ^id, other} when other != companion
      end)

    assert log =~ "a bad behaviour"
    assert_receive {[:robot, :stage], %{stage: :crashed, crash: crash}}
    assert crash =~ ~r"^\(RuntimeError\) a bad behaviour, test/support/acts.ex:\d+$"
    board = Board.find!(id)
    assert {:ok, ^crash, _} = Board.fetch(board, {:crashed, :executive}, :infinity)
    # It is told until another one begins.
    assert Executive.goal(id, :roll, {Acts.Roll, twist: @zero}) == :ok
    assert Board.fetch(board, {:crashed, :executive}, :infinity) == :error
    Executive.goal(id, :roll, nil)
    forget_drives()
    assert_receive {:drive, {:drive, twist}, _} when twist == @zero
    stands(150)
    assert parts(id, [:gate, :drive]) == [gate, drive]
    assert Enum.zip_with(before, parts(id, @above), &(&1 != &2)) == [true, true]
  end

  test "a behaviour hangs: it is named first, and the robot is there again, idle" do
    id = rolling(:fall13)
    rolls()
    listen(id)
    for what <- [:silent, :hung], do: listen(id, [:robot, :executive, what])
    [gate, watch | before] = parts(id, [:gate, :watch | @above])
    assert Executive.goal(id, :hang, {Acts.Hang, test: self()}) == :ok
    assert_receive {:hangs, executive}
    begun_ms = System.monotonic_time(:millisecond)

    assert_receive {[:robot, :executive, :silent], %{behaviour: Acts.Hang}}

    assert {:ok, {:silent, Acts.Hang}, _at_ms} =
             Board.fetch(Board.find!(id), {:hung, :executive}, :infinity)

    assert_receive {[:robot, :executive, :hung], %{behaviour: Acts.Hang}}, 10_000
    idle?(id)
    # A slow tick is no hanging.
    assert System.monotonic_time(:millisecond) - begun_ms >= 1_500
    assert executive == hd(before)
    refute Process.alive?(executive)

    assert {:ok, {:hung, Acts.Hang}, _at_ms} =
             Board.fetch(Board.find!(id), {:hung, :executive}, :infinity)

    assert parts(id, [:gate, :watch]) == [gate, watch]
    refute Enum.any?(parts(id, @above), &(&1 in before))
    stands(150)
    # It works again.
    roll = {Acts.Roll, twist: Twist.new(0.1, 0.0)}
    assert Executive.goal(id, :roll, roll) == :ok
    rolls()
  end

  test "a mission hangs: it is named first, and the robot is there again, idle" do
    roll = {:goal, :roll, {Acts.Roll, twist: Twist.new(0.1, 0.0)}}
    id = rolling(:fall16, mission: {Acts.Mission, test: self(), effects: [roll]})
    rolls()
    listen(id)
    for what <- [:silent, :hung], do: listen(id, [:robot, :pilot, what])
    [gate, watch, executive, before] = parts(id, [:gate, :watch | @above])
    board = Board.find!(id)
    hung = fn -> Board.fetch(board, {:hung, :pilot}, :infinity) end
    assert hung.() == :error
    Pilot.hear(id, {:command, :hang})
    assert_receive {:mission, {:hangs, ^before}}
    begun_ms = System.monotonic_time(:millisecond)

    line = "its mission Robot.Acts.Mission"
    assert_receive {[:robot, :pilot, :silent], %{mission: Acts.Mission, line: ^line}}
    assert {:ok, {:silent, Acts.Mission}, _at_ms} = hung.()
    assert_receive {[:robot, :pilot, :hung], %{mission: Acts.Mission}}, 10_000
    assert_receive {[:robot, :pilot, :phase], %{state: :idle}}
    # A mission that is slow does not hang.
    assert System.monotonic_time(:millisecond) - begun_ms >= 1_500
    refute Process.alive?(before)
    assert {:ok, {:hung, Acts.Mission}, _at_ms} = hung.()
    assert parts(id, [:gate, :watch, :executive]) == [gate, watch, executive]
    assert_receive {:drive, {:drive, twist}, _} when twist == @zero
    stands(150)
    # It works again.
    assert Pilot.start(id) == :ok
    rolls()
  end

  test "ticks that are late are no hanging: looks are counted, and not time" do
    looks = fn ticks -> Enum.map_reduce(ticks, {nil, 0}, &swapped/2) |> elem(0) end
    assert Enum.uniq(looks.(Enum.flat_map(1..20, &List.duplicate(&1, 8)))) == [:well]
    silent = List.duplicate(:well, 8) ++ [:silent]
    assert looks.(List.duplicate(1, 9) ++ [2, 2]) == silent ++ [:again, :well]
    ends = silent ++ List.duplicate(:well, 31) ++ [:hangs]
    assert looks.(List.duplicate(1, 41)) == ends
  end

  defp swapped(tick, watch), do: Robot.Safety.LivenessMonitor.look(watch, tick)

  test "a goal that is no behaviour is refused, and one of a mission ends the mission only" do
    id = rolling(:fall14)
    rolls()
    [executive, pilot] = parts(id, @above)
    goal = fn goal -> Executive.goal(id, :t, goal) end

    assert {:error, "expected a behaviour, a module with new/1 and tick/2, got NoSuchModule" <> _} =
             goal.({NoSuchModule, []})

    assert {:error,
            "expected a behaviour, a module with new/1 and tick/2, got Robot.Safety.Gate" <> _} =
             goal.({Gate, []})

    assert {:error, "Robot.Behaviour.Goto: goto option x is missing: expected a number" <> _} =
             goal.({Robot.Behaviour.Goto, y: 1})

    assert {:error, "Robot.Behaviour.Goto: expected options [key: value], got [1]" <> _} =
             goal.({Robot.Behaviour.Goto, [1]})

    assert {:error, "Robot.Behaviour.Follow: follow option target: expected " <> _} =
             goal.({Robot.Behaviour.Follow, target: %Hal.Pose{x: :far, y: 0.0, heading: nil}})

    assert {:error, "expected a goal {module, options} or nil, got :roll" <> _} = goal.(:roll)
    roll = {Acts.Roll, twist: Twist.zero()}
    assert Executive.goal(:fall_nobody, :t, roll) |> elem(1) =~ "no robot :fall_nobody runs"
    rolls()
    assert parts(id, @above) == [executive, pilot]

    listen(id)
    bad = {:do, :ready, [{:goal, :t, {NoSuchModule, []}}]}
    assert inspect(catch_exit(Pilot.command(id, bad))) =~ "got NoSuchModule"
    assert_receive {[:robot, :pilot, :phase], %{state: :idle}}
    assert Names.whereis(id, :executive) == executive
  end

  test "a mission raises: the pilot restarts, the executive drops its goal" do
    id = rolling(:fall2)
    rolls()
    executive = Names.whereis(id, :executive)
    listen(id)
    listen(id, [:robot, :stage])

    capture_log(fn ->
      catch_exit(Pilot.command(id, :raise))
      assert_receive {[:robot, :pilot, :phase], %{state: :idle}}
    end)

    assert_receive {[:robot, :stage], %{stage: :crashed, crash: crash}}
    assert crash =~ ~r"^\(RuntimeError\) the mission was told to, test/support/acts.ex:\d+$"
    board = Board.find!(id)
    assert {:ok, ^crash, _} = Board.fetch(board, {:crashed, :pilot}, :infinity)

    assert Names.whereis(id, :executive) == executive
    assert_receive {:drive, {:drive, twist}, _} when twist == @zero
    stands(150)
  end

  test "the executive is stuck: zero is at the driver all the same" do
    id = rolling(:fall3)
    rolls()
    # The gate alone; what the watch does about it is another test.
    for part <- [:watch, :executive], do: :ok = :sys.suspend(Names.whereis(id, part))
    forget_drives()
    assert_receive {:drive, {:drive, twist}, _} when twist == @zero
    {:ok, %{limits: [:dead_man]}, _} = Board.fetch(Board.find!(id), :driving, :infinity)
    :ok = :sys.resume(Names.whereis(id, :executive))
    rolls()
  end

  test "the executive is killed: zero is at the driver all the same" do
    id = rolling(:fall4)
    rolls()
    listen(id)
    kill(id, :executive)
    forget_drives()
    assert_receive {:drive, {:drive, twist}, _} when twist == @zero
    idle?(id)
  end

  test "the gate is killed: all above restarts idle, and stop is sent first" do
    id = rolling(:fall5)
    rolls()
    [drive | above] = parts(id, [:drive | @above])
    listen(id)
    kill(id, :gate)
    assert_receive {[:robot, :gate, :start], %{latched?: false}}
    idle?(id)
    forget_drives()
    assert_receive {:drive, {:drive, twist}, ^drive} when twist == @zero
    stands(200)
    assert Names.whereis(id, :drive) == drive
    refute Enum.any?(parts(id, @above), &(&1 in above))
  end

  test "the gate is stuck: the drive's own watchdog stops the wheels" do
    id = rolling(:fall6)
    rolls()
    # The liveness monitor would end the gate, which stops them as well.
    for part <- [:watch, :gate], do: :ok = :sys.suspend(Names.whereis(id, part))
    forget_drives()
    assert_receive {:drive, {:drive, twist}, _} when twist == @zero
  end

  test "a gate that hangs is named first, and ended then: all above it restarts idle" do
    id = rolling(:fall17)
    rolls()
    listen(id)
    for what <- [:silent, :hung], do: listen(id, [:robot, :gate, what])
    [gate, drive] = parts(id, [:gate, :drive])
    board = Board.find!(id)
    :ok = :sys.suspend(gate)
    assert_receive {[:robot, :gate, :silent], %{line: "its gate"}}
    assert {:ok, {:silent, nil}, _at_ms} = Board.fetch(board, {:hung, :gate}, :infinity)
    assert_receive {[:robot, :gate, :hung], _about}, 10_000
    idle?(id)
    assert {:ok, {:hung, nil}, _at_ms} = Board.fetch(board, {:hung, :gate}, :infinity)
    assert [other, ^drive] = parts(id, [:gate, :drive])
    assert other != gate
    stands(150)
    assert Pilot.start(id) == :ok
    rolls()
  end

  test "a missing drive is retried; nobody else falls" do
    open = open_of([{:error, :enoent}, {:error, :enoent}, :ok])
    drive = {Hal.FakeDrive, test: self(), device: :drive, open: open}
    roll = {Acts.Roll, twist: Twist.new(0.1, 0.0)}
    id = robot(:fall7, drive: drive, mission: {Acts.Mission, effects: [{:goal, :roll, roll}]})
    parts = parts(id, [:gate | @above])

    health(id, {:offline, :enoent})
    online(id)
    assert Pilot.start(id) == :ok
    rolls()
    assert parts(id, [:gate | @above]) == parts
  end

  test "a drive that reports an error is opened again alone, and stands" do
    id = rolling(:fall8)
    rolls()
    [drive | _] = parts = parts(id, [:drive, :gate | @above])
    send(drive, {:fail, :eio})
    assert_receive {:drive, :terminate, ^drive}
    forget_drives()
    assert_receive {:drive, :init, ^drive}
    online(id)
    stands(250)
    assert Pilot.start(id) == :ok
    rolls()
    assert parts(id, [:drive, :gate | @above]) == parts
  end

  test "a drive that crashes restarts alone; its start stops the motors, and no speed comes" do
    id = rolling(:fall9)
    rolls()
    [drive | parts] = parts(id, [:drive, :gate | @above])

    capture_log(fn ->
      send(drive, :raise)
      assert_receive {:drive, :terminate, ^drive}
      forget_drives()
      assert_receive {:drive, first, again} when again != drive
      assert first == :init
      online(id)
      stands(250)
    end)

    assert parts(id, [:gate | @above]) == parts
  end

  test "a drive that is killed is nowhere armed or online any more before another is there" do
    test = self()

    # The first opens at once, the others when the test lets them.
    open = fn ->
      send(test, {:opens, self()})
      receive(do: (:open -> :ok))
    end

    id = robot(:fall15, drive: {Hal.FakeDrive, test: test, device: :drive, open: open})
    assert_receive {:opens, first}
    send(first, :open)
    online(id)
    board = Board.find!(id)
    for name <- [:offline, :online], do: listen(id, [:hal, :device, name])
    kill(id, :drive)
    assert_receive {:opens, second} when second != first
    assert {:ok, {:offline, :fell}, _} = Board.fetch(board, {:health, :drive}, :infinity)
    assert {:ok, arming, _at_ms} = Board.fetch(board, :arming, :infinity)
    assert arming == %{state: :disarmed, why: "its process crashed, and is started again"}
    assert_received {[:hal, :device, :offline], %{reason: :fell}}
    send(second, :open)
    assert_receive {[:hal, :device, :online], %{again?: true}}
  end

  test "what a person has disarmed stays so when its drive crashes, or is killed, with arm: :auto, too" do
    id = robot(:fall20, arm: :auto)
    drive = fn -> Names.whereis(id, :drive) end
    assert Hal.Device.arming(drive.()).state == :armed
    :ok = Hal.Device.disarm(drive.())

    for end_it <- [fn -> kill(id, :drive) end, fn -> crash(id) end] do
      before = drive.()
      end_it.()
      another_online(id, before)
      assert %{state: :disarmed, by_person?: true} = Hal.Device.arming(drive.())
    end

    assert Hal.Device.arm(drive.()) == :ok
    before = drive.()
    kill(id, :drive)
    another_online(id, before)
    assert Hal.Device.arming(drive.()).state == :armed
  end

  defp another_online(id, before, left \\ 2_000) do
    if left > 0 and Names.whereis(id, :drive) in [nil, before] do
      receive(do: (:never -> :ok), after: (5 -> another_online(id, before, left - 1)))
    else
      # It says that it is offline before it takes anything.
      _state = :sys.get_state(Names.whereis(id, :drive))
      online(id)
    end
  end

  defp crash(id) do
    drive = Names.whereis(id, :drive)
    monitor = Process.monitor(drive)

    capture_log(fn ->
      send(drive, :raise)
      assert_receive {:DOWN, ^monitor, _, _, _}
    end)
  end

  test "a drive that crashes over every message does not take the robot down" do
    id = rolling(:fall10)
    parts = parts(id, [:gate | @above])

    capture_log(fn ->
      for _ <- 1..5 do
        assert_receive {:drive, :init, drive}
        send(drive, :raise)
      end

      assert_receive {:drive, :init, _}
    end)

    assert parts(id, [:gate | @above]) == parts
  end

  test "the devices' supervisor is killed: they end as they always do, and all above restarts once" do
    id = rolling(:fall16)
    rolls()
    robot = Names.whereis(id, :robot)
    before = parts(id, [:drive, :gate | @above])

    {_id, devices, _type, _modules} =
      List.keyfind(Supervisor.which_children(robot), Robot.Devices, 0)

    drive = Names.whereis(id, :drive)
    monitor = Process.monitor(devices)
    listen(id)
    # It is about to end with its supervisor, and takes its time.
    true = :erlang.suspend_process(drive)
    Process.exit(devices, :kill)
    assert_receive {:DOWN, ^monitor, _, _, :killed}
    Process.send_after(self(), :on, 500)
    assert_receive :on
    true = :erlang.resume_process(drive)
    idle?(id)
    assert Names.whereis(id, :robot) == robot

    assert Enum.all?(Enum.zip(before, parts(id, [:drive, :gate | @above])), fn {a, b} ->
             a != b
           end)
  end

  test "the board is killed: all starts afresh" do
    id = rolling(:fall11)
    rolls()
    before = parts(id, [:drive, :gate | @above])
    listen(id)
    kill(id, :board)
    idle?(id)

    assert Enum.all?(Enum.zip(before, parts(id, [:drive, :gate | @above])), fn {a, b} ->
             a != b
           end)
  end

  test "the fourth failure within 5 s ends the robot" do
    id = robot(:fall12)
    robot = Process.monitor(Names.whereis(id, :robot))
    listen(id)

    for _ <- 1..3 do
      kill(id, :gate)
      assert_receive {[:robot, :gate, :start], _}
      idle?(id)
    end

    kill(id, :gate)
    assert_receive {:DOWN, ^robot, _, _, :shutdown}
  end
end
