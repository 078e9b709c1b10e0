defmodule Robot.Safety.ArmingTest do
  @moduledoc "What was wished before wheels were disarmed is gone: arming starts nothing, whoever arms."
  use Robot.Case, async: true
  alias Hal.Device
  @moduletag :realtime
  @moduletag :capture_log

  @roll {Acts.Roll, twist: Twist.new(0.2, 0.0)}

  # Its mission tells the test when it is asked to hang, and then sets a goal late.
  defmodule Late do
    @behaviour Robot.Mission

    @impl Robot.Mission
    def init(_robot, options), do: {:ready, options, goal(options)}

    @impl Robot.Mission
    def handle({:command, :late}, options) do
      send(options[:test], {:late, self()})
      receive do: (:go_on -> :ok)
      {:ready, options, goal(options)}
    end

    def handle({:tick, _percept}, options), do: {:ready, options, goal(options)}
    def handle(_event, options), do: {:ready, options, []}

    defp goal(options), do: [{:goal, :roll, options[:goal]}]
  end

  defp armable(id, policy, options \\ []) do
    reports = :counters.new(1, [])
    what = fn -> if :counters.get(reports, 1) == 0, do: [:wheels, :sonar], else: [] end
    drive = {Hal.FakeDrive, [test: self(), device: :drive, reports: what] ++ options}
    id = robot(id, drive: drive, arm: policy, mission: {Late, test: self(), goal: @roll})
    online(id)
    if policy == :manual, do: :ok = Device.arm(drive(id))
    {id, reports}
  end

  defp drive(id), do: Names.whereis(id, :drive)
  defp arming(id), do: drive(id) && Device.arming(drive(id)).state

  # Each ends with a drive that is online again.
  defp disarm(:silence, id, reports) do
    :counters.put(reports, 1, 1)
    eventually(fn -> arming(id) == :disarmed end)
    refuses(id)
    :counters.put(reports, 1, 0)
  end

  defp disarm(:loss, id, _reports), do: anew(id, fn pid -> send(pid, {:fail, :eio}) end)
  defp disarm(:crash, id, _reports), do: anew(id, fn pid -> send(pid, :raise) end)
  defp disarm(:kill, id, _reports), do: anew(id, fn pid -> Process.exit(pid, :kill) end)

  defp disarm(:person, id, _reports) do
    :ok = Device.disarm(drive(id))
    refuses(id)
  end

  defp anew(id, function) do
    forget_openings()
    function.(drive(id))
    assert_receive {:drive, :init, _again}
    online(id)
  end

  defp forget_openings do
    receive do
      {:drive, :init, _pid} -> forget_openings()
    after
      0 -> :ok
    end
  end

  defp refuses(id) do
    refusals = [
      Pilot.start(id),
      Pilot.start(id, Late, test: self(), goal: @roll),
      Executive.goal(id, :roll, @roll)
    ]

    # By what it is refused first is a matter of moments.
    for refusal <- refusals do
      assert {:error, line} = refusal
      assert line =~ ~r/^its (wheels are disarmed|drive is offline|mission is being ended)/
    end

    # Past the door.
    Executive.obey(id, {:goal, :roll, @roll})
  end

  defp arm(id, :auto, cause) when cause != :person, do: eventually(fn -> arming(id) == :armed end)

  defp arm(id, _policy, _cause) do
    :ok = Device.acknowledge(drive(id))
    eventually(fn -> Device.arm(drive(id)) == :ok end)
  end

  defp still(id) do
    stands(300)
    assert {:idle, _data} = :sys.get_state(Names.whereis(id, :pilot))
    assert {:ok, nil, _at_ms} = Board.fetch(Board.find!(id), :goal, :infinity)
    # On a busy machine a wish of its executive may be late, which the gate limits, too.
    eventually(fn ->
      match?({:ok, %{limits: []}, _}, Board.fetch(Board.find!(id), :driving, 200))
    end)

    assert {:ok, %{twist: twist}, _} = Board.fetch(Board.find!(id), :driving, 200)
    assert Twist.zero?(twist)
  end

  test "armed wheels that have stood still, told to turn, take the next order" do
    {id, _reports} = armable(:stuck, :manual)
    board = Board.find!(id)
    Board.put(board, :drive, {:health, :drive}, {:offline, {:stands, :wheels}}, Board.now(board))
    assert Pilot.start(id, Late, test: self(), goal: @roll) == :ok
    Board.put(board, :drive, {:health, :drive}, {:offline, :eio}, Board.now(board))
    assert {:error, "its drive is offline" <> _} = Pilot.start(id)
  end

  for policy <- [:auto, :manual], cause <- [:silence, :loss, :crash, :kill, :person] do
    @tag policy: policy, cause: cause
    test "#{policy}: after #{cause} a mission, or a goal without one, is gone when it is armed again",
         %{policy: policy, cause: cause} do
      {id, reports} = armable(:"gone_#{policy}_#{cause}", policy)

      for start <- [&Pilot.start/1, &Executive.goal(&1, :roll, @roll)] do
        assert start.(id) == :ok
        rolls()
        disarm(cause, id, reports)
        arm(id, policy, cause)
        still(id)
      end

      assert Pilot.start(id) == :ok
      rolls()
    end
  end

  for policy <- [:auto, :manual] do
    @tag policy: policy
    test "#{policy}: nor does a mission start that hung meanwhile, and sets its goal after the arming",
         %{policy: policy} do
      {id, reports} = armable(:"late_#{policy}", policy)
      :ok = Pilot.start(id)
      rolls()
      Pilot.hear(id, {:command, :late})
      assert_receive {:late, pilot}
      :counters.put(reports, 1, 1)
      eventually(fn -> arming(id) == :disarmed end)
      :counters.put(reports, 1, 0)
      arm(id, policy, :silence)
      assert {:error, "its mission is being ended"} = Executive.goal(id, :roll, @roll)
      stands(200)
      send(pilot, :go_on)
      still(id)
    end
  end

  test "auto: what comes before it has armed itself for the first time is refused" do
    test = self()

    open = fn ->
      send(test, {:opens, self()})
      receive(do: (:open -> :ok))
    end

    drive = {Hal.FakeDrive, test: test, device: :drive, open: open}
    id = robot(:gone_first, drive: drive, mission: {Late, test: test, goal: @roll})
    assert_receive {:opens, pid}
    assert Pilot.start(id) == {:error, "its drive is not open yet"}
    assert Executive.goal(id, :roll, @roll) == {:error, "its drive is not open yet"}
    Executive.obey(id, {:goal, :roll, @roll})
    send(pid, :open)
    online(id)
    still(id)
  end

  test "a drive's process that slept itself does not take its base for silent" do
    {id, _reports} = armable(:gone_slept, :auto)
    :ok = Pilot.start(id)
    rolls()
    listen(id, [:hal, :device, :arming])
    :ok = :sys.suspend(drive(id))
    receive(do: (:never -> :ok), after: (900 -> :ok))
    :ok = :sys.resume(drive(id))
    rolls()
    refute_received {[:hal, :device, :arming], _}
    assert arming(id) == :armed
  end
end
