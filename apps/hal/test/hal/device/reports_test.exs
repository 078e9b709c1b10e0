defmodule Hal.Device.ReportsTest do
  use ExUnit.Case, async: true
  alias Hal.{Device, Odometry, Pose, Twist}
  alias Hal.Device.Reports
  @moduletag :realtime
  doctest Hal.Device.Reports

  @zero Twist.zero()
  @ahead Twist.new(0.3, 0.0)
  @odometry {:odometry, %Odometry{pose: Pose.new(0, 0), twist: @zero}}

  test "odometry is a report of the wheels, ranges are one of the sonars, nothing else is one" do
    others = [{:power, 24.0}, {:bumpers, []}, {:ir, [1.0]}, {:brake, true}, {:health, :drive, 1}]

    for wheels <- [@odometry, {:report, :wheels}],
        sonar <- [{:sonar, [1.0]}, {:report, :sonar}] do
      reports = Reports.new(true, 0) |> Reports.heard(others, 10)
      assert {:error, line} = Reports.ready(reports, 10)
      assert line =~ "wheels"
      reports = Reports.heard(reports, [wheels | others], 10)
      assert {:error, line} = Reports.ready(reports, 10)
      assert line =~ "sonars"
      reports = Reports.heard(reports, [sonar], 10)
      assert Reports.ready(reports, 10) == :ok
      # Without sonar it is ready for 2 s, without wheels for 0.5 s.
      silent = Reports.heard(reports, [wheels], 2_009)
      assert Reports.ready(silent, 2_009) == :ok
      assert {:error, "its base reports nothing of its sonars"} = Reports.ready(silent, 2_010)
      silent = Reports.heard(reports, [sonar], 509)
      assert Reports.ready(silent, 509) == :ok
      assert {:error, "its base reports nothing of its wheels"} = Reports.ready(silent, 510)
    end
  end

  test "a base without sonars needs to report none" do
    reports = Reports.new(false, 0) |> Reports.heard([@odometry], 10_000)
    assert Reports.ready(reports, 10_000) == :ok
  end

  test "who looks again at the given times notices at once what grew old" do
    for sonar? <- [true, false], wheels_ms <- [nil, 0, 130], sonar_ms <- [nil, 0, 70, 400] do
      reports = %{Reports.new(sonar?, 0) | wheels_ms: wheels_ms, sonar_ms: sonar_ms}
      looks = 0 |> Stream.iterate(&Reports.next_ms(reports, &1)) |> Enum.take_while(&(&1 < 5_000))
      changes = for at <- 1..4_999, says(reports, at) != says(reports, at - 1), do: at
      assert changes -- looks == []
    end
  end

  defp says(reports, at_ms), do: {Reports.wheels(reports, at_ms), Reports.ready(reports, at_ms)}

  # A base that reports what the test says.
  defp base(options) do
    {:ok, agent} = Agent.start_link(fn -> Keyword.get(options, :reports, []) end)

    driver =
      {Hal.FakeDrive, test: self(), device: :drive, reports: fn -> Agent.get(agent, & &1) end}

    device = [kind: :drive, driver: driver, sinks: [{Kernel, :send, [self()]}]]
    pid = start_supervised!({Device, device ++ Keyword.take(options, [:arm, :sonar])})
    {pid, fn reports -> Agent.update(agent, fn _ -> reports end) end}
  end

  test "a base that is open and silent is never online, cannot be armed, and gets no speed" do
    for arm <- [:auto, :manual] do
      {pid, _says} = base(arm: arm)
      assert_receive {:drive, :init, ^pid}
      assert {:error, "its base has not reported its wheels yet"} = Device.arm(pid)
      Device.drive(pid, @ahead)
      assert_receive {:health, :drive, {{:offline, :silent}, _}}
      assert {:error, "its base has not reported its wheels yet"} = Device.arm(pid)
      Device.drive(pid, @ahead)
      assert Device.arming(pid).state == :disarmed
      refute_received {:health, :drive, {:online, _}}
      refute_received {:drive, {:drive, %Twist{linear: 0.3}}, _pid}
      :ok = stop_supervised({Device, :drive})
    end
  end

  test "it is online after the first report of its wheels, and arms by itself or by hand" do
    {pid, says} = base(reports: [:sonar], arm: :auto)
    assert_receive {:health, :drive, {{:offline, :silent}, _}}
    says.([:wheels])
    assert_receive {:health, :drive, {:online, _}}
    assert_receive {:arming, %{state: :armed}}
    Device.drive(pid, @ahead)
    assert_receive {:drive, {:drive, %Twist{linear: 0.3}}, ^pid}
  end

  test "wheels of which nothing is heard for 500 ms are stopped and disarmed; only a person arms them again" do
    {pid, says} = base(reports: [:wheels], arm: :manual)
    assert_receive {:health, :drive, {:online, _}}
    assert Device.arm(pid) == :ok
    Device.drive(pid, @ahead)
    assert_receive {:drive, {:drive, %Twist{linear: 0.3}}, ^pid}
    says.([])
    renew(pid, fn -> Device.arming(pid).state != :armed end)
    assert_receive {:arming, %{state: :disarmed, why: "its base reports nothing of its wheels"}}
    assert_receive {:health, :drive, {{:offline, :silent}, _}}
    assert {:error, "its base reports nothing of its wheels"} = Device.arm(pid)
    says.([:wheels])
    assert_receive {:health, :drive, {:online, _}}
    assert Device.arming(pid).state == :disarmed
    assert Device.arm(pid) == :ok
  end

  test "without sonar it stops and is disarmed after 2 s, and stays online" do
    {pid, says} = base(reports: [:wheels], arm: :manual, sonar: true)
    assert_receive {:health, :drive, {:online, _}}
    assert {:error, "its base has not reported its sonars yet"} = Device.arm(pid)
    says.([:wheels, :sonar])
    Hal.Lines.eventually(fn -> Device.arm(pid) == :ok end)
    says.([:wheels])
    since_ms = System.monotonic_time(:millisecond)
    renew(pid, fn -> Device.arming(pid).state != :armed end)
    assert System.monotonic_time(:millisecond) - since_ms > 1_500
    assert_receive {:arming, %{state: :disarmed, why: "its base reports nothing of its sonars"}}
    refute_received {:health, :drive, {{:offline, _reason}, _}}
  end

  # Drives as a gate does, until it is so; the last that the driver heard is a stop.
  defp renew(pid, done?, left \\ 1_000) do
    Device.drive(pid, @ahead)

    cond do
      done?.() ->
        assert last_told(nil) == @zero

      left == 0 ->
        flunk("it drives on")

      true ->
        receive(do: (:never -> :ok), after: (20 -> renew(pid, done?, left - 1)))
    end
  end

  defp last_told(last) do
    receive do
      {:drive, {:drive, twist}, _pid} -> last_told(twist)
    after
      0 -> last
    end
  end
end
