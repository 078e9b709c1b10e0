defmodule Lab.Hardware.LineTest do
  @moduledoc "A whole robot on a line whose other end is silent, mute, or falls silent."
  use Swarm.Case, async: true
  import ExUnit.CaptureLog
  alias Hal.Profile
  alias Sim.{Emulator, World}
  @moduletag :realtime
  @moduletag :tmp_dir
  @moduletag :capture_log

  @conversions [distance: 31_387.0, angle: 4654.2, range: 1474.0, ir_a: 4000.0, ir_b: -2.0]

  setup %{tmp_dir: folder} do
    {:ok, map} = Sim.Floorplan.open("hall", 1)
    body = %{id: :body, profile: Profile.magellan(), pose: Pose.new(-4, 0), infrared: true}
    world = World.new!(map: map, robots: [body], noise: :off)
    name = make_ref()
    server = start_supervised!({World.Server, name: name, world: world})
    %{server: server, world: name, link: Path.join(folder, "base")}
  end

  defp base(context, silent) do
    body = {Sim.Device.Drive, world: context.world, robot: :body}
    core = {Sim.MuteController, silent: silent}
    start_supervised!({Emulator, core: core, link: context.link, body: body})
  end

  # The robot as from its file; armed by hand.
  defp real(context, id) do
    driver = {Hal.RFlex.Driver, port: context.link, conversions: @conversions}
    robot(id, drive: driver, arm: :manual, profile: Profile.magellan())
  end

  defp health(id) do
    with {:ok, health, _at_ms} <- Board.fetch(Board.find!(id), {:health, :drive}, :infinity),
         do: health
  end

  # A robot that gets no processor for half a second does not answer.
  defp limits(id) do
    case Swarm.status(id) do
      %{limits: limits} -> limits
      {:error, _busy} -> limits(id)
    end
  end

  defp place(context), do: World.Server.world(context.server).robots.body.pose
  defp still?(context), do: World.Server.world(context.server).robots.body.speed == {0.0, 0.0}

  # Checks for this long whether it ever happens.
  defp never(ms, condition) do
    until_ms = System.monotonic_time(:millisecond) + ms
    refute Enum.find(looks(until_ms), fn _ -> condition.() end)
  end

  defp looks(until_ms) do
    Stream.repeatedly(fn -> receive(do: (:never -> :ok), after: (20 -> :ok)) end)
    |> Stream.take_while(fn _ -> System.monotonic_time(:millisecond) < until_ms end)
  end

  # As a person who has looked: a robot that got no processor for so long that its line said its last words while the
  # wheels turned has lost it.
  defp arm(id) do
    _nothing_was_lost = Swarm.acknowledge(id)
    Swarm.arm(id)
  end

  # A base that gets no processor for so long that its line is silent disarms the wheels; then it is armed again.
  defp rolls(context, id) do
    eventually(fn -> arm(id) == :ok end)
    x = place(context).x

    eventually(fn ->
      if :disarmed in limits(id), do: arm(id)
      _done_or_not = Swarm.tell(id, "move:0.2:0")
      place(context).x > x + 0.1
    end)
  end

  test "a base that hears and never answers is not online, not armed, and does not move",
       context do
    base(context, :all)
    start = place(context)
    id = real(context, :line_mute)
    _refused_or_not = Swarm.tell(id, "move:0.2:0")

    # Longer than the driver waits before it opens the line again.
    never(4_000, fn -> health(id) == :online or Swarm.arm(id) == :ok or not still?(context) end)

    # The driver opens the line again and again; a port program that got no processor is another reason.
    eventually(fn -> health(id) == {:offline, :silent} end)
    assert place(context) == start
    {:error, line} = Swarm.arm(id)
    assert line =~ "line_mute: " and line =~ "wheels"
  end

  test "if the wheels are no longer reported, they stop, and are disarmed",
       context do
    emulator = base(context, [])
    id = real(context, :line_wheels)
    rolls(context, id)
    :ok = Emulator.change(emulator, :silence, [[2]])
    eventually(fn -> still?(context) end)
    eventually(fn -> health(id) == {:offline, :silent} end)
    # A driver that is opening its line again answers with the reason.
    eventually(fn ->
      match?(%{state: :disarmed}, Hal.Device.arming(Names.whereis(id, :drive)))
    end)

    :ok = Emulator.change(emulator, :silence, [[]])
    eventually(fn -> health(id) == :online end)
    # Nobody has armed it again.
    never(500, fn -> not still?(context) end)
    rolls(context, id)
  end

  test "a stop that a frozen port program has not passed on is not said to have reached the wheels",
       context do
    base(context, [])
    id = real(context, :line_frozen)
    rolls(context, id)
    program = port_program(id)
    # Whatever becomes of the test, nobody is left behind frozen.
    on_exit(fn -> System.cmd("kill", ["-CONT", program], stderr_to_stdout: true) end)
    {_said, 0} = System.cmd("kill", ["-STOP", program])
    eventually(fn -> File.read!("/proc/#{program}/stat") =~ ") T " end)
    # What it had sent before.
    :sys.get_state(Names.whereis(id, :drive))

    # A robot on a busy machine may answer too late.
    estop = fn id -> eventually(fn -> Swarm.ask(id, :estop) end) end

    for stop <- [&Swarm.stop/1, &Swarm.disarm/1, estop] do
      assert {:error, line} = stop.(id)
      assert line =~ ~r/nobody can say/
      assert line =~ "use the robot's own emergency stop"
    end

    {_said, 0} = System.cmd("kill", ["-CONT", program])
    eventually(fn -> still?(context) and Swarm.stop(id) == :ok end)
    assert order(&Swarm.reset/0) == :ok
  end

  defp port_program(id) do
    drive = Names.whereis(id, :drive)
    port = Enum.find(Port.list(), &(Port.info(&1, :connected) == {:connected, drive}))
    {:os_pid, program} = Port.info(port, :os_pid)
    "#{program}"
  end

  test "if sonars are no longer reported, the robot is slow after 0.5 s, stopped and disarmed after 2 s",
       context do
    emulator = base(context, [])
    id = real(context, :line_sonar)
    rolls(context, id)
    :ok = Emulator.change(emulator, :silence, [[4]])
    since_ms = System.monotonic_time(:millisecond)
    eventually(fn -> :blind in limits(id) end)
    assert Hal.Device.arming(Names.whereis(id, :drive)).state == :armed
    eventually(fn -> :disarmed in limits(id) and still?(context) end)
    assert System.monotonic_time(:millisecond) - since_ms >= 1_900
    assert health(id) == :online
    {:error, line} = Swarm.arm(id)
    assert line =~ "sonars"
    :ok = Emulator.change(emulator, :silence, [[]])
    rolls(context, id)
  end

  # Long paths are shortened in words; how they end is told.
  defp line(id), do: id |> Swarm.status() |> inspect() |> by_name()
  defp by_name(words), do: String.replace(words, ~r"(?<=[:(])( ?)/.*base(?=: )", "\\1base")

  # On a busy machine base and port program may get no processor for so long that the line is silent: then the wheels
  # are disarmed, and an unplugged line is none that is lost on the way.
  @stalls [
    "drive disarmed: its base reports nothing",
    "its port program is frozen",
    "the last words, a stop, were said",
    "the base does not report",
    "drive online again",
    "unplugged",
    "no such device"
  ]

  # What is wanted, in its order; what else was said is of a stall.
  defp only_stalls_beside(said, wanted) do
    {wanted, others} =
      Enum.reduce(said, {wanted, []}, fn words, {wanted, others} ->
        if wanted != [] and String.starts_with?(words, hd(wanted)),
          do: {tl(wanted), others},
          else: {wanted, [words | others]}
      end)

    {wanted, Enum.reject(others, &(&1 =~ ~r/#{Enum.join(@stalls, "|")}/))}
  end

  # The line is pulled while the wheels turn.
  defp loses_line(context, emulator, id) do
    rolls(context, id)
    :ok = Emulator.unplug(emulator)
    eventually(fn -> line(id) =~ "drive offline (base: no such device)" end)

    unless line(id) =~ "LINE LOST (acknowledge it)" do
      plugged_in(emulator, id)
      loses_line(context, emulator, id)
    end
  end

  defp plugged_in(emulator, id) do
    :ok = Emulator.plug(emulator)
    eventually(fn -> not (line(id) =~ "offline") end)
  end

  test "log and status say in words what is wrong with the line, once per change", context do
    Logger.put_module_level(Robot.Devices.Log, :info)
    on_exit(fn -> Logger.delete_module_level(Robot.Devices.Log) end)

    log =
      capture_log(fn ->
        id = real(context, :line_words)
        eventually(fn -> line(id) =~ "drive offline (base: no such device)" end)
        emulator = base(context, :all)

        eventually(fn -> line(id) =~ "drive offline (base: the base does not report" end)

        assert line(id) =~ "DISARMED (its base has not reported its wheels yet)"
        # During several of the driver's attempts. On a busy machine the port program may get no
        # processor for half a second, which is told as well.
        never(4_000, fn -> health(id) not in [{:offline, :silent}, {:offline, :frozen}] end)
        :ok = Emulator.change(emulator, :silence, [[]])
        eventually(fn -> not (line(id) =~ "offline") end)
        rolls(context, id)
        :ok = Emulator.change(emulator, :silence, [[4]])
        eventually(fn -> line(id) =~ "BLIND (no sonar; slow)" end)
        :ok = Emulator.change(emulator, :silence, [[]])
        loses_line(context, emulator, id)
        plugged_in(emulator, id)
        # It has said in the log what the status tells already.
        :sys.get_state(Names.whereis(id, :drive))
        assert line(id) =~ "LINE LOST (acknowledge it)"
      end)

    said =
      for line <- String.split(log, "\n"),
          [_, words] <- [String.split(line, "line_words: ")],
          # What it was told to do is there as well.
          not (words =~ ~r/, by \S+$/),
          do: by_name(words)

    wanted = [
      "drive offline: base: no such device",
      "drive offline: base: the base does not report",
      "drive online again",
      "drive offline: base: unplugged",
      "drive: LINE LOST while the wheels turned (base: unplugged)",
      "drive offline: base: no such device",
      "drive online again"
    ]

    assert only_stalls_beside(said, wanted) == {[], []}
    assert Enum.dedup(said) == said
  end

  # A bumper that is pressed while the pilot believes the wheels disarmed is no new touch: if the line was silent in
  # between (above), it is let go and pressed again. Returns where the body stood when it was pressed.
  defp holds_bumper(context, emulator, id) do
    eventually(fn -> arm(id) == :ok end)
    eventually(fn -> :disarmed not in limits(id) and still?(context) end)
    start = place(context)
    :ok = Emulator.change(emulator, :hold, [[0]])

    if told_or_disarmed(id) == :told do
      start
    else
      :ok = Emulator.change(emulator, :hold, [[]])
      holds_bumper(context, emulator, id)
    end
  end

  defp told_or_disarmed(id) do
    disarmed? = :disarmed in limits(id)

    receive do
      {[:robot, :fault], %{line: "bumper 0 stays pressed"}} -> :told
    after
      100 -> if disarmed?, do: :disarmed, else: told_or_disarmed(id)
    end
  end

  # Where it stands. A line that was silent meanwhile, on a busy machine, has disarmed the wheels, which ends the fault:
  # then once more.
  defp stands_after_one_way_back(context, emulator, id) do
    start = holds_bumper(context, emulator, id)
    eventually(fn -> line(id) =~ "FAULT (bumper 0 stays pressed)" and still?(context) end)
    stood = place(context)
    # It moves neither by itself nor by an order, until somebody has checked it.
    _refused_or_not = Swarm.tell(id, "move:-0.1:0")
    never(3_000, fn -> Pose.distance(stood, place(context)) > 0.01 end)

    if :disarmed in limits(id) do
      :ok = Emulator.change(emulator, :hold, [[]])
      flush_faults()
      stands_after_one_way_back(context, emulator, id)
    else
      # How far it rolls on beyond 0.15 m depends on how busy the machine is. A second way back would end the fault first.
      assert Pose.distance(start, stood) > 0.1
      assert_in_delta stood.heading, start.heading, 0.1
      refute_received {[:robot, :fault], _again}
      stood
    end
  end

  defp flush_faults do
    receive do
      {[:robot, :fault], _about} -> flush_faults()
    after
      0 -> :ok
    end
  end

  test "an armed, idle robot whose bumper is held down backs off once, stands, and says so",
       context do
    emulator = base(context, [])
    id = real(context, :line_held)
    listen(id, [:robot, :fault])
    stood = stands_after_one_way_back(context, emulator, id)

    assert order(fn -> Swarm.disarm(id) end) == :ok
    assert_receive {[:robot, :fault], %{line: nil}}
    assert order(fn -> Swarm.arm(id) end) == :ok
    # Arming is not a reason to move.
    never(1_000, fn -> Pose.distance(stood, place(context)) > 0.01 end)
    refute line(id) =~ "FAULT"
    assert order(fn -> Swarm.tell(id, "move:-0.1:0") end) == :ok

    eventually(fn ->
      # As in `rolls`.
      if :disarmed in limits(id), do: arm(id)
      _done_or_not = Swarm.tell(id, "move:-0.1:0")
      Pose.distance(stood, place(context)) > 0.1
    end)
  end
end
