defmodule Swarm.EStop.NodesTest do
  use Swarm.Case, async: false
  alias Mesh.Nonblocking
  alias Robot.Mission.Manual
  alias Swarm.Cluster
  @moduletag :realtime
  @moduletag :cluster
  @moduletag :capture_log

  defp latched?(node, id), do: match?(%{held: [_ | _]}, entry(node, id, :estop))

  test "a stop from a node without a robot reaches all, outlives its sender, and stops newcomers" do
    [base, one, two] = Cluster.start_nodes(3)
    robot_on(one, :estop_n1)
    robot_on(two, :estop_n2)
    eventually(fn -> length(:erpc.call(base, Directory, :members, [:estops])) == 2 end)
    # It has heard no heartbeat, so it asks how old its command may be.
    assert order(fn -> :erpc.call(base, Swarm, :goto, [:estop_n1, {1, 1}]) end) == :ok
    assert entry(one, :estop_n1, :mission).state == {Manual, :goto}

    assert :erpc.call(base, Swarm, :estop, []) == :ok
    assert latched?(one, :estop_n1) and latched?(two, :estop_n2)
    refused = :erpc.call(base, Swarm, :goto, [:estop_n1, {1, 1}])
    assert {:error, "estop_n1 is held by the emergency stop; reset it first"} = refused

    Cluster.kill(base)
    Cluster.kill(one)
    # The remaining robot informs the one that comes.
    stands = spawn_link(fn -> stand_for_ever(two, :estop_n2) end)
    here = robot(:estop_new)
    eventually(fn -> Board.latched?(Board.find!(here)) end)
    assert Swarm.reset() == :ok
    refute latched?(two, :estop_n2) or Board.latched?(Board.find!(here))
    Process.unlink(stands)
    Process.exit(stands, :kill)
  end

  test "a robot tells who on another node gave an order, and else which node did" do
    [base] = Cluster.start_nodes(1)
    id = robot(:estop_by)
    listen(id, [:swarm, :comms, :ordered])
    eventually(fn -> :erpc.call(base, Directory, :members, [{:robot, id}]) != [] end)
    told = fn -> receive(do: ({[:swarm, :comms, :ordered], about} -> {about.order, about.by})) end

    by = fn call ->
      order(fn -> :erpc.call(base, Swarm, :by, ["page 10.0.0.9:5123", call]) end)
    end

    assert order(fn -> :erpc.call(base, Swarm, :goto, [id, {1, 1}]) end) == :ok
    assert told.() == {"goto 1.0 1.0", Atom.to_string(base)}
    assert :erpc.call(base, Swarm, :stop, []) == :ok
    assert told.() == {"stop", Atom.to_string(base)}

    for {call, words} <- [
          {&Swarm.stop/0, "stop"},
          {&Swarm.estop/0, "estop"},
          {&Swarm.reset/0, "reset"}
        ] do
      assert by.(call) == :ok
      assert told.() == {words, "page 10.0.0.9:5123"}
    end
  end

  test "a stop is not said to hold anybody where no robot is known" do
    [base] = Cluster.start_nodes(1)
    assert {:error, line} = :erpc.call(base, Swarm, :estop, [])
    assert line == "the stop was sent, but no robot is known here to be held by it"
  end

  test "commands that were queued for a frozen robot are not obeyed when it goes on, except the stop" do
    [far] = Cluster.start_nodes(1)
    id = robot_on(far, :estop_frozen)
    here = robot(:estop_awake)
    stands = spawn_link(fn -> stand_for_ever(far, id) end)
    mode = fn -> Map.get(Board.peers(Board.find!(here)), id) end
    eventually(fn -> match?(%{mode: mode} when mode != :dead, mode.()) end)
    assert Swarm.follow(id, here) == :ok
    assert entry(far, id, :mission).state == {Manual, :follow_the_leader}
    Process.unlink(stands)
    Process.exit(stands, :kill)

    comms = Directory.whereis(id)
    Nonblocking.cast(comms, {:stamp, ref = :erlang.alias([:reply])})
    assert_receive {^ref, stamp}
    Cluster.freeze(far)
    Nonblocking.cast(comms, {:command, {:goto, 5.0, 5.0, nil}, :erlang.alias([:reply]), stamp})
    assert Swarm.goto(id, {5, 5}) == {:error, "estop_frozen does not answer"}
    # It is silent for longer than a command may be old.
    eventually(fn -> match?(%{mode: :dead}, mode.()) end)
    assert Swarm.stop(id) == {:error, "estop_frozen does not answer"}
    Cluster.thaw(far)

    # The stop was obeyed, and nothing else.
    eventually(fn -> match?(%{rejected: %{too_old: _}}, Swarm.status(id)) end)
    eventually(fn -> entry(far, id, :mission).state == :idle end)
    assert Swarm.goto(id, {5, 5}) == :ok
  end

  # A robot without odometry sends no heartbeats.
  defp stand_for_ever(node, id) do
    :erpc.cast(node, Swarm.Case, :stand, [id, Pose.new(0, 0)])

    receive do
      :never -> :ok
    after
      100 -> stand_for_ever(node, id)
    end
  end
end
