defmodule Sim.EmulatorTest do
  @moduledoc "Emulated devices on real pseudo-terminals, in a world in real time; the test is their driver."
  use ExUnit.Case, async: true
  import Hal.Lines, only: [eventually: 1]
  alias Hal.{Pose, Profile, Serial}
  alias Sim.{Emulator, World}
  @moduletag :realtime
  @moduletag :tmp_dir

  @on "1b0202002208000186a0000000030c1b03"
  @forward "1b020200070e0000001885000 03d4d0000753001a21b03"
  @left "1b020200070e01000001d1000186a0000088b801cc1b03"
  @stop "1b020200070e0000000000000 03d4d00007530013f1b03"
  @inputs "1b020500000400 0186a0261b03"
  @sonar "1b020404000d00007530000004e20000000002ac1b03"
  @infrared "1b020600001500000000000000460000000a0000001400000096 02df1b03"
  @status "1b0201000100001b03"

  setup %{tmp_dir: folder} = context do
    {:ok, map} = Sim.Floorplan.open("hall", 1)

    {x, y} = Map.get(context, :place, {-2, 0})
    robot = %{id: :mag1, profile: Profile.magellan(), pose: Pose.new(x, y), infrared: true}
    world = World.new!(map: map, robots: [robot], landmark: {0.0, 0.0}, noise: :off)
    name = make_ref()
    server = start_supervised!({World.Server, name: name, world: world})
    %{server: server, world: name, link: Path.join(folder, "line")}
  end

  defp base(context, options \\ [], wire \\ []) do
    start_supervised!(
      {Emulator,
       core: {Sim.Emulator.RFlexController, [brake: :released] ++ options},
       link: context.link,
       body: {Sim.Device.Drive, world: context.world, robot: :mag1},
       wire: wire}
    )
  end

  defp line(context) do
    {:ok, line} = Serial.open(port: context.link)
    line
  end

  defp say(line, hexes) do
    bytes =
      for hex <- List.wrap(hexes),
          do: hex |> String.replace(" ", "") |> Base.decode16!(case: :lower)

    :ok = Serial.write(line, bytes)
  end

  # The next report for which `match` gives something, out of whole frames.
  defp report(line, match, bytes \\ <<>>) do
    case Sim.Emulator.RFlexController.Frame.cut(bytes) do
      {frames, rest, _bad} ->
        Enum.find_value(frames, fn {port, _id, opcode, data} -> match.({port, opcode, data}) end) ||
          report(line, match, rest <> more(line))
    end
  end

  defp more(line) do
    receive do
      message ->
        case Serial.handle(line, message) do
          {:data, bytes} -> bytes
          {:error, reason} -> flunk("the line is lost: #{inspect(reason)}")
          :unknown -> more(line)
        end
    after
      3_000 -> flunk("nothing comes over the line")
    end
  end

  defp volts({1, 1, <<_at::32, centivolts::32, _brake>>}), do: centivolts / 100
  defp volts(_other), do: nil

  defp counter({2, 33, <<_::64, 0, position::signed-32, _::binary>>}), do: position
  defp counter(_other), do: nil

  defp truth(server), do: World.truth(World.Server.world(server), :mag1)
  defp speed(server), do: World.Server.world(server).robots.mag1.speed

  test "the base drives by bytes, and its counters match the body's motion", context do
    base(context)
    line = line(context)
    say(line, [@on, @inputs, @sonar, @forward])
    start = truth(context.server)

    eventually(fn ->
      say(line, @forward)
      truth(context.server).x > start.x + 0.3
    end)

    say(line, @stop)
    eventually(fn -> speed(context.server) == {0.0, 0.0} end)
    way = Pose.distance(start, truth(context.server))
    eventually(fn -> abs(report(line, &counter/1) / 31_387 - way) < 0.002 end)
    Serial.close(line)
  end

  test "it turns left, reports its battery, and stops when no commands come any more",
       context do
    base(context, timeout_ms: 300)
    line = line(context)
    say(line, [@left, @status])
    assert_in_delta report(line, &volts/1), 25.3, 0.4

    eventually(fn ->
      say(line, @left)
      truth(context.server).heading > 0.01
    end)

    eventually(fn -> speed(context.server) == {0.0, 0.0} end)
  end

  # 0.35 m from the right wall to the front sensor, which is 0.2 m in front of the centre.
  @tag place: {7.45, 0}
  test "infrared senses what is near, in the controller's order", context do
    base(context, ghost: :off)
    line = line(context)
    say(line, @infrared)

    near = fn
      {6, 1, <<2, _::32, _rear::binary-size(8), 0x80, _::32, front::binary-size(8), 0x80>>} ->
        front

      _other ->
        nil
    end

    eventually(fn ->
      <<right1, right2, right3, right4, left3, left2, left1, ahead>> = report(line, near)
      bytes = [right1, right2, right3, right4, left1, left2, left3]
      ahead > Enum.max(bytes) and {right1, right2, right3} == {left1, left2, left3}
    end)
  end

  test "unplugged, the driver's end is connected to nothing; plugged in, the link is back",
       context do
    emulator = base(context)
    line = line(context)
    say(line, @status)
    assert report(line, &volts/1) > 20
    :ok = Emulator.unplug(emulator)
    assert lost(line) in [:unplugged, :eio]
    Serial.close(line)
    eventually(fn -> Serial.open(port: context.link) == {:error, :enoent} end)
    :ok = Emulator.plug(emulator)
    eventually(fn -> match?({:ok, _}, File.stat(context.link)) end)
    line = line(context)
    say(line, @status)
    assert report(line, &volts/1) > 20
  end

  defp lost(line) do
    receive do
      message ->
        case Serial.handle(line, message) do
          {:error, reason} -> reason
          _data -> lost(line)
        end
    after
      3_000 -> flunk("the line is there")
    end
  end

  test "frozen, it neither hears nor sends, and the body stands; restarted, it has forgotten all",
       context do
    emulator = base(context, timeout_ms: :off)
    line = line(context)
    say(line, [@on, @forward])
    eventually(fn -> elem(speed(context.server), 0) > 0.1 end)
    :ok = Emulator.freeze(emulator)
    eventually(fn -> speed(context.server) == {0.0, 0.0} end)
    say(line, @status)
    :ok = Emulator.thaw(emulator)
    eventually(fn -> elem(speed(context.server), 0) > 0.1 end)
    # It did not hear the question; reports go on.
    assert report(line, &counter/1)
    :ok = Emulator.restart(emulator)
    eventually(fn -> speed(context.server) == {0.0, 0.0} end)
    assert Sim.Emulator.core(emulator).motion == nil
    say(line, @status)
    assert report(line, &volts/1) > 20
  end

  test "with faults on the wire some frames arrive, and none that was not sent", context do
    base(context, [], drop: 0.01, double: 0.005, flip: 0.005, seed: 4)
    line = line(context)

    eventually(fn ->
      say(line, @on)
      match?({_, _}, report(line, fn report -> counter(report) && {:ok, report} end))
    end)

    for _ <- 1..20, do: assert(report(line, &counter/1) in -5..5)
  end

  test "it waits for its world, and for a line that is in use", context do
    File.write!(context.link <> "2", "somebody's")
    test = self()
    handler = fn _event, _measurements, about, _config -> send(test, about) end
    :ok = Hal.Event.attach(:emulator_line, [:sim, :emulator, :line], handler, nil)
    on_exit(fn -> Hal.Event.detach(:emulator_line) end)

    emulator =
      start_supervised!(
        {Emulator,
         core: {Sim.Emulator.RFlexController, []},
         link: context.link <> "2",
         body: {Sim.Device.Drive, world: :no_such_world, robot: :mag1}}
      )

    assert_receive %{reason: :eexist}
    File.rm!(context.link <> "2")
    eventually(fn -> match?({:ok, _}, File.lstat(context.link <> "2")) end)
    assert Process.alive?(emulator)
  end

  test "the head turns the world's camera", context do
    start_supervised!(
      {Emulator,
       core: {Sim.Emulator.ViscaCamera, []},
       link: context.link,
       body: {Sim.Device.Ptz, world: context.world, robot: :mag1}}
    )

    line = line(context)
    say(line, "8101060218140f0e0f080f0f0808ff")
    assert more(line) =~ <<0x90, 0x41, 0xFF>>

    eventually(fn ->
      %{pan: pan, tilt: tilt} = World.Server.world(context.server).robots.mag1
      abs(pan - 30 * :math.pi() / 180) < 1.0e-6 and abs(tilt + 10 * :math.pi() / 180) < 1.0e-6
    end)

    eventually(fn -> more(line) =~ <<0x90, 0x51, 0xFF>> end)
  end

  test "wrong options are an error of one line, and the link is removed at the end", context do
    for options <- [
          [core: {Sim.Emulator.RFlexController, [ghost: 1]}],
          [core: {Sim.Emulator.ViscaCamera, [power: 1]}],
          [core: {Sim.Emulator.ViscaCamera, []}, wire: [drop: 7]]
        ] do
      assert {:error, line} = Emulator.start_link([link: context.link] ++ options)
      assert is_binary(line)
    end

    base(context)
    assert {:ok, _} = File.lstat(context.link)
    stop_supervised!(Emulator)
    eventually(fn -> File.lstat(context.link) == {:error, :enoent} end)
  end
end
