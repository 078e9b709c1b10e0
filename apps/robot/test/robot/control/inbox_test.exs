defmodule Robot.Control.InboxTest do
  use Robot.Case, async: false
  alias Robot.Control.{Delivery, Inbox}
  alias Robot.Localiser.Anchors
  @moduletag :realtime
  doctest Inbox

  @parts [:drive, :gate, :executive, :pilot]
  # No module, no such function, too few arguments, no list of arguments.
  @calls [{:a, :b, []}, {Kernel, :no_such_thing, []}, {Kernel, :send, []}, {:a, :b, [1 | 2]}]

  test "what nearly is a message of theirs ends none of the safety processes, and is counted" do
    id = robot(:inbox1, mission: {Acts.Mission, test: self()})
    :ok = Pilot.start(id)
    assert_receive {:mission, {:tick, _percept}}
    before = parts(id, @parts)

    for {role, messages} <- junk(), message <- messages do
      pid = Names.whereis(id, role)
      counted = dropped(pid)
      send(pid, message)
      assert {role, message, dropped(pid)} == {role, message, counted + 1}
    end

    assert parts(id, @parts) == before
    assert {{Acts.Mission, :ready}, _data} = :sys.get_state(Names.whereis(id, :pilot))
  end

  test "a start with options that its mission does not take is refused" do
    id = robot(:inbox2)

    assert Pilot.start(id, Acts.Mission, [1 | 2]) ==
             {:error, "expected options [key: value], got [1 | 2]"}

    assert Pilot.start(id, GenServer, []) == {:error, :no_mission}
    assert parts(id, [:pilot]) |> Enum.all?(&Process.alive?/1)
  end

  test "a command that a person's mission does not know, or nobody could drive, changes nothing" do
    {:ready, mission, _} = Robot.Mission.Manual.init(:mag1, [])

    for command <- [:junk, {:move, :fast, 0.0}, {:goto, 1.0e300, 0.0, nil}, {:find_blob, [1 | 2]}],
        do:
          assert(
            {:ready, ^mission, []} = Robot.Mission.Manual.handle({:command, command}, mission)
          )
  end

  defp junk do
    casts = fn messages -> for message <- messages, do: {:"$gen_cast", message} end
    huge = Bitwise.bsl(1, 80_000)
    reply = {Kernel, :send, [self()]}
    delivery = %Delivery{ways: [:resume], until_ms: 0, reply: reply}
    goals = [{:nomodule, []}, {Robot.Behaviour.Goto, [1 | 2]}, {Robot.Behaviour.Goto, x: :far}]

    [
      drive:
        casts.(
          for(call <- @calls, do: {:disarm, call}) ++
            for(call <- @calls, do: {:order, :disarm, huge, call}) ++
            [{:drive, %Twist{linear: huge, turn: 0.0}}]
        ),
      gate: casts.(for call <- @calls, do: {:forget, call}),
      executive:
        casts.(
          for(call <- @calls, do: {:stand, call}) ++
            for(call <- @calls, do: {:confirm, call, :ok}) ++
            for(goal <- goals, do: {:obey, {:goal, 1, goal}}) ++
            for(anchors <- anchors(), do: {:obey, {:anchors, anchors}}) ++
            [{:obey, {:look, huge}}]
        ),
      pilot:
        casts.(for(call <- @calls, do: {:halt, call})) ++
          casts.(
            for change <-
                  for(call <- @calls, do: [reply: call]) ++
                    [[ways: [1 | 2]], [ways: [{:hand, :all}]], [until_ms: nil], [asked: :now]],
                do: {:deliver, struct!(delivery, change), {:command, :go}}
          )
    ]
  end

  defp anchors do
    [
      %Anchors{marks: [1 | 2]},
      %Anchors{marks: [%{}]},
      %Anchors{frame: %{at: {0, 0}}},
      %Anchors{walls?: nil},
      Map.delete(%Anchors{}, :frame)
    ]
  end

  defp dropped(pid) do
    _handled = :sys.get_state(pid)
    {:dictionary, entries} = Process.info(pid, :dictionary)
    entries |> List.keyfind(Hal.HardenedServer.Drops, 0, {nil, {0, nil}}) |> elem(1) |> elem(0)
  end
end
