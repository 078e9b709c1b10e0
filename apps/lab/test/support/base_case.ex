defmodule Lab.BaseCase do
  @moduledoc """
  A robot's body in a world of its own, the emulated controller of its base, which was written from the fact sheet
  alone, and the driver of real bases on the line between them, whose readings the test hears.

  Tags: `profile`, `place` (of the body), `base` (options of the controller), `wire` (faults of the line).
  """
  use ExUnit.CaseTemplate
  import Swarm.Case, only: [eventually: 1]
  alias Hal.{Device, Pose, Profile, Twist}
  alias Sim.{Emulator, World}

  @conversions %{
    magellan: [distance: 31_387.0, angle: 4654.2, range: 1474.0, ir_a: 4000.0, ir_b: -2.0],
    atrv_mini: [distance: 190_000.0, angle: 60_000.0, range: 1476.0]
  }

  using do
    quote do
      import Lab.BaseCase
      import Swarm.Case, only: [eventually: 1, order: 1]
      alias Hal.{Profile, Twist}
      alias Sim.Emulator
      @moduletag :tmp_dir
      @moduletag :capture_log
    end
  end

  setup %{tmp_dir: folder} = context do
    {:ok, map} = Sim.Floorplan.open("hall", 1)
    profile = Map.get(context, :profile, Profile.magellan())
    {x, y, heading} = Map.get(context, :place, {-4, 0, 0})
    robot = %{id: :mag1, profile: profile, pose: Pose.new(x, y, heading), infrared: true}
    world = World.new!(map: map, robots: [robot], noise: :off)
    name = make_ref()
    server = start_supervised!({World.Server, name: name, world: world})
    link = Path.join(folder, "base")

    emulator =
      start_supervised!(
        {Emulator,
         core: {Sim.Emulator.RFlexController, [kind: profile.name] ++ Map.get(context, :base, [])},
         link: link,
         body: {Sim.Device.Drive, world: name, robot: :mag1},
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

    # As long as `eventually/2`: on a machine so busy that the base seems silent, the line is opened again meanwhile.
    assert_receive {:health, :drive, {:online, _}}, 30_000
    assert_receive {:odometry, first}, 30_000
    %{server: server, emulator: emulator, device: device, link: link, first: first}
  end

  @doc "Sends a reading to the test."
  def tell(test, reading), do: send(test, reading)

  @doc "The robot's body in the current world."
  def body(server), do: World.Server.world(server).robots.mag1
  @doc "Whether the body stands."
  def still?(server), do: body(server).speed == {0.0, 0.0}

  @doc """
  Sends the speed as a gate does, until the body has come this far; returns its greatest speed
  meanwhile.
  """
  def drive(%{device: device, server: server}, twist, done?, ms \\ 20_000),
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

  @doc """
  Stops it, and waits until it stands; if it does not in time, the failure shows the commands and
  the wheels.
  """
  def stop(%{device: device, server: server} = context) do
    Device.drive(device, Twist.zero())
    deadline = System.monotonic_time(:millisecond) + 20_000

    eventually(fn ->
      still?(server) ||
        (System.monotonic_time(:millisecond) > deadline and
           flunk("it does not stand: #{inspect(body(server).speed)}, " <> said(context)))
    end)
  end

  defp newest_health(last \\ nil) do
    receive do
      {:health, :drive, health} -> newest_health(health)
    after
      0 -> last
    end
  end

  @doc "The newest of these readings; `last` if there is none."
  def newest(kind, last \\ nil) do
    receive do
      {^kind, reading} -> newest(kind, reading)
    after
      0 -> last
    end
  end

  @doc """
  Waits until the driver's pose agrees with the body's, both relative to the start, in metres. If
  they do not agree in time, the failure shows both.
  """
  def agree(context, start \\ {-4, 0, 0}, tolerance \\ 0.005),
    do: agree(context, start, tolerance, System.monotonic_time(:millisecond) + 20_000, nil)

  defp agree(%{server: server} = context, {x, y, heading} = start, tolerance, until_ms, last) do
    odometry = newest(:odometry)
    pose = Pose.relative(Pose.new(x, y, heading), body(server).pose)
    last = if odometry, do: {odometry.pose, pose}, else: last

    cond do
      odometry && Pose.distance(pose, odometry.pose) < tolerance ->
        :ok

      System.monotonic_time(:millisecond) > until_ms ->
        flunk("the driver and the body do not agree: #{inspect(last)}, " <> said(context))

      true ->
        receive(do: (:never -> :ok), after: (20 -> :ok))
        agree(context, start, tolerance, until_ms, last)
    end
  end

  @doc """
  Waits until the driver's pose agrees with the body's, as nearly as that can be known from a line
  that loses reports. Only this function may take odometry out of the mailbox.

  For a section of the path of which only the ends were heard, the driver assumes one heading,
  while the body had others: those of this section, and of the one before, because the distance
  may have been heard later than the turn. So the driver's position may be wrong by each section's
  length times the turns that it may have missed, and by nothing else; its heading must be right.
  If the frame is another one, the driver has reported that a counter jumped, and does not know
  its place.
  """
  def agree_but_for_shape(context) do
    path = %{frame: context.first.frame, pose: context.first.pose, turned: 0.0, shape: 0.0}
    agree_but_for_shape(context, path, System.monotonic_time(:millisecond) + 20_000)
  end

  defp agree_but_for_shape(%{first: %{frame: frame}} = context, path, until_ms) do
    path = follow(path)
    pose = Pose.relative(Pose.new(-4, 0, 0), body(context.server).pose)

    cond do
      path.frame != frame ->
        {:open, driver} = :sys.get_state(context.device).inner
        assert Hal.RFlex.Driver.counts(driver).jumps > 0

      Pose.distance(pose, path.pose) < path.shape + 0.005 and
          abs(Pose.wrap(pose.heading - path.pose.heading)) < 0.005 ->
        :ok

      System.monotonic_time(:millisecond) > until_ms ->
        flunk("the driver and the body do not agree: #{inspect({path, pose})}, " <> said(context))

      true ->
        receive(do: (:never -> :ok), after: (20 -> :ok))
        agree_but_for_shape(context, path, until_ms)
    end
  end

  defp follow(path) do
    receive do
      {:odometry, %{pose: pose, frame: frame}} ->
        turn = abs(Pose.wrap(pose.heading - path.pose.heading))
        shape = Pose.distance(path.pose, pose) * (path.turned + turn / 2)
        follow(%{path | frame: frame, pose: pose, turned: turn, shape: path.shape + shape})
    after
      0 -> path
    end
  end

  defp said(%{emulator: emulator}) do
    core = Emulator.core(emulator)
    "health #{inspect(newest_health())}, #{inspect(core, limit: :infinity)}"
  end
end
