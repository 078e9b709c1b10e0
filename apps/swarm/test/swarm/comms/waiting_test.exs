defmodule Swarm.Comms.WaitingTest do
  @moduledoc """
  Whichever process is slow or dead, the robot's heartbeats go on, and people get an error of one
  line.
  """
  use Swarm.Case, async: false
  @moduletag :realtime
  @moduletag :capture_log

  @doc false
  def carry(test, from, _ids, message), do: send(test, {:carried, from, message})

  # If a comms process waits for another process, its heartbeats come later, or never.
  defp beats(id, number) do
    forget(id)

    for _ <- 1..number,
        do: assert_receive({:carried, ^id, %Message{kind: :heartbeat}})
  end

  defp forget(id) do
    receive do
      {:carried, ^id, _message} -> forget(id)
    after
      0 -> :ok
    end
  end

  # The robot says after 0.4 s that its drive does not answer, and who asks waits for 0.5 s: on a busy
  # machine it asks again.
  defp answer(ask), do: ask.() || answer(ask)

  defp talking(id, options \\ []) do
    robot(id, [comms: [transport: {__MODULE__, :carry, [self()]}]] ++ options)
    standing([id])
    id
  end

  defp state(id) do
    {:ok, %{state: state}, _at_ms} = Board.fetch(Board.find!(id), :mission, :infinity)
    state
  end

  test "a pilot that hangs for seconds delays no heartbeat, and later no order from that time moves the robot" do
    id = talking(:waiting_pilot)
    pilot = Names.whereis(id, :pilot)
    comms = Names.whereis(id, :comms)
    :ok = :sys.suspend(pilot)
    {:ok, many} = Task.Supervisor.start_link()

    for order <- [:start, {:start, []}, {:goto, 1.0, 1.0, nil}, {:formation, :wedge, 1.0}] do
      asked = Task.Supervisor.async(many, fn -> Swarm.ask(id, order) end)
      beats(id, 4)
      assert {order, Task.await(asked)} == {order, nil}
    end

    assert Swarm.goto(id, {1, 1}) == {:error, "waiting_pilot does not answer"}
    assert {:ok, line} = Swarm.tell(id, "ping")
    assert line =~ "idle"
    assert [comms, pilot] == [Names.whereis(id, :comms), Names.whereis(id, :pilot)]
    :ok = :sys.resume(pilot)
    assert {:idle, _data} = :sys.get_state(pilot)
    assert Swarm.goto(id, {1, 1}) == :ok
    assert state(id) == {Robot.Mission.Manual, :goto}
  end

  test "a drive that hangs delays no heartbeat, and is not armed when it goes on" do
    id = talking(:waiting_drive, arm: :manual)
    drive = Names.whereis(id, :drive)
    :ok = :sys.suspend(drive)

    for order <- [:arm, :acknowledge] do
      asked = Task.async(fn -> answer(fn -> Swarm.ask(id, order) end) end)
      # The drive does not report its wheels either; the age of its reports is not tested here.
      beats(id, 2)
      assert Task.await(asked, 30_000) == {:error, "waiting_drive: the drive does not answer"}
    end

    :ok = :sys.resume(drive)
    assert %{state: :disarmed} = Hal.Device.arming(drive)
    eventually(fn -> Swarm.arm(id) == :ok end)
  end

  test "a dead pilot delays no heartbeat" do
    id = talking(:waiting_dead)
    # No supervisor starts another one.
    supervisor = Names.whereis(id, :robot)
    :ok = :sys.suspend(supervisor)
    kill(id, :pilot)
    asked = Task.async(fn -> Swarm.goto(id, {1, 1}) end)
    beats(id, 4)
    assert Task.await(asked) == {:error, "waiting_dead does not answer"}
    :ok = :sys.resume(supervisor)
    eventually(fn -> Names.whereis(id, :pilot) != nil and Directory.whereis(id) != nil end)
    eventually(fn -> Swarm.goto(id, {1, 1}) == :ok end)
  end

  test "an order that waited for a delayed comms process begins nothing after a stop, or once nobody waits" do
    id = talking(:waiting_comms)
    comms = Names.whereis(id, :comms)
    :ok = :sys.suspend(comms)
    asked = Task.async(fn -> Swarm.tell(id, "move:0.2:0") end)
    eventually(fn -> Process.info(comms, :message_queue_len) != {:message_queue_len, 0} end)
    assert Swarm.stop(id) == :ok
    :ok = :sys.resume(comms)
    assert {:error, line} = Task.await(asked)
    assert line =~ "was stopped after this command was sent"
    assert state(id) == :idle

    :ok = :sys.suspend(comms)
    assert Swarm.tell(id, "move:0.2:0") == {:error, "waiting_comms does not answer"}
    :ok = :sys.resume(comms)
    assert {:ok, _line} = Swarm.tell(id, "ping")
    _handled = :sys.get_state(Names.whereis(id, :pilot))
    assert state(id) == :idle
    assert Swarm.tell(id, "move:0.2:0") == :ok
  end

  test "a delayed order to arm does not undo a disarm" do
    id = talking(:waiting_arm, arm: :manual)
    comms = Names.whereis(id, :comms)
    drive = Names.whereis(id, :drive)
    :ok = :sys.suspend(comms)
    asked = Task.async(fn -> Swarm.arm(id) end)
    eventually(fn -> Process.info(comms, :message_queue_len) != {:message_queue_len, 0} end)
    assert Swarm.disarm(id) == :ok
    :ok = :sys.resume(comms)
    assert {:error, _line} = Task.await(asked)
    assert %{state: :disarmed} = Hal.Device.arming(drive)
  end

  test "an order that arrives at the pilot after an emergency stop is refused there" do
    id = talking(:waiting_held)
    pilot = Names.whereis(id, :pilot)
    :ok = :sys.suspend(pilot)
    asked = Task.async(fn -> Swarm.goto(id, {1, 1}) end)
    waits? = &match?({:"$gen_cast", {:deliver, _delivery, {:command, {:goto, _, _, _}}}}, &1)

    eventually(fn ->
      {:messages, messages} = Process.info(pilot, :messages)
      Enum.any?(messages, waits?)
    end)

    assert Swarm.ask(id, :estop) == :ok
    :ok = :sys.resume(pilot)
    held = {:error, "waiting_held is held by the emergency stop; reset it first"}
    assert Task.await(asked) == held
    assert state(id) == :idle
    assert Swarm.goto(id, {1, 1}) == held
    assert Swarm.ask(id, :reset) == :ok
    assert Swarm.goto(id, {1, 1}) == :ok
  end

  test "starting a mission that does not exist is an error, and nothing crashes" do
    id = talking(:waiting_none, mission: {No.Such.Mission, []})
    comms = Names.whereis(id, :comms)
    assert Swarm.ask(id, :start) == {:error, "waiting_none has no such mission"}
    assert Names.whereis(id, :comms) == comms
  end
end
