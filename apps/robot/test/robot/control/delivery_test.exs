defmodule Robot.Control.DeliveryTest do
  use Robot.Case, async: false
  @moduletag :capture_log
  alias Robot.Control.Delivery

  doctest Robot.Control.Delivery

  @doc false
  def reply(test, name, outcome), do: send(test, {name, outcome})

  defp deliver(id, name, command, ways, until_ms \\ 60_000) do
    until_ms = System.monotonic_time(:millisecond) + until_ms
    reply = {__MODULE__, :reply, [self(), name]}
    :ok = Pilot.deliver(id, command, %Delivery{ways: ways, until_ms: until_ms, reply: reply})
  end

  defp start(options \\ []), do: {:start, Acts.Mission, [test: self()] ++ options}

  test "a command takes the first way that is open when the pilot comes to it" do
    id = robot(:delivery1)
    deliver(id, :none, :go, [{:hand, {:except, No.Mission}}, :resume])
    assert_receive {:none, {:error, :idle}}

    deliver(id, :begun, :go, [{:hand, {:only, Acts.Mission}}, start(halted: :left)])
    assert_receive {:mission, {:init, ^id}}
    assert_receive {:mission, {:command, :go}}
    assert_receive {:begun, :ok}

    deliver(id, :handed, :on, [{:hand, {:only, Acts.Mission}}, start()])
    assert_receive {:mission, {:command, :on}}
    assert_receive {:handed, :ok}
    refute_received {:mission, {:init, ^id}}

    :ok = Pilot.stop(id)
    deliver(id, :resumed, :start, [:resume, start()])
    assert_receive {:mission, {:command, :start}}
    assert_receive {:resumed, :ok}
    assert {{Acts.Mission, :left}, _data} = :sys.get_state(Names.whereis(id, :pilot))
  end

  test "`:ok` comes from the executive, which has the goal by then" do
    id = robot(:delivery2)
    executive = Names.whereis(id, :executive)
    :ok = :sys.suspend(executive)
    goal = {:goal, :roll, {Acts.Roll, twist: Twist.new(0.1, 0.0)}}
    deliver(id, :rolls, {:do, :ready, [goal]}, [start()])
    assert {{Acts.Mission, :ready}, _data} = :sys.get_state(Names.whereis(id, :pilot))
    refute_received {:rolls, _outcome}
    :ok = :sys.resume(executive)
    assert_receive {:rolls, :ok}
    assert {:ok, Acts.Roll, _at_ms} = Board.fetch(Board.find!(id), :goal, :infinity)
  end

  test "what comes too late, or while the robot is held, begins nothing" do
    id = robot(:delivery3)
    deliver(id, :late, :go, [start()], 0)
    assert_receive {:late, {:error, :late}}
    :ok = Gate.estop(id)
    deliver(id, :held, :go, [start()])
    assert_receive {:held, {:error, :held}}
    :ok = Gate.reset(id)
    deliver(id, :missing, :go, [{:start, No.Such.Mission, []}])
    assert_receive {:missing, {:error, :no_mission}}
    assert {:idle, _data} = :sys.get_state(Names.whereis(id, :pilot))
    refute_received {:mission, _event}
  end
end
