defmodule Console.LiveFleetTest do
  use ExUnit.Case, async: false
  alias Console.{Live, Options}
  @moduletag :capture_log

  test "people command whole robots, and errors say what is wrong" do
    options = Options.trial(%Options{robots: [:mag61, :min61], blobs: :direct})
    {:ok, live} = Live.Fleet.start_link(options)
    assert [%{id: :mag61}, %{id: :min61}] = Live.Fleet.scene(live).robots
    Swarm.Case.eventually(fn -> Swarm.Directory.robots() == [:mag61, :min61] end)

    parts = :mag61 |> Robot.Names.whereis(:robot) |> Supervisor.which_children()
    monitors = for {_id, pid, _type, _modules} <- parts, do: Process.monitor(pid)

    # A question has an answer.
    assert {:ok, said} = Live.Fleet.command(live, {:tell, :all, "ping"})
    assert said =~ ~r/^mag61 on .*, up for .*; min61 on /

    for command <- [
          {:tell, [:mag61], "goto:1:1"},
          {:tell, :all, "start"},
          {:formation, {:wedge, nil}},
          {:formation, {:line, 1.5}},
          {:landmark, {1.0, 0.5}},
          {:landmark, :none},
          :estop,
          :reset
        ],
        answer = Swarm.Case.order(fn -> Live.Fleet.command(live, command) end),
        do: assert({command, {:ok, "accepted"}} == {command, answer})

    # A hand on a robot: it drives while there are words, waits when they end, and keeps its mission.
    assert {:ok, "accepted"} = Live.Fleet.command(live, {:tell, [:min61], "start:teleop"})
    word = Console.Teleop.order(:min61, {0.4, 0.0}, :terminal)
    state = fn -> Swarm.status(:min61).state end

    Swarm.Case.eventually(fn ->
      {:ok, "accepted"} = Live.Fleet.command(live, word)
      Swarm.status(:min61).says == "driven: 0.20 m/s, 0.00 rad/s" and state.() == :driven
    end)

    Swarm.Case.eventually(fn -> state.() == :wait end)

    assert {:ok, "done"} = Live.Fleet.command(live, {:kill, :mag61})

    # What a robot's processes log when they are cut off belongs to this test.
    for monitor <- monitors, do: assert_receive({:DOWN, ^monitor, _, _, _})
    Swarm.Case.eventually(fn -> Swarm.Directory.robots() == [:min61] end)

    for command <- [
          {:kill, :leader},
          {:kill, :mag61},
          {:tell, [:mag61], "ping"},
          {:tell, :all, "goto:abc:1"},
          {:tell, [:min61], "goto:99.0:0.0"},
          {:landmark, {500.0, 0.0}}
        ] do
      assert {:error, line} = Live.Fleet.command(live, command)
      refute line =~ "\n"
    end

    assert %{robots: 2, messages: %{sent: _}} = Live.Fleet.result(live)
    Sim.Fleet.stop(live)
    assert {:error, _line} = Live.Fleet.start_link(%{options | map: "nowhere"})
  end
end
