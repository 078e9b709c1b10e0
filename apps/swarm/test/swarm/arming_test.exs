defmodule Swarm.ArmingTest do
  use Swarm.Case, async: false
  @moduletag :realtime
  @moduletag :capture_log
  alias Swarm.Status

  defp line(id), do: inspect(Swarm.status(id))
  defp shows(id, text), do: eventually(fn -> line(id) =~ text end)

  # Waits until the robot's own wheels are told this.
  defp told(id, wanted?) do
    pid = Names.whereis(id, :drive)
    assert_receive {:drive, {:drive, %Twist{linear: v}}, ^pid} when is_float(v)
    wanted?.(v) || told(id, wanted?)
  end

  # Meanwhile it may be told to stand at any time, but not to roll.
  defp stands_while(id, function) do
    pid = Names.whereis(id, :drive)
    forget(pid)
    result = function.()

    receive do
      {:drive, {:drive, %Twist{linear: v}}, ^pid} when v != 0 -> flunk("rolls at #{v} m/s")
    after
      0 -> result
    end
  end

  defp forget(pid) do
    receive do
      {:drive, {:drive, _}, ^pid} -> forget(pid)
    after
      0 -> :ok
    end
  end

  test "a robot that comes up disarmed stands and says why, until a person arms it" do
    id = robot(:arm_hand, arm: :manual)
    standing([id])
    shows(id, "DISARMED")

    refusal = {:error, "arm_hand: its wheels are disarmed; arm it first"}

    # An order is for now: none waits until the robot is armed.
    stands_while(id, fn ->
      for text <- ~w(move:0.2:0 goto:1:1 follow:1:1:0 lead start),
          do: assert({text, Swarm.tell(id, text)} == {text, refusal})

      assert Swarm.start(robots: [id]) == refusal
      assert order(fn -> Swarm.arm(id) end) == :ok
      assert %Status{state: :idle} = Swarm.status(id)
      eventually(fn -> Swarm.status(id).limits == [] end)
    end)

    assert order(fn -> Swarm.tell(id, "move:0.2:0") end) == :ok
    told(id, &(&1 > 0))
    refute line(id) =~ "DISARMED"

    assert order(fn -> Swarm.disarm(id) end) == :ok
    shows(id, "DISARMED")

    # Its order has ended: armed again, it stands.
    assert order(fn -> Swarm.tell("arm_hand", "Arm") end) == :ok
    eventually(fn -> match?(%Status{arming: :armed, state: :idle}, Swarm.status(id)) end)
    assert order(fn -> Swarm.tell(id, "disarm") end) == :ok
    eventually(fn -> match?(%Status{arming: :disarmed}, Swarm.status(id)) end)
  end

  test "disarming stops wheels in motion" do
    id = robot(:arm_stop)
    standing([id])
    assert order(fn -> Swarm.tell(id, "move:0.2:0") end) == :ok
    told(id, &(&1 > 0.1))
    assert order(fn -> Swarm.disarm() end) == :ok
    told(id, &(&1 == 0))
    shows(id, "DISARMED")
    stands_while(id, fn -> eventually(fn -> Swarm.status(id).limits == [:disarmed] end) end)
  end

  test "a base that lacks something says what, in the answer to arm and in its status" do
    missing = fn -> {:error, "conversion distance is missing"} end
    drive = {Hal.FakeDrive, test: self(), device: :drive, ready: missing}
    id = robot(:arm_lacks, drive: drive)
    assert Swarm.arm(id) == {:error, "arm_lacks: conversion distance is missing"}
    shows(id, "DISARMED (conversion distance is missing)")
  end

  test "a line lost in motion stays an error, even on a new line, until a person acknowledges" do
    id = robot(:arm_lost, arm: :manual)
    standing([id])
    assert order(fn -> Swarm.arm(id) end) == :ok
    assert order(fn -> Swarm.tell(id, "move:0.2:0") end) == :ok
    told(id, &(&1 > 0))
    send(Names.whereis(id, :drive), {:fail, :unplugged})
    shows(id, "LINE LOST (acknowledge it)")
    eventually(fn -> Swarm.status(id).health[:drive] == :online end)
    assert {:error, line} = Swarm.arm(id)
    assert line =~ "arm_lost: the line was lost (:unplugged) while the wheels turned"

    stands_while(id, fn ->
      eventually(fn -> Swarm.status(id).limits == [:disarmed] end)
      assert order(fn -> Swarm.acknowledge(id) end) == :ok
      shows(id, "DISARMED")
    end)

    # Its order had ended with the line.
    stands_while(id, fn ->
      assert order(fn -> Swarm.arm(id) end) == :ok
      assert %Status{state: :idle} = Swarm.status(id)
      eventually(fn -> match?(%Status{limits: [], by: :rest}, Swarm.status(id)) end)
    end)

    assert order(fn -> Swarm.tell(id, "move:0.2:0") end) == :ok
    told(id, &(&1 > 0))
  end

  test "any stop that does not reach the wheels says so" do
    {:ok, line} = Agent.start_link(fn -> :ok end)
    drive = [test: self(), device: :drive, open: fn -> Agent.get(line, & &1) end]
    id = robot(:arm_unheard, arm: :manual, drive: {Hal.FakeDrive, drive})
    standing([id])
    assert order(fn -> Swarm.arm(id) end) == :ok
    assert order(fn -> Swarm.tell(id, "move:0.2:0") end) == :ok
    told(id, &(&1 > 0))
    Agent.update(line, fn _ -> {:error, :enoent} end)
    send(Names.whereis(id, :drive), {:fail, :unplugged})
    shows(id, "LINE LOST (acknowledge it)")

    for stop <- [&Swarm.stop/1, &Swarm.disarm/1, fn _all -> Swarm.estop() end] do
      assert {:error, told} = stop.(id)

      assert told =~
               "arm_unheard: its line was lost (:unplugged) while the wheels turned, and is not"

      assert told =~ "use the robot's own emergency stop"
    end

    assert Board.latched?(Board.find!(id))
    assert order(fn -> Swarm.reset() end) == :ok
    # A line that is opened again starts with a stop.
    Agent.update(line, fn _ -> :ok end)
    eventually(fn -> Swarm.status(id).health[:drive] == :online end)
    shows(id, "LINE LOST (acknowledge it)")
    assert order(fn -> Swarm.stop(id) end) == :ok
    assert order(fn -> Swarm.disarm(id) end) == :ok
  end

  test "while the line is lost, and while it is away, the reason is the answer" do
    {:ok, line} = Agent.start_link(fn -> :ok end)
    drive = [test: self(), device: :drive, open: fn -> Agent.get(line, & &1) end]
    id = robot(:arm_away, arm: :manual, drive: {Hal.FakeDrive, drive})
    standing([id])
    assert order(fn -> Swarm.arm(id) end) == :ok
    # It stands, so nobody needs to acknowledge.
    Agent.update(line, fn _ -> {:error, :enoent} end)
    send(Names.whereis(id, :drive), {:fail, :unplugged})
    eventually(fn -> match?({:offline, _}, Swarm.status(id).health[:drive]) end)
    assert {:error, "arm_away: its drive is offline (:" <> _} = Swarm.goto(id, {1, 1})
    assert {:error, "arm_away: its drive is offline (:" <> _} = Swarm.start(robots: [id])
    # Stops and questions are always accepted.
    assert order(fn -> Swarm.stop(id) end) == :ok
    assert order(fn -> Swarm.disarm(id) end) == :ok
    assert {:ok, _said} = Swarm.tell(id, "ping")
    Agent.update(line, fn _ -> :ok end)
    eventually(fn -> Swarm.status(id).health[:drive] == :online end)
    assert {:error, "arm_away: its wheels are disarmed" <> _} = Swarm.goto(id, {1, 1})

    assert order(fn -> Swarm.arm(id) end) == :ok
    assert order(fn -> Swarm.tell(id, "move:0.2:0") end) == :ok
    told(id, &(&1 > 0))
    send(Names.whereis(id, :drive), {:fail, :unplugged})
    shows(id, "LINE LOST")
    assert {:error, "arm_away: its line was lost (:unplugged)" <> _} = Swarm.goto(id, {1, 1})
  end

  test "of a group, the robots that are ready start, and the others are named" do
    ready = robot(:arm_ready)
    held = robot(:arm_held, arm: :manual)
    standing([ready, held])
    refusal = {:error, "arm_held: its wheels are disarmed; arm it first"}
    assert Swarm.start(robots: [held, ready]) == refusal
    eventually(fn -> Swarm.status(ready).state not in [:idle, nil] end)
    assert %Status{state: :idle} = Swarm.status(held)
  end

  test "wheels that are disarmed past the e-stop process end the mission, or a goal without a mission" do
    id = robot(:arm_past, arm: :manual)
    standing([id])
    drive = Names.whereis(id, :drive)
    assert order(fn -> Swarm.arm(id) end) == :ok
    assert order(fn -> Swarm.tell(id, "move:0.2:0") end) == :ok
    told(id, &(&1 > 0))
    assert Hal.Device.disarm(drive) == :ok
    eventually(fn -> match?(%Status{state: :idle, by: :rest}, Swarm.status(id)) end)
    stands_while(id, fn -> assert Swarm.arm(id) == :ok end)
    roll = {Robot.Acts.Roll, twist: Twist.new(0.2, 0.0)}
    Robot.Control.Executive.goal(id, :roll, roll)
    told(id, &(&1 > 0))
    assert Hal.Device.disarm(drive) == :ok
    eventually(fn -> match?(%Status{by: :rest}, Swarm.status(id)) end)

    stands_while(id, fn ->
      assert order(fn -> Swarm.arm(id) end) == :ok
      eventually(fn -> Swarm.status(id).limits == [] end)
    end)
  end

  test "in a dry run every order is accepted: nothing moves" do
    id = robot(:arm_dry, arm: :manual, dry_run: true)
    standing([id])
    assert order(fn -> Swarm.tell(id, "move:0.2:0") end) == :ok
    eventually(fn -> Swarm.status(id).by == :move end)
  end

  test "the emergency stop is stronger: the robot refuses to be armed, and arming does not release it" do
    id = robot(:arm_estop, arm: :manual)
    assert order(fn -> Swarm.arm(id) end) == :ok
    assert order(fn -> Swarm.estop() end) == :ok
    assert {:error, line} = Swarm.arm(id)
    assert line == "arm_estop is held by the emergency stop; reset it first"
    assert order(fn -> Swarm.acknowledge(id) end) == :ok
    assert order(fn -> Swarm.disarm(id) end) == :ok
    assert order(fn -> Swarm.reset() end) == :ok
    # The reset does not arm.
    shows(id, "DISARMED")
    assert order(fn -> Swarm.arm(id) end) == :ok
  end

  test "a robot is disarmed even if its comms process hangs, and by an order of any age; armed only in time" do
    id = robot(:arm_age)
    old = {1, 1}

    for {request, answer} <- [disarm: :ok, arm: :too_late, acknowledge: :too_late] do
      ref = :erlang.alias([:reply])
      role = if request == :disarm, do: :estop, else: :comms
      GenServer.cast(Names.whereis(id, role), {:command, request, ref, old})
      assert_receive {^ref, got}
      if answer == :ok, do: assert(got == :ok), else: assert(elem(got, 1) =~ "too late")
    end

    shows(id, "DISARMED")
    assert order(fn -> Swarm.arm(id) end) == :ok
    comms = Names.whereis(id, :comms)
    :ok = :sys.suspend(comms)
    assert order(fn -> Swarm.disarm(id) end) == :ok
    eventually(fn -> Hal.Device.arming(Names.whereis(id, :drive)).state == :disarmed end)
    :ok = :sys.resume(comms)
  end

  test "arming a robot whose drive hangs is answered in time" do
    id = robot(:arm_hangs, arm: :manual)
    drive = Names.whereis(id, :drive)
    :ok = :sys.suspend(drive)
    assert {:error, line} = Swarm.arm(id)
    assert line =~ "arm_hangs" and line =~ "does not answer"
    :ok = :sys.resume(drive)
  end

  test "senseless robots and orders are an error of one line" do
    assert {:error, "no robot :nobody" <> _} = Swarm.arm(:nobody)
    assert {:error, _} = Swarm.disarm([:nobody])
    assert {:error, _} = Swarm.acknowledge({1, 2})
    id = robot(:arm_sense)
    assert {:error, "arm: expected arm, got also \"now\"" <> _} = Swarm.tell(id, "arm:now")
  end
end
