defmodule Swarm.OrdersTest do
  @moduledoc "The answer to an order says what became of it."
  use Swarm.Case, async: false
  @moduletag :realtime
  @moduletag :capture_log
  import ExUnit.CaptureLog
  alias Robot.Acts
  alias Robot.Control.Executive

  @roll {Acts.Roll, twist: Twist.new(0.2, 0.0)}

  defp state(id) do
    {:ok, %{state: state}, _at_ms} = Board.fetch(Board.find!(id), :mission, :infinity)
    state
  end

  defp rolls(id) do
    drive = Names.whereis(id, :drive)
    assert_receive {:drive, {:drive, %Twist{linear: v}}, ^drive} when v > 0
  end

  # From now on, for this long, its wheels get no command but to stand.
  defp stands(id, ms \\ 300) do
    drive = Names.whereis(id, :drive)
    :sys.get_state(drive)
    forget(drive)

    receive do
      {:drive, {:drive, %Twist{linear: v}}, ^drive} when v != 0 -> flunk("rolls at #{v} m/s")
    after
      ms -> :ok
    end
  end

  defp forget(drive) do
    receive do
      {:drive, {:drive, _twist}, ^drive} -> forget(drive)
    after
      0 -> :ok
    end
  end

  defp queued(pid) do
    {:messages, messages} = Process.info(pid, :messages)
    messages
  end

  # A mission that ignores all commands, and sets its goal again at every tick.
  defmodule Deaf do
    @behaviour Robot.Mission

    @impl Robot.Mission
    def init(_robot, goal), do: {:rolling, goal, []}

    @impl Robot.Mission
    def handle({:command, :hang}, goal) do
      receive do
        :never -> {:rolling, goal, []}
      end
    end

    def handle({:command, {:late, test}}, goal) do
      send(test, {:late, self()})
      receive(do: (:go_on -> :ok))
      handle(:late, goal)
    end

    def handle(_event, goal), do: {:rolling, goal, [{:goal, :roll, goal[:goal]}]}
  end

  describe "a message that is only for robots" do
    test "is refused with an error, and nobody leaves a mission for it" do
      [id, other] = for id <- [:orders_talk, :orders_other], do: robot(id)
      standing([id, other])
      assert order(fn -> Swarm.start(robots: [id, other]) end) == :ok
      before = state(id)

      for text <- ~w(subscribe:orders_other unsubscribe:orders_other position:1:2:3
                     blob:1:2:3:0.1:1) do
        assert {:error, line} = Swarm.tell(id, text)
        assert line =~ "#{hd(String.split(text, ":"))} is for"
        # Even if it is sent past the public interface.
        {:ok, command} = Robot.Command.parse(text, [:orders_other])
        assert {:error, ^line} = Swarm.ask(id, command)
        assert {Missions.Landmark, _phase} = state(id)
      end

      assert elem(before, 0) == elem(state(id), 0)
    end

    test "but ping is a question, and is answered: who, since when, in what state" do
      [id, other] = for id <- [:orders_ping, :orders_pong], do: robot(id)
      standing([id, other])
      assert {:ok, line} = Swarm.tell(id, "ping")
      assert line =~ ~r/^orders_ping on #{node()}, up for \d+ s, idle for \d+ s$/
      assert order(fn -> Swarm.goto(id, {1, 1}) end) == :ok
      assert {:ok, line} = Swarm.tell(id, "Ping")
      assert line =~ ~r/, up for \d+ s, goto for \d+ s$/
      assert state(id) == {Robot.Mission.Manual, :goto}

      assert {:ok, both} = Swarm.tell([id, other], "ping")
      assert both =~ ~r/^orders_ping on [^;]+; orders_pong on [^;]+$/
      :ok = :sys.suspend(Names.whereis(other, :comms))
      assert {:error, line} = Swarm.tell([id, other], "ping")
      assert line =~ ~r/^orders_pong does not answer; orders_ping on /
      :ok = :sys.resume(Names.whereis(other, :comms))
      assert order(fn -> Swarm.estop() end) == :ok
      held = ~r/^orders_ping .*, idle for \d+ s, E-STOP$/
      eventually(fn -> elem(Swarm.tell(id, "ping"), 1) =~ held end)
      assert order(fn -> Swarm.reset() end) == :ok
    end
  end

  test "a reset releases a robot once its mission has ended, but not against a new stop" do
    id = robot(:orders_reset)
    standing([id])
    :ok = Pilot.start(id, Deaf, goal: @roll)
    rolls(id)
    pilot = Names.whereis(id, :pilot)
    :ok = :sys.suspend(pilot)
    assert Swarm.ask(id, :estop) == :ok
    # Its mission has not ended yet.
    assert Swarm.ask(id, :reset) == nil
    :ok = :sys.resume(pilot)
    eventually(fn -> state(id) == :idle end)
    # The reset was not answered, so the robot is still held.
    :sys.get_state(Names.whereis(id, :gate))
    :sys.get_state(Names.whereis(id, :estop))
    assert Board.latched?(Board.find!(id))

    # A person presses again while the reset is under way.
    :ok = :sys.suspend(pilot)
    ref = :erlang.alias([:reply])
    asked = {:asked, System.monotonic_time(:microsecond)}
    GenServer.cast(Names.whereis(id, :estop), {:command, :reset, ref, asked})
    assert Swarm.ask(id, :estop) == :ok
    :ok = :sys.resume(pilot)
    assert_receive {^ref, {:error, "orders_reset was stopped again meanwhile" <> _}}
    assert Board.latched?(Board.find!(id))
    assert Swarm.ask(id, :reset) == :ok
    refute Board.latched?(Board.find!(id))
    assert state(id) == :idle
    stands(id)
  end

  test "a reset of robots that are not held stops nobody" do
    id = robot(:orders_free)
    standing([id])
    assert order(fn -> Swarm.tell(id, "move:0.2:0") end) == :ok
    rolls(id)
    assert Swarm.ask(id, :reset) == :ok
    assert state(id) == {Robot.Mission.Manual, :move}
  end

  test "a start right after a stop that is still on its way starts the mission again" do
    id = robot(:orders_late)
    standing([id])
    assert order(fn -> Swarm.start(robots: [id], formation: :wedge) end) == :ok
    pilot = Names.whereis(id, :pilot)
    :ok = :sys.suspend(pilot)
    Pilot.halt(id)
    # The board still shows the mission.
    answer = Task.async(fn -> Swarm.ask(id, :start) end)

    asked? = &match?({:"$gen_cast", {:deliver, _delivery, {:command, :start}}}, &1)
    eventually(fn -> Enum.any?(queued(pilot), asked?) end)

    :ok = :sys.resume(pilot)
    assert Task.await(answer) == :ok
    assert {Missions.Landmark, _phase} = state(id)
    {_phase, %{state: %{runner: %{mission: mission}}}} = :sys.get_state(pilot)
    assert {:wedge, _spacing} = mission.formation
  end

  test "an order is :ok when the robot's executive has it; one that hangs is reported, and recovers" do
    id = robot(:orders_mind)
    standing([id])
    :ok = listen(id, [:robot, :executive, :hung])
    before = Names.whereis(id, :pilot)
    assert Executive.goal(id, :hang, {Acts.Hang, test: self()}) == :ok
    assert_receive {:hangs, _executive}
    assert {:error, "orders_mind does not answer"} = Swarm.goto(id, {1, 1})
    eventually(fn -> inspect(Swarm.status(id)) =~ ", HANGS in Robot.Acts.Hang," end)
    assert_receive {[:robot, :executive, :hung], %{behaviour: Acts.Hang}}, 10_000

    eventually(fn ->
      pid = Names.whereis(id, :comms)

      pid != nil and Names.whereis(id, :pilot) not in [nil, before] and
        Directory.whereis(id) == pid
    end)

    status = Swarm.status(id)
    assert %{state: :idle, hung: {:hung, "Robot.Acts.Hang", ago_ms}} = status
    assert ago_ms < 60_000
    assert inspect(status) =~ ~r/, HUNG in Robot\.Acts\.Hang \d+ s ago, started again,/
    # Nothing is left of the order that was not answered.
    stands(id)
    assert order(fn -> Swarm.goto(id, {1, 1}) end) == :ok
  end

  test "a mission that hangs is reported in status, row and log; orders are refused with it, and it recovers" do
    id = robot(:orders_hung, mission: {Acts.Mission, test: self()})
    standing([id])
    :ok = listen(id, [:robot, :pilot, :hung])
    :ok = Pilot.start(id)
    before = Names.whereis(id, :pilot)
    where = "its mission Robot.Acts.Mission"

    log =
      capture_log(fn ->
        Pilot.hear(id, {:command, :hang})
        assert_receive {:mission, {:hangs, ^before}}
        eventually(fn -> inspect(Swarm.status(id)) =~ ", HANGS in #{where}," end)
        line = "orders_hung hangs in #{where}; it restarts by itself"
        assert Swarm.goto(id, {1, 1}) == {:error, line}
        # Its gate stands, but nobody can say that no older order follows.
        assert Swarm.stop(id) == {:error, "orders_hung does not answer"}

        told = fn ->
          with {:ok, row, age_ms} <- Swarm.Blackboard.get(id, :status, :infinity),
               {:ok, %{hung: {:silent, ^where, _ago_ms}}} <-
                 Swarm.Status.Row.decode(id, row, age_ms),
               do: true,
               else: (_other -> false)
        end

        eventually(told)
        assert_receive {[:robot, :pilot, :hung], %{mission: Acts.Mission}}, 10_000
        eventually(fn -> Names.whereis(id, :pilot) not in [nil, before] end)
        eventually(fn -> Directory.whereis(id) == Names.whereis(id, :comms) end)
      end)

    assert log =~ "orders_hung hangs in #{where}\n"
    assert log =~ "orders_hung hung in #{where} for 2 s: started again, idle"
    status = Swarm.status(id)
    assert %{state: :idle, hung: {:hung, ^where, _ago_ms}} = status
    stands(id)
    assert order(fn -> Swarm.goto(id, {1, 1}) end) == :ok
  end

  describe "stop" do
    test "ends a mission that ignores it, however it is sent" do
      id = robot(:orders_deaf)
      standing([id])

      for stop <- [
            fn -> Swarm.stop() end,
            fn -> Swarm.stop(id) end,
            fn -> Swarm.tell(:all, "stop") end,
            fn -> Swarm.tell([id], " STOP ") end,
            fn -> Swarm.disarm(id) end
          ] do
        assert order(fn -> Swarm.arm(id) end) == :ok
        :ok = Pilot.start(id, Deaf, goal: @roll)
        rolls(id)
        assert stop.() == :ok
        assert state(id) == :idle
        stands(id)
      end
    end

    test "ends a goal that was not set by a mission" do
      id = robot(:orders_goal)
      standing([id])
      Executive.goal(id, :roll, @roll)
      rolls(id)
      assert order(fn -> Swarm.stop(id) end) == :ok
      stands(id)
    end

    test "is not :ok if the mission hangs; the robot stands all the same" do
      id = robot(:orders_hangs)
      standing([id])
      :ok = Pilot.start(id, Deaf, goal: @roll)
      rolls(id)
      GenServer.cast(Names.via(id, :pilot), {:command, :hang})
      assert Swarm.stop(id) == {:error, "orders_hangs does not answer"}
      stands(id)
    end

    test "is not undone by a mission that was late, and then hangs" do
      id = robot(:orders_late)
      standing([id])
      :ok = Pilot.start(id, Deaf, goal: @roll)
      rolls(id)
      for order <- [{:late, self()}, :hang], do: Pilot.hear(id, {:command, order})
      assert_receive {:late, pilot}
      assert Swarm.stop(id) == {:error, "orders_late does not answer"}
      send(pilot, :go_on)
      stands(id, 500)
      # The pilot that takes its place lets the robot drive again.
      eventually(fn -> Names.whereis(id, :pilot) not in [nil, pilot] end)
      eventually(fn -> Pilot.start(id, Deaf, goal: @roll) == :ok end)
      rolls(id)
    end

    test "is not :ok if the drive does not hear that it is disarmed" do
      id = robot(:orders_drive)
      drive = Names.whereis(id, :drive)
      :ok = :sys.suspend(drive)
      assert Swarm.disarm(id) == {:error, "orders_drive does not answer"}
      :ok = :sys.resume(drive)
    end

    test "keeps what people asked of the group's mission" do
      id = robot(:orders_shape)
      standing([id])
      assert order(fn -> Swarm.start(robots: [id], formation: :line) end) == :ok
      assert order(fn -> Swarm.formation(:wedge, spacing: 1.2) end) == :ok
      assert order(fn -> Swarm.stop(id) end) == :ok
      assert order(fn -> Swarm.start(robots: [id]) end) == :ok

      {_phase, %{state: %{runner: %{mission: mission}}}} =
        :sys.get_state(Names.whereis(id, :pilot))

      assert mission.formation == {:wedge, 1.2}
    end
  end
end
