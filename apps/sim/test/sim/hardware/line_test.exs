defmodule Sim.Hardware.LineTest do
  @moduledoc "A whole robot on a line whose other end is silent, mute, or falls silent."
  use Swarm.Case, async: true
  import ExUnit.CaptureLog
  alias Hal.Profile
  alias Sim.{Emulator, World}
  @moduletag :slow
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

  defp rolls(context, id) do
    eventually(fn -> Swarm.arm(id) == :ok end)
    assert order(fn -> Swarm.tell(id, "move:0.2:0") end) == :ok
    x = place(context).x
    eventually(fn -> place(context).x > x + 0.1 end)
  end

  test "a base that hears and never answers is not online, not armed, and does not move",
       context do
    base(context, :all)
    start = place(context)
    id = real(context, :line_mute)
    _refused_or_not = Swarm.tell(id, "move:0.2:0")

    # Longer than the driver waits before it opens the line again.
    never(4_000, fn -> health(id) == :online or Swarm.arm(id) == :ok or not still?(context) end)
    assert health(id) == {:offline, :silent}
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
    assert Hal.Device.arming(Names.whereis(id, :drive)).state == :disarmed
    :ok = Emulator.change(emulator, :silence, [[]])
    eventually(fn -> health(id) == :online end)
    # Nobody has armed it again.
    never(500, fn -> not still?(context) end)
    rolls(context, id)
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

  defp line(id), do: inspect(Swarm.status(id))

  # Without the lines of a port program that got no processor, and without what was so before, told
  # again.
  defp without_stalls(said) do
    case Enum.split_while(said, &(not (&1 =~ "its port program is frozen"))) do
      {said, []} -> said
      {before, [_frozen, _as_before | rest]} -> without_stalls(before ++ rest)
    end
  end

  test "log and status say in words what is wrong with the line, once per change", context do
    Logger.put_module_level(Robot.Devices.Log, :info)
    on_exit(fn -> Logger.delete_module_level(Robot.Devices.Log) end)
    link = context.link

    log =
      capture_log(fn ->
        id = real(context, :line_words)
        eventually(fn -> line(id) =~ "drive offline (#{link}: no such device)" end)
        emulator = base(context, :all)

        eventually(fn -> line(id) =~ "drive offline (#{link}: the base does not report" end)

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
        rolls(context, id)
        :ok = Emulator.unplug(emulator)
        eventually(fn -> line(id) =~ "LINE LOST (acknowledge it)" end)
        eventually(fn -> line(id) =~ "drive offline (#{link}: no such device)" end)
        :ok = Emulator.plug(emulator)
        eventually(fn -> not (line(id) =~ "offline") end)
        assert line(id) =~ "LINE LOST (acknowledge it)"
      end)

    said =
      for line <- String.split(log, "\n"),
          [_, words] <- [String.split(line, "line_words: ")],
          do: words

    wanted = [
      "drive offline: #{link}: no such device",
      "drive offline: #{link}: the base does not report",
      "drive online again",
      "drive offline: #{link}: unplugged",
      "drive: LINE LOST while the wheels turned (#{link}: unplugged)",
      "drive offline: #{link}: no such device",
      "drive online again"
    ]

    said = without_stalls(said)
    assert length(said) == length(wanted)
    for {words, begin} <- Enum.zip(said, wanted), do: assert(String.starts_with?(words, begin))
  end

  test "an armed, idle robot whose bumper is held down backs off once, stands, and says so",
       context do
    emulator = base(context, [])
    id = real(context, :line_held)
    listen(id, [:robot, :fault])
    eventually(fn -> Swarm.arm(id) == :ok end)
    # A bumper that is pressed while the pilot still believes the wheels disarmed is no new touch.
    eventually(fn -> :disarmed not in limits(id) end)
    start = place(context)
    :ok = Emulator.change(emulator, :hold, [[0]])
    assert_receive {[:robot, :fault], %{line: "bumper 0 stays pressed"}}, 5_000
    eventually(fn -> line(id) =~ "FAULT (bumper 0 stays pressed)" and still?(context) end)
    stood = place(context)
    assert Pose.distance(start, stood) < 0.25
    assert_in_delta stood.heading, start.heading, 0.1
    # It moves neither by itself nor by an order, until somebody has checked it.
    _refused_or_not = Swarm.tell(id, "move:-0.1:0")
    never(3_000, fn -> Pose.distance(stood, place(context)) > 0.01 end)

    assert order(fn -> Swarm.disarm(id) end) == :ok
    assert_receive {[:robot, :fault], %{line: nil}}
    assert order(fn -> Swarm.arm(id) end) == :ok
    # Arming is not a reason to move.
    never(1_000, fn -> Pose.distance(stood, place(context)) > 0.01 end)
    refute line(id) =~ "FAULT"
    assert order(fn -> Swarm.tell(id, "move:-0.1:0") end) == :ok
    eventually(fn -> Pose.distance(stood, place(context)) > 0.1 end)
  end
end
