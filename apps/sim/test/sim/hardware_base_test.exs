defmodule Sim.HardwareBaseTest do
  @moduledoc "The driver of real bases against the emulated controller, which was written from the fact sheet alone."
  use ExUnit.Case, async: true
  import Swarm.Case, only: [eventually: 2]
  alias Hal.{Device, Pose, Profile, Twist}
  alias Sim.{Emulator, Server, World}
  @moduletag :tmp_dir
  @moduletag :capture_log

  @conversions %{
    magellan: [distance: 31_387.0, angle: 4654.2, range: 1474.0, ir_a: 4000.0, ir_b: -2.0],
    atrv_mini: [distance: 190_000.0, angle: 60_000.0, range: 1476.0]
  }

  setup %{tmp_dir: folder} = context do
    {:ok, map} = Sim.Map.open("hall", 1)
    profile = Map.get(context, :profile, Profile.magellan())
    {x, y, heading} = Map.get(context, :place, {-4, 0, 0})
    robot = %{id: :mag1, profile: profile, pose: Pose.new(x, y, heading), infrared: true}
    world = World.new!(map: map, robots: [robot], noise: :off)
    name = make_ref()
    server = start_supervised!({Server, name: name, world: world})
    link = Path.join(folder, "base")

    emulator =
      start_supervised!(
        {Emulator,
         core: {Sim.RFlexController, [kind: profile.name] ++ Map.get(context, :base, [])},
         link: link,
         body: {Sim.Drive, world: name, robot: :mag1},
         wire: Map.get(context, :wire, [])}
      )

    options = [
      port: link,
      profile: profile,
      conversions: @conversions[profile.name],
      bumpers: [count: if(profile.name == :magellan, do: 16, else: 0)]
    ]

    sinks = [{__MODULE__, :tell, [self()]}]

    device =
      start_supervised!({Device, kind: :drive, driver: {Hal.RFlex.Driver, options}, sinks: sinks})

    assert_receive {:health, :drive, {:online, _}}, 10_000
    assert_receive {:odometry, _}, 10_000
    %{server: server, emulator: emulator, device: device, link: link}
  end

  @doc false
  def tell(test, reading), do: send(test, reading)

  defp body(server), do: Server.world(server).robots.mag1
  defp still?(server), do: body(server).speed == {0.0, 0.0}

  # Tells it the speed as a gate does, until the body is so far; the fastest that it went meanwhile.
  defp drive(%{device: device, server: server}, twist, done?, ms \\ 20_000),
    do: drive(device, server, twist, done?, System.monotonic_time(:millisecond) + ms, {0.0, 0.0})

  defp drive(device, server, twist, done?, until_ms, {v, w}) do
    Device.drive(device, twist)
    body = body(server)
    {speed, turn} = body.speed
    fastest = {max(v, abs(speed)), max(w, abs(turn))}

    cond do
      done?.(body) ->
        fastest

      System.monotonic_time(:millisecond) > until_ms ->
        flunk("it never got there: #{inspect(body.pose)}")

      true ->
        receive(do: (:never -> :ok), after: (50 -> :ok))
        drive(device, server, twist, done?, until_ms, fastest)
    end
  end

  # What it was told and what the wheels do, for one that does not stop in time.
  defp stop(%{device: device, server: server, emulator: emulator}) do
    Device.drive(device, Twist.zero())
    deadline = System.monotonic_time(:millisecond) + 5_000

    eventually(
      fn ->
        still?(server) ||
          (System.monotonic_time(:millisecond) > deadline and
             flunk(
               "it does not stand: #{inspect(body(server).speed)}, health #{inspect(newest_health())}, " <>
                 inspect(Emulator.core(emulator), limit: :infinity)
             ))
      end,
      6_000
    )
  end

  defp newest_health(last \\ nil) do
    receive do
      {:health, :drive, health} -> newest_health(health)
    after
      0 -> last
    end
  end

  # The newest of these readings.
  defp newest(kind, last \\ nil) do
    receive do
      {^kind, reading} -> newest(kind, reading)
    after
      0 -> last
    end
  end

  # Where the driver believes to be against where the body is, both from the start.
  defp off(%{server: server}, {x, y, heading}) do
    case newest(:odometry) do
      nil ->
        nil

      odometry ->
        Pose.distance(Pose.relative(Pose.new(x, y, heading), body(server).pose), odometry.pose)
    end
  end

  defp agree(context, start \\ {-4, 0, 0}, tolerance \\ 0.005),
    do: eventually(fn -> (off(context, start) || 1.0) < tolerance end, 10_000)

  test "it drives, turns and stops, and its odometry is the body's way", context do
    {fastest, _} = drive(context, Twist.new(0.3, 0.0), &(&1.pose.x > -3.0))
    assert fastest <= 0.3001
    stop(context)
    agree(context)
    drive(context, Twist.new(0.0, 0.5), &(&1.pose.heading > 1.5))
    stop(context)
    drive(context, Twist.new(0.2, -0.4), &(&1.pose.heading < 0.0))
    stop(context)
    drive(context, Twist.new(-0.2, 0.0), &(&1.pose.x < -3.1))
    stop(context)
    agree(context, {-4, 0, 0}, 0.01)

    assert_in_delta newest(:odometry, nil)
                    |> then(&(&1 || last_odometry()))
                    |> Map.get(:pose)
                    |> Map.get(:heading),
                    body(context.server).pose.heading,
                    0.005

    assert Emulator.core(context.emulator).counts |> Map.take([:bad, :unknown, :lost, :escaped]) ==
             %{bad: 0, unknown: 0, lost: 0, escaped: 0}
  end

  defp last_odometry do
    assert_receive {:odometry, odometry}, 2_000
    odometry
  end

  @tag profile: Profile.atrv_mini()
  test "an ATRV mini's, whose turns have an 1B in them", context do
    # 6960 to 7167 counts of 60000 a radian have it.
    drive(context, Twist.new(0.1, 0.117), &(&1.pose.heading > 0.6))
    stop(context)
    agree(context)
    assert Emulator.core(context.emulator).counts.escaped == 0
  end

  # Half a metre before the right wall, which is 0.5 m from its front.
  @tag place: {7.3, 0.0, 0.0}
  test "sonar, infrared, battery and bumpers say what the body feels", context do
    eventually(
      fn ->
        felt = body(context.server)
        sonar = newest(:sonar)

        sonar != nil and
          Enum.zip(sonar, felt.sonar) |> Enum.all?(fn {a, b} -> abs(a - b) < 0.002 end)
      end,
      5_000
    )

    eventually(
      fn ->
        felt = body(context.server)
        near = newest(:ir)
        # A step of the converter is 8 % of a metre at the end of its range.
        near != nil and Enum.zip(near, felt.ir) |> Enum.all?(fn {a, b} -> abs(a - b) < 0.06 end)
      end,
      5_000
    )

    felt = body(context.server)
    assert Enum.at(felt.ir, 11) < 0.6
    assert Enum.at(felt.ir, 3) == 0.8
    assert_receive {:power, volts}, 3_000
    assert_in_delta volts, 25.6, 0.02

    # Into the wall, with the front bumper.
    drive(context, Twist.new(0.3, 0.0), &(Map.keys(&1.pressed) == [0]))
    assert_receive {:bumpers, [0]}, 2_000
    drive(context, Twist.new(-0.3, 0.0), &(&1.pressed == %{}))
    assert_receive {:bumpers, []}, 2_000
    stop(context)
  end

  # On a machine that is busy the bytes of a moment's sleep come to the emulator all at once, however well they were
  # spaced. Of commands that are not spaced, at least every other would be lost, all the time.
  @tag base: [pace: {10, 1}]
  test "commands are so far apart that a controller takes them that takes one in 10 ms",
       context do
    drive(context, Twist.new(0.3, 0.2), &(&1.pose.x > -3.5))
    stop(context)
    %{frames: frames, lost: lost} = Emulator.core(context.emulator).counts
    assert frames > 100
    assert lost < frames / 5
  end

  @tag base: [ghost: :all]
  test "ghost bytes wherever there is an 1B", context do
    drive(context, Twist.new(0.3, 0.2), &(&1.pose.x > -3.5))
    stop(context)
    agree(context)
  end

  @tag base: [counters: {0x7FFFFFFF - 1000, -0x80000000 + 500}]
  test "counters that wrap move nothing", context do
    drive(context, Twist.new(0.3, 0.0), &(&1.pose.x > -3.5))
    stop(context)
    drive(context, Twist.new(0.0, -0.5), &(&1.pose.heading < -0.5))
    stop(context)
    {way, _} = Sim.RFlexController.Motors.counts(Emulator.core(context.emulator).motors, 0)
    {turn, _} = Sim.RFlexController.Motors.counts(Emulator.core(context.emulator).motors, 1)
    assert way < 0 and turn > 0
    agree(context)
  end

  for seed <- 1..3 do
    @tag wire: [drop: 0.01, double: 0.005, flip: 0.005, seed: seed]
    test "with 2 % of faulty bytes it drives, and never faster than its limit (#{seed})",
         context do
      {fastest, fastest_turn} = drive(context, Twist.new(0.4, 0.0), &(&1.pose.x > -2.0), 40_000)
      assert fastest <= 0.501
      assert fastest_turn <= 1.001
      {_, fastest_turn} = drive(context, Twist.new(0.0, 0.5), &(&1.pose.heading > 1.2), 40_000)
      assert fastest_turn <= 1.001
      stop(context)
      assert Emulator.core(context.emulator).counts.bad > 0
      agree(context, {-4, 0, 0}, 0.02)
    end
  end

  test "unplugged in motion the body stops; plugged it goes on, and knows where it is", context do
    drive(context, Twist.new(0.3, 0.0), &(&1.pose.x > -3.7))
    :ok = Emulator.unplug(context.emulator)
    assert_receive {:health, :drive, {{:offline, _reason}, _}}, 3_000
    eventually(fn -> still?(context.server) end, 5_000)
    :ok = Emulator.plug(context.emulator)
    assert_receive {:health, :drive, {:online, _}}, 20_000
    drive(context, Twist.new(0.3, 0.0), &(&1.pose.x > -3.0))
    stop(context)
    agree(context)
  end

  test "a frozen controller is noticed; thawed, it does as the driver wants now", context do
    drive(context, Twist.new(0.3, 0.0), &(&1.pose.x > -3.7))
    :ok = Emulator.freeze(context.emulator)
    assert_receive {:health, :drive, {{:offline, _reason}, _}}, 10_000
    eventually(fn -> still?(context.server) end, 5_000)
    x = body(context.server).pose.x
    :ok = Emulator.thaw(context.emulator)
    assert_receive {:health, :drive, {:online, _}}, 20_000
    assert_in_delta body(context.server).pose.x, x, 0.2
    drive(context, Twist.new(0.3, 0.0), &(&1.pose.x > x + 0.5))
    stop(context)
    agree(context)
  end

  test "a controller that was switched off and on is told all again, and the pose does not jump",
       context do
    drive(context, Twist.new(0.3, 0.0), &(&1.pose.x > -3.4))
    :ok = Emulator.restart(context.emulator)
    drive(context, Twist.new(0.3, 0.0), &(&1.pose.x > -2.8))
    stop(context)
    # What it went while nobody counted is not known: 0.3 m/s for a second or so, braking.
    agree(context, {-4, 0, 0}, 0.35)
  end
end
