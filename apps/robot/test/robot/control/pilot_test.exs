defmodule Robot.Control.PilotTest do
  use Robot.Case, async: true
  @moduletag :realtime
  @moduletag :capture_log

  defp flown(id, options \\ []) do
    robot(id, Keyword.put(options, :mission, {Acts.Mission, test: self()}))
    :ok = Pilot.start(id)
    assert_receive {:mission, {:init, ^id}}
    id
  end

  test "is idle until told, and says so" do
    id = robot(:pilot1)
    assert Pilot.command(id, :anything) == {:error, :idle}
    assert Pilot.start(id) == {:error, :no_mission}
    assert Pilot.start(id, No.Such.Mission, []) == {:error, :no_mission}
    assert {:idle, _data} = :sys.get_state(Names.whereis(id, :pilot))
    assert Pilot.start(id, Acts.Mission, test: self()) == :ok
    assert {{Acts.Mission, :ready}, _data} = :sys.get_state(Names.whereis(id, :pilot))
    assert Pilot.stop(id) == :ok
    assert {:idle, _data} = :sys.get_state(Names.whereis(id, :pilot))
  end

  test "a start with options that its mission does not take is refused" do
    id = robot(:pilot21)

    assert Pilot.start(id, Acts.Mission, [1 | 2]) ==
             {:error, "expected options [key: value], got [1 | 2]"}

    assert Pilot.start(id, GenServer, []) == {:error, :no_mission}
    assert {:idle, _data} = :sys.get_state(Names.whereis(id, :pilot))
  end

  test "a mission that gives an order that is none is ended, and the executive goes on" do
    id = flown(:pilot22)
    executive = Names.whereis(id, :executive)

    pilot = Names.whereis(id, :pilot)
    ref = Process.monitor(pilot)
    Pilot.hear(id, {:command, {:do, :ready, [{:goal, 1, {No.Such.Behaviour, []}}]}})
    assert_receive {:DOWN, ^ref, :process, ^pilot, _reason}, 5_000
    _handled = :sys.get_state(executive)
    assert Names.whereis(id, :executive) == executive
  end

  test "hands ticks, outcomes, messages and commands to the mission" do
    id = flown(:pilot2)
    assert_receive {:mission, {:tick, %Robot.Percept{robot: ^id}}}
    Pilot.hear(id, {:message, %{hello: 1}})
    assert_receive {:mission, {:message, %{hello: 1}}}
    assert Pilot.command(id, :go) == :ok
    assert_receive {:mission, {:command, :go}}
    goal = {:goal, :soon, {Acts.Roll, outcome: 7, twist: Twist.zero()}}
    assert Pilot.command(id, {:do, :ready, [goal]}) == :ok
    assert_receive {:mission, {:outcome, :soon, 7}}
    assert_receive {:mission, {:tick, _}}
  end

  test "a percept that has waited for more than a second, as in a frozen robot, is not handled" do
    id = flown(:pilot20, pace: :manual)
    now = System.monotonic_time(:millisecond)

    for at_ms <- [now - 2_000, now - 1_050, now],
        do:
          Pilot.hear(
            id,
            {:tick, %Robot.Percept{robot: id, at_ms: at_ms, profile: Hal.Profile.magellan()}}
          )

    # One after the other, so that the last one does not replace the others.
    assert_receive {:mission, {:tick, %{at_ms: ^now}}}
    old = %Robot.Percept{robot: id, at_ms: now - 1_050, profile: Hal.Profile.magellan()}
    Pilot.hear(id, {:tick, old})
    Pilot.hear(id, {:message, %{after: :tick}})
    assert_receive {:mission, {:message, %{after: :tick}}}
    refute_received {:mission, {:tick, _}}
    board = Board.find!(id)
    assert {:ok, %{ticked_ms: ^now}, _at_ms} = Board.fetch(board, :mission, :infinity)
  end

  test "carries out every kind of effect" do
    ptz = {Hal.FakePtz, test: self(), device: :ptz}

    id = flown(:pilot3, ptz: ptz)
    # Its comms hands on what it says.
    :ok = Names.register(id, :comms, nil)
    listen(id, [:robot, :stage])
    listen(id, [:robot, :pilot, :phase])

    effects = [
      {:goal, :roll, {Acts.Roll, twist: Twist.new(0.1, 0.0)}},
      {:send, :all, %{epoch: 1}},
      {:claim, %{slot: 2}},
      {:stage, :elected, %{epoch: 1}}
    ]

    assert Pilot.command(id, {:do, :lead, effects}) == :ok
    assert_received {:"$gen_cast", {:say, :all, %{epoch: 1}}}
    assert_received {[:robot, :stage], %{robot: ^id, stage: :elected, epoch: 1}}
    assert_received {[:robot, :pilot, :phase], %{state: {Acts.Mission, :lead}}}
    {:ok, %{claim: %{slot: 2}}, _} = Board.fetch(Board.find!(id), :mission, 1_000)
    rolls()
    assert_receive {:ptz, {:look, 0.25, _}, _}

    assert Pilot.command(id, {:do, :lead, [{:goal, :none, nil}, {:look, -0.5}]}) == :ok
    assert_receive {:ptz, {:look, -0.5, _}, _}
  end

  test "of the ticks that wait only the newest is handled" do
    id = flown(:pilot4)
    board = Board.find!(id)
    [pilot, executive] = parts(id, [:pilot, :executive])
    :ok = :sys.suspend(pilot)
    {:ok, %{tick: before}, then_ms} = Board.fetch(board, :doing, :infinity)

    eventually(fn ->
      {:ok, %{tick: now}, _at_ms} = Board.fetch(board, :doing, :infinity)
      now >= before + 5
    end)

    :ok = :sys.suspend(executive)
    {:ok, _doing, now_ms} = Board.fetch(board, :doing, :infinity)
    :ok = :sys.resume(pilot)
    assert_receive {:mission, {:tick, %{at_ms: ^now_ms}}}
    assert for(at_ms <- ticked(), at_ms > then_ms, do: at_ms) == []
  end

  defp ticked do
    receive do
      {:mission, {:tick, %{at_ms: at_ms}}} -> [at_ms | ticked()]
    after
      0 -> []
    end
  end

  test "a stop ends a mission that does not care, and a goal of nobody's, before it returns" do
    roll = {Acts.Roll, twist: Twist.new(0.1, 0.0)}
    id = flown(:pilot6)
    :ok = Pilot.command(id, {:do, :ready, [{:goal, :roll, roll}]})
    rolls()
    assert Pilot.stop(id) == :ok
    # What the drive is told from now on was asked for after the answer.
    :sys.get_state(Names.whereis(id, :drive))
    stands(250)
    assert {:ok, %{state: :idle, claim: claim}, _} = Board.fetch(Board.find!(id), :mission, 1_000)
    assert claim == %{}
    refute_received {:mission, {:command, :stop}}

    # Without a mission.
    Executive.goal(id, :roll, roll)
    rolls()
    Pilot.halt(id, {Kernel, :send, [self(), :stopped]})
    assert_receive :stopped
    :sys.get_state(Names.whereis(id, :drive))
    stands(250)
    assert Pilot.resume(id) == {:error, :idle}
  end

  test "what a mission leaves of itself when it is stopped is taken up by the next start" do
    id = flown(:pilot7, [])
    :ok = Pilot.stop(id)
    assert Pilot.resume(id) == {:error, :idle}
    assert Pilot.start(id, Acts.Mission, test: self(), halted: :left) == :ok
    assert Pilot.stop(id) == :ok

    assert {:idle, %{state: %{runner: %{mission: nil}}}} =
             :sys.get_state(Names.whereis(id, :pilot))

    # A second stop takes nothing away.
    assert Pilot.stop(id) == :ok
    assert Pilot.command(id, :go) == {:error, :idle}
    assert Pilot.resume(id) == :ok
    assert_receive {:mission, {:command, :start}}
    assert {{Acts.Mission, :left}, _data} = :sys.get_state(Names.whereis(id, :pilot))
    assert Pilot.resume(id) == {:error, :idle}
  end

  defmodule Mapper do
    @behaviour Robot.Mission
    @impl Robot.Mission
    def init(_robot, []), do: {:ready, 3, []}
    @impl Robot.Mission
    def handle(_event, width), do: {:ready, width, []}
    @impl Robot.Mission
    def halted(width), do: width
    @impl Robot.Mission
    def map(width),
      do: %{
        cells: :binary.copy(<<1>>, width),
        width: width,
        height: 1,
        left: 0,
        low: 0,
        cell: 0.1
      }
  end

  test "the map that a mission has made can be had, also after a stop; of one that makes none there is none" do
    id = robot(:pilot8)
    assert Pilot.map(id) == nil
    assert Pilot.start(id, Acts.Mission, test: self()) == :ok
    assert Pilot.map(id) == nil
    assert Pilot.start(id, Mapper, []) == :ok
    assert %{cells: <<1, 1, 1>>, width: 3} = Pilot.map(id)
    assert Pilot.stop(id) == :ok
    assert %{cells: <<1, 1, 1>>} = Pilot.map(id)
  end

  test "another mission takes the place of a running one" do
    id = flown(:pilot5)
    goal = {:goal, :roll, {Acts.Roll, twist: Twist.new(0.1, 0.0)}}
    :ok = Pilot.command(id, {:do, :ready, [goal]})
    rolls()
    :ok = Pilot.start(id)
    assert_receive {:drive, {:drive, stop}, _} when stop == %Twist{linear: 0.0, turn: 0.0}
  end
end
