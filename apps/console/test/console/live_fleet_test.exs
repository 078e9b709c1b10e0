defmodule Console.LiveFleetTest do
  use ExUnit.Case, async: false
  alias Console.{Live, Options, Orders, Prompt}
  @moduletag :capture_log

  test "people command whole robots, and errors say what is wrong" do
    options = Options.trial(%Options{robots: [:mag61, :min61], blobs: :direct})
    {:ok, live} = Live.Fleet.start_link(options)
    assert [%{id: :mag61}, %{id: :min61}] = Live.Fleet.scene(live).robots
    Swarm.Case.eventually(fn -> Swarm.Directory.robots() == [:mag61, :min61] end)

    parts = :mag61 |> Robot.Names.whereis(:robot) |> Supervisor.which_children()
    monitors = for {_id, pid, _type, _modules} <- parts, do: Process.monitor(pid)

    # A question has an answer.
    assert {:ok, said} = Live.Fleet.command(live, {:tell, :all, :ping})
    assert said =~ ~r/^mag61 on .*, up for .*; min61 on /

    for command <- [
          {:tell, [:mag61], {:goto, 1, 1, nil}},
          {:tell, :all, :start},
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
    assert {:ok, "accepted"} = Live.Fleet.command(live, {:tell, [:min61], {:start, "teleop"}})
    word = Console.Teleop.order(:min61, {0.4, 0.0}, :terminal)
    state = fn -> Swarm.status(:min61).state end

    Swarm.Case.eventually(fn ->
      {:ok, "accepted"} = Live.Fleet.command(live, word)
      Swarm.status(:min61).says == "driven: 0.20 m/s, 0.00 rad/s" and state.() == :driven
    end)

    Swarm.Case.eventually(fn -> state.() == :wait end)

    # A person lifts it.
    pose = fn -> hd(Live.Fleet.scene(live).robots).pose end
    assert {:ok, "done"} = Live.Fleet.command(live, {:place, :mag61, {-3.0, 3.0}})
    Swarm.Case.eventually(fn -> Hal.Pose.distance(pose.(), {-3.0, 3.0}) < 0.5 end)

    assert {:ok, "done"} = Live.Fleet.command(live, {:kill, :mag61})

    # What a robot's processes log when they are cut off belongs to this test.
    for monitor <- monitors, do: assert_receive({:DOWN, ^monitor, _, _, _})
    Swarm.Case.eventually(fn -> Swarm.Directory.robots() == [:min61] end)

    for command <- [
          {:kill, :leader},
          {:kill, :mag61},
          {:place, :mag61, {0.0, 0.0}},
          {:place, :min61, {500.0, 0.0}},
          {:place, "ball1", {0.0, 0.0}},
          {:tell, [:mag61], :ping},
          {:tell, :all, "goto:abc:1"},
          {:tell, [:min61], {:goto, 99.0, 0.0, nil}},
          {:landmark, {500.0, 0.0}}
        ] do
      assert {:error, line} = Live.Fleet.command(live, command)
      refute line =~ "\n"
    end

    assert %{robots: 2, messages: %{sent: _}} = Live.Fleet.result(live)
    Lab.Fleet.stop(live)
    assert {:error, _line} = Live.Fleet.start_link(%{options | map: "nowhere"})
  end

  test "what whole robots say to each other is known on one node, and why it is not elsewhere" do
    options = Options.trial(%Options{robots: [:mag63, :min63], blobs: :direct, landmark: :none})
    {:ok, live} = Live.Fleet.start_link(options)

    Swarm.Case.eventually(fn ->
      {:ok, said} = Live.Fleet.messages(live)
      Enum.any?(said, &(&1.kind == :round and &1.text =~ ", 2 robots: "))
    end)

    {:ok, said} = Live.Fleet.messages(live)
    assert Enum.all?(said, &(&1.from in [:mag63, :min63] and &1.kind != :heartbeat))
    # By the clock of its scenes.
    assert List.last(said).last_s <= Live.Fleet.scene(live).at_ms / 1000
    Lab.Fleet.stop(live)

    {:ok, mesh} = Live.Mesh.start_link()
    assert {:error, "what real robots say" <> _} = Live.Mesh.messages(mesh)
    Live.Mesh.stop(mesh)
  end

  test "no order is carried out after a stop that came later, whatever waited before it" do
    options = Options.trial(%Options{robots: [:mag62, :min62], blobs: :direct, landmark: :none})
    {:ok, live} = Live.Fleet.start_link(Map.put(options, :mission, false))
    Swarm.Case.eventually(fn -> Swarm.Directory.robots() == [:mag62, :min62] end)
    test = self()
    {:ok, orders} = Orders.start_link("a test", &send(test, {:answer, &1, &2}))

    # All at once, and on a millisecond, of which the time for an answer is counted: on a busy machine, too, the first
    # takes all of it.
    given_us = 1_000 * System.monotonic_time(:millisecond)

    order = fn text ->
      {:ok, command} = Prompt.parse(text, [:mag62, :min62])
      Orders.give(orders, Orders.of_line(text, command, {Live.Fleet, live}, given_us))
    end

    # One of them does not answer, and holds up what waits behind it.
    comms = Robot.Names.whereis(:min62, :comms)
    :ok = :sys.suspend(comms)
    for _click <- 1..4, do: order.("goto min62 1,1")
    order.("goto mag62 3,3")
    assert_receive {:answer, "goto min62 1,1", {:error, "min62 does not answer"}}, 10_000
    assert :ok = Swarm.Case.order(fn -> Swarm.stop() end)
    :ok = :sys.resume(comms)
    Orders.settle(orders)

    for _click <- 1..3, do: assert_received({:answer, "goto min62 1,1", {:error, "given " <> _}})
    assert_received {:answer, "goto mag62 3,3", {:error, "given " <> _}}
    for id <- [:mag62, :min62], do: assert(%{state: :idle} = Swarm.status(id))

    # Nor is one that a robot gets in time, but was given before: of a stop, and of an emergency stop and its reset.
    early = fn -> Swarm.given(given_us, fn -> Swarm.goto(:mag62, {1.0, 1.0}) end) end
    assert {:error, "given " <> _} = early.()

    before = fn stop ->
      given_us = System.monotonic_time(:microsecond)
      stop.()
      Swarm.given(given_us, fn -> Swarm.goto(:mag62, {1.0, 1.0}) end)
    end

    stopped = fn
      {:error, "mag62 was stopped after this command was sent; repeat it"} -> true
      {:error, "given " <> _on_a_busy_machine} -> false
    end

    Swarm.Case.eventually(fn -> stopped.(before.(&Swarm.stop/0)) end)

    Swarm.Case.eventually(fn ->
      stopped.(before.(fn -> {Swarm.estop(), Swarm.reset()} end))
    end)

    assert :ok = Swarm.Case.order(fn -> Swarm.goto(:mag62, {1.0, 1.0}) end)
    Lab.Fleet.stop(live)
  end
end
