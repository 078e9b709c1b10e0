defmodule Hal.DeviceTest do
  use ExUnit.Case, async: true
  import ExUnit.CaptureLog
  alias Hal.{Device, Frame, Twist}
  @moduletag :realtime

  doctest Hal.Device.Liveness
  doctest Hal.Device.Explanation

  @zero Twist.zero()
  @modules [drive: Hal.FakeDrive, ptz: Hal.FakePtz, camera: Hal.FakeCamera]

  defp device(kind, options \\ []) do
    driver = {@modules[kind], [test: self(), device: kind] ++ options}
    options = [kind: kind, driver: driver, sinks: [{Kernel, :send, [self()]}]]
    start_supervised!({Device, options})
  end

  # The base has reported, and the wheels may turn.
  defp armed(pid) do
    assert_receive {:arming, %{state: :armed}}
    pid
  end

  defp answers(list) do
    {:ok, agent} = Agent.start_link(fn -> list end)

    fn ->
      Agent.get_and_update(agent, fn
        [last] -> {last, [last]}
        [next | rest] -> {next, rest}
      end)
    end
  end

  test "opens, says so, hands readings on, and drives" do
    pid = device(:drive)
    assert_receive {:drive, :init, ^pid}
    assert_receive {:health, :drive, {:online, since}} when is_integer(since)

    send(pid, {:readings, [{:bumpers, [3]}, {:power, 24.0}]})
    assert_receive {:bumpers, [3]}
    assert_receive {:power, 24.0}

    armed(pid)
    twist = Twist.new(0.3, 0.1)
    assert Device.drive(pid, twist) == :ok
    assert_receive {:drive, {:drive, ^twist}, ^pid}
  end

  test "a confirmation is the next report of the wheels, or that none came, or that nobody could report" do
    {:ok, reports} = Agent.start_link(fn -> [:wheels, :sonar] end)
    open = answers([:ok, {:error, :enoent}])
    pid = armed(device(:drive, open: open, reports: fn -> Agent.get(reports, & &1) end))
    confirm = fn tag, ms -> Device.confirm(pid, ms, {__MODULE__, :tell, [self(), tag]}) end
    confirm.(:fresh, 2_000)
    assert_receive {:fresh, :reported}

    Agent.update(reports, fn _ -> [:sonar] end)
    # What was reported before that.
    confirm.(:first, 150)
    assert_receive {:first, _outcome}
    confirm.(:none, 150)
    assert_receive {:none, :silent}

    confirm.(:lost, 5_000)
    send(pid, {:fail, :unplugged})
    assert_receive {:lost, :closed}
    confirm.(:away, 150)
    assert_receive {:away, :closed}
    assert_raise FunctionClauseError, fn -> confirm.(:long, 5_001) end
  end

  @doc false
  def tell(test, tag, outcome), do: send(test, {tag, outcome})

  test "a drive that hears no more speeds stops its wheels, once" do
    pid = armed(device(:drive))
    twist = Twist.new(0.3, 0.0)
    Device.drive(pid, twist)
    assert_receive {:drive, {:drive, ^twist}, ^pid}
    refute_receive {:drive, {:drive, _}, ^pid}, 100
    assert_receive {:drive, {:drive, stop}, ^pid} when stop == @zero
    refute_receive {:drive, {:drive, _}, ^pid}, 600
  end

  test "a missing device is tried again, ever more slowly" do
    device(:drive, open: answers([{:error, :enoent}, {:error, :enoent}, {:error, :ebusy}, :ok]))
    assert_receive {:health, :drive, {{:offline, :enoent}, since}}
    for _ <- 1..4, do: assert_receive({:drive, :init, _})
    assert_receive {:health, :drive, {{:offline, :ebusy}, ^since}}
    assert_receive {:health, :drive, {:online, later}}
    # 100, 200 and 400 ms, by the device's own clock.
    assert later - since >= 700
  end

  test "a driver that reports an error is closed and opened again" do
    pid = device(:drive)
    assert_receive {:health, :drive, {:online, _}}
    send(pid, {:fail, :eio})
    assert_receive {:drive, :terminate, ^pid}
    assert_receive {:health, :drive, {{:offline, :eio}, _}}
    # Nobody is there to drive meanwhile, and that is not an error.
    Device.drive(pid, Twist.new(0.1, 0.0))
    assert_receive {:health, :drive, {:online, _}}
    refute_received {:drive, {:drive, _}, _}
  end

  test "a driver that raises is closed, and its device restarted" do
    log =
      capture_log(fn ->
        pid = device(:drive)
        assert_receive {:drive, :init, ^pid}
        monitor = Process.monitor(pid)
        send(pid, :raise)
        assert_receive {:drive, :terminate, ^pid}
        refute_receive {:DOWN, ^monitor, _, _, _}, 300
        assert_receive {:DOWN, ^monitor, _, _, _}
        assert_receive {:drive, :init, other} when other != pid
      end)

    assert log =~ "was told to"
  end

  test "a driver that raises: stopped first, then told as offline and disarmed, before its device rests" do
    capture_log(fn ->
      pid = armed(device(:drive))
      send(pid, :raise)
      assert_receive {:drive, :terminate, ^pid}
      # Before the next one is started, 500 ms later.
      assert_receive {:health, :drive, {{:offline, :fell}, _since}}
      assert_receive {:arming, %{state: :disarmed, why: "its process crashed" <> _}}
      assert Process.alive?(pid)
    end)
  end

  test "the one after a device that was killed says first that it is offline and disarmed" do
    robot = listen([:online, :offline])
    driver = {Hal.FakeDrive, [test: self(), device: :drive]}
    was = {Function, :identity, [{:online, 7}]}
    options = [was: was, sinks: [{Kernel, :send, [self()]}], about: %{robot: robot}]
    pid = start_supervised!({Device, [kind: :drive, driver: driver] ++ options})
    # Already when its start returns.
    assert_received {:health, :drive, {{:offline, :fell}, since}} when since != 7
    assert_received {:arming, %{state: :disarmed, why: "its process crashed" <> _}}
    line = "its process crashed, and is started again"
    assert_received {:offline, %{reason: :fell, line: ^line}}
    assert_receive {:online, %{again?: true}}
    armed(pid)
  end

  test "ends with its supervisor, and stops the motors first" do
    pid = device(:drive)
    assert_receive {:drive, :init, ^pid}
    stop_supervised!({Device, :drive})
    assert_received {:drive, :terminate, ^pid}
  end

  test "a pan-tilt unit looks" do
    pid = device(:ptz)
    Device.look(pid, 0.5, 0.0)
    assert_receive {:ptz, {:look, 0.5, tilt}, ^pid} when tilt == 0.0
    send(pid, {:readings, [{:ptz, %{pan: 0.5, tilt: 0.0, field_of_view: 1.0}}]})
    assert_receive {:ptz, %{pan: 0.5}}
  end

  test "a pan-tilt unit that was away is told the last of where to look, and nothing it cannot do" do
    pid = device(:ptz)
    Device.look(pid, 0.1, 0.0)
    Device.zoom(pid, 0.5)
    assert_receive {:ptz, {:look, 0.1, _}, ^pid}
    send(pid, {:fail, :eio})
    assert_receive {:ptz, :terminate, ^pid}
    Device.look(pid, 0.2, 0.0)
    Device.look(pid, 0.3, 0.0)
    assert_receive {:health, :ptz, {{:offline, :eio}, _}}
    assert_receive {:ptz, :init, ^pid}
    assert_receive {:ptz, {:look, 0.3, _}, ^pid}
    refute_received {:ptz, {:look, _, _}, ^pid}
  end

  test "a camera is asked for the next frame when the last was handed on" do
    pid = device(:camera)
    assert_receive {:camera, :next, ^pid}
    send(pid, :something_unknown)
    refute_receive {:camera, :next, ^pid}, 50
    {:ok, frame} = Frame.new(:yuyv, 2, 1, <<1, 2, 3, 4>>, 7)
    send(pid, {:readings, [{:frame, frame}]})
    assert_receive {:frame, ^frame}
    assert_receive {:camera, :next, ^pid}
  end

  test "a camera is online once it has given a picture; one that gives none for 10 s is opened again" do
    clock = :counters.new(1, [])
    driver = {Hal.FakeCamera, test: self(), device: :camera}
    options = [clock: {:counters, :get, [clock, 1]}, sinks: [{Kernel, :send, [self()]}]]
    pid = start_supervised!({Device, [kind: :camera, driver: driver] ++ options})
    assert_receive {:camera, :init, ^pid}
    assert_receive {:camera, :next, ^pid}
    refute_receive {:health, :camera, _status}, 50

    later = fn ms ->
      :counters.add(clock, 1, ms)
      send(pid, :something_unknown)
    end

    later.(9_999)
    send(pid, {:readings, [:a_frame]})
    assert_receive {:health, :camera, {:online, 9_999}}
    later.(9_999)
    refute_receive {:camera, :terminate, ^pid}, 50
    later.(1)
    assert_receive {:health, :camera, {{:offline, :mute}, 19_999}}
    assert_receive {:camera, :terminate, ^pid}
    # Open again it has proven nothing yet.
    assert_receive {:camera, :init, ^pid}
    refute_receive {:health, :camera, {:online, _}}, 50
    send(pid, {:readings, [:a_frame]})
    assert_receive {:health, :camera, {:online, _}}
  end

  test "a pan-tilt unit whose line opens, and then proves dead, is told once, and not as there again" do
    robot = listen([:online, :offline])
    driver = {Hal.FakePtz, test: self(), device: :ptz}
    sinks = [{Kernel, :send, [self()]}]
    device = [kind: :ptz, driver: driver, sinks: sinks, about: %{robot: robot}]
    pid = start_supervised!({Device, device})

    for _ <- 1..3 do
      assert_receive {:ptz, :init, ^pid}
      send(pid, {:fail, :no_answer})
    end

    assert_receive {:ptz, :init, ^pid}
    assert_received {:offline, %{reason: :no_answer}}
    refute_received {:offline, _about}
    refute_received {:online, _about}
    send(pid, {:readings, [{:ptz, %{pan: 0.5, tilt: 0.0, field_of_view: 1.0}}]})
    assert_receive {:online, %{again?: true}}
  end

  defp listen(events) do
    robot = make_ref()

    for event <- events do
      handler = {robot, event}

      :ok =
        Hal.Event.attach(handler, [:hal, :device, event], &__MODULE__.forward/4, {robot, self()})

      on_exit(fn -> Hal.Event.detach(handler) end)
    end

    robot
  end

  def forward(event, _measured, %{robot: robot} = about, {robot, test}),
    do: send(test, {List.last(event), about})

  def forward(_event, _measured, _others, _config), do: :ok

  test "each change is one event, with its reason in words; a try that changes nothing is none" do
    robot = listen([:online, :offline, :arming])
    busy = {:error, :ebusy}
    open = answers([{:error, :enoent}, {:error, :enoent}, busy, busy, :ok])
    words = fn reason -> "the line: #{reason}" end
    driver = {Hal.FakeDrive, test: self(), device: :drive, open: open, words: words}
    device = [kind: :drive, driver: driver, arm: :manual, about: %{robot: robot}]
    pid = start_supervised!({Device, device})
    assert_receive {:online, %{device: :drive, again?: true}}, 5_000
    assert_received {:offline, %{reason: :enoent, line: "the line: enoent"}}
    assert_received {:offline, %{reason: :ebusy, line: "the line: ebusy"}}
    refute_received {:offline, _about}
    assert Device.arm(pid) == :ok
    assert_receive {:arming, %{state: :armed, was: :disarmed}}
    Device.drive(pid, Twist.new(0.1, 0.0))
    send(pid, {:fail, :unplugged})
    assert_receive {:offline, %{line: "the line: unplugged"}}

    assert_receive {:arming,
                    %{state: {:error, :unplugged}, was: :armed, line: "the line: unplugged"}}

    assert_receive {:online, %{again?: true}}
    refute_received {:offline, _about}
  end

  test "wrong options are named" do
    assert_raise ArgumentError, ~r/kind: expected .*:drive, :ptz, :camera or :scan/, fn ->
      Device.start_link(kind: :wheels, driver: {Hal.FakeDrive, []})
    end

    assert_raise ArgumentError, ~r/sonar: expected true or false, got 16/, fn ->
      Device.start_link(kind: :drive, driver: {Hal.FakeDrive, []}, sonar: 16)
    end

    assert_raise ArgumentError, ~r/driver: expected .*, got Hal.FakeDrive/, fn ->
      Device.start_link(kind: :drive, driver: Hal.FakeDrive)
    end
  end
end
