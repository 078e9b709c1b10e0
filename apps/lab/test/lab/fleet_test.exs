defmodule Lab.FleetTest do
  @moduledoc "Fleets of whole robots in real time."
  use ExUnit.Case, async: false
  import Swarm.Case, only: [eventually: 1, order: 1]
  alias Hal.Pose
  alias Robot.{Board, Names}
  alias Lab.Fleet
  alias Sim.World
  @moduletag :realtime
  @moduletag :capture_log

  defp fleet(options) do
    {:ok, fleet} = Fleet.start_link(Map.merge(%{map: "hall", seed: 3}, options))

    on_exit(fn ->
      monitor = Process.monitor(fleet)
      assert_receive {:DOWN, ^monitor, _, _, _}, 5_000
    end)

    fleet
  end

  defp truth(fleet, id), do: World.truth(Fleet.moment(fleet).world, id)
  defp stages(fleet), do: Enum.map(Fleet.scene(fleet).stages, & &1.stage)
  defp stop(fleet), do: Fleet.stop(fleet)

  test "a robot that is sent somewhere gets there, and its fleet leaves nothing behind" do
    fleet = fleet(%{robots: [:mag71], landmark: :none, mission: false})
    eventually(fn -> match?(%Swarm.Status{pose: %Pose{}}, Swarm.status(:mag71)) end)
    start = truth(fleet, :mag71)
    place = Pose.place(start, {0.7, 0.2})
    assert order(fn -> Swarm.goto(:mag71, place) end) == :ok
    eventually(fn -> Swarm.status(:mag71).state == :done end)
    assert Pose.distance(truth(fleet, :mag71), place) < 0.15
    assert [%{state: :idle, alive: true, uncertainty: metres}] = Fleet.scene(fleet).robots
    # Also without a mission it knows how certain its pose is; by now it has driven.
    assert is_float(metres) and metres > 0.0
    assert [%{uncertainty_m: told}] = Fleet.result(fleet).fleet
    assert is_float(told)
    assert Fleet.result(fleet).collisions == 0
    stop(fleet)
    assert Names.whereis(:mag71, :robot) == nil
    # The directory hears of its end after that.
    eventually(fn -> Swarm.tell(:mag71, "ping") |> elem(1) =~ "no robot" end)
  end

  test "a robot counts its way, its stops, how late it decides, and what was started again" do
    fleet = fleet(%{robots: [:mag74], landmark: :none, mission: false})
    eventually(fn -> match?(%Swarm.Status{pose: %Pose{}}, Swarm.status(:mag74)) end)
    place = Pose.place(truth(fleet, :mag74), {0.6, 0.0})
    assert order(fn -> Swarm.goto(:mag74, place) end) == :ok
    eventually(fn -> Swarm.status(:mag74).state == :done end)
    before = Swarm.status(:mag74).meters
    assert before.distance_m > 0.4 and before.distance_m < 0.8
    assert before.ticks > 10 and before.restarts.pilot == 0

    assert Swarm.estop() == :ok
    Process.exit(Names.whereis(:mag74, :pilot), :kill)
    eventually(fn -> Swarm.status(:mag74).meters.restarts.pilot == 1 end)
    meters = Swarm.status(:mag74).meters
    assert meters.restarts.gate == 0
    assert meters.stops.estop == Map.get(before.stops, :estop, 0) + 1
    assert meters.distance_m >= before.distance_m
    Swarm.reset()
    stop(fleet)
  end

  test "a robot with a lidar goes by its scans, tells what it hears, and stands while they do not come" do
    fleet = fleet(%{robots: [:burger71], landmark: :none, mission: false})
    eventually(fn -> match?({:ok, [_ | _]}, Swarm.sonar(:burger71)) end)
    {:ok, heard} = Swarm.sonar(:burger71)
    assert Enum.all?(heard, fn {%Pose{x: x}, range} -> x == -0.032 and range <= 3.5 end)
    {:ok, board} = Board.find(:burger71)
    assert {:ok, %Hal.Scan{}, _at_ms} = Board.fetch(board, :scan, 1_000)
    assert {:online, _since_ms} = Board.health(board, :scan)

    start = truth(fleet, :burger71)
    assert order(fn -> Swarm.goto(:burger71, Pose.place(start, {0.5, 0.0})) end) == :ok
    eventually(fn -> Swarm.status(:burger71).state == :done end)
    assert Pose.distance(truth(fleet, :burger71), Pose.point(start)) > 0.3

    lidar = Names.whereis(:burger71, :scan)
    :ok = :sys.suspend(lidar)
    assert order(fn -> Swarm.goto(:burger71, Pose.point(start)) end) == :ok

    eventually(fn ->
      {:ok, driving, _at_ms} = Board.fetch(board, :driving, 1_000)
      :blind in driving.limits and driving.twist.linear == 0.0
    end)

    :ok = :sys.resume(lidar)
    eventually(fn -> Swarm.status(:burger71).state == :done end)
    assert Fleet.result(fleet).collisions == 0
    stop(fleet)
  end

  defmodule Failing do
    @moduledoc "A mission that fails in its first ticks."
    @behaviour Robot.Mission

    @impl Robot.Mission
    def init(_robot, _options), do: {:stand, 0, []}

    @impl Robot.Mission
    def handle({:tick, _percept}, 3), do: raise("boom")
    def handle({:tick, _percept}, ticks), do: {:stand, ticks + 1, []}
    def handle(_event, ticks), do: {:stand, ticks, []}
  end

  test "a mission that crashes is told where people look: stages, result, status" do
    fleet = fleet(%{robots: [:mag79], landmark: :none, mission: {Failing, []}})

    stage = eventually(fn -> Enum.find(Fleet.scene(fleet).stages, &(&1.stage == :crashed)) end)

    assert %{robot: :mag79, crash: "(RuntimeError) boom, " <> place} = stage
    assert place =~ ~r"^(apps/lab/)?test/lab/fleet_test.exs:\d+$"
    eventually(fn -> inspect(Swarm.status(:mag79)) =~ "idle" end)
    assert inspect(Swarm.status(:mag79)) =~ "CRASHED (RuntimeError) boom, " <> place
    assert Enum.any?(Fleet.result(fleet).stages, &(&1.stage == :crashed))
    # An order to this robot alone ends it.
    assert order(fn -> Swarm.tell(:mag79, "wander") end) == :ok
    refute inspect(Swarm.status(:mag79)) =~ "CRASHED"
    stop(fleet)
  end

  test "what keeps a robot from its work is in the scene: a fault, devices that are offline" do
    fleet = fleet(%{robots: [:mag77], landmark: :none, mission: false})
    robot = fn -> hd(Fleet.scene(fleet).robots) end
    eventually(fn -> robot.().state == :idle end)
    assert {robot.().fault, robot.().offline} == {nil, []}

    {:ok, board} = Board.find(:mag77)
    condition = &Robot.Devices.health(board, {:health, &1, {&2, Board.now(board)}})
    condition.(:ptz, {:offline, :silent})
    condition.(:camera, {:offline, :enoent})
    eventually(fn -> robot.().offline == [:camera, :ptz] end)
    condition.(:ptz, :online)
    eventually(fn -> robot.().offline == [:camera] end)

    # What the executive writes when it stands for a fault, until its next tick.
    {:ok, doing, _at_ms} = Board.fetch(board, :doing, :infinity)

    eventually(fn ->
      doing = %{doing | fault: "both bumpers are pressed"}
      _written? = Board.put(board, :executive, :doing, doing, Board.now(board))
      robot.().fault == "both bumpers are pressed"
    end)

    stop(fleet)
  end

  defmodule Ending do
    @moduledoc "A backend whose run cannot go on once it is told so."
    alias Lab.Fleet.Local
    def hear(backend, :over), do: {:ended, "the world is gone", backend}
    defdelegate living(backend), to: Local
    defdelegate claims(backend), to: Local
    defdelegate world(backend), to: Local
    defdelegate messages(backend), to: Local
    defdelegate stop(backend), to: Local
  end

  test "a run that cannot go on is over, and tells what is known of it" do
    fleet = fleet(%{robots: [:mag78], landmark: :none, mission: false})
    assert Fleet.ended(fleet) == nil
    refute Fleet.done?(fleet)

    :sys.replace_state(fleet, fn %{backend: {_local, backend}} = s ->
      %{s | backend: {Ending, backend}}
    end)

    send(fleet, :over)
    assert Fleet.ended(fleet) == "the world is gone"
    assert Fleet.done?(fleet)
    %{at_ms: at_ms} = Fleet.scene(fleet)
    assert %{robots: 1} = Fleet.result(fleet)
    assert Fleet.kill(fleet, :mag78) == {:error, "the run has ended: the world is gone"}
    assert Fleet.move_landmark(fleet, nil) == Fleet.kill(fleet, :leader)
    send(fleet, :tick)
    assert Fleet.scene(fleet).at_ms == at_ms
    stop(fleet)
  end

  test "three robots search, agree on a leader, and heal when it dies; stops reach all" do
    ids = [:mag81, :mag82, :min81]
    fleet = fleet(%{robots: ids})
    eventually(fn -> Fleet.scene(fleet).leader end)
    scene = Fleet.scene(fleet)
    # The run looks at its robots ten times a second, and the scene is of now.
    eventually(fn -> [:search, :elected] == stages(fleet) end)
    leader = scene.leader
    assert Enum.find(scene.robots, & &1.leader?).id == leader
    eventually(fn -> Enum.any?(Fleet.scene(fleet).robots, & &1.slot) end)

    # All stop, and stay stopped until a person resets them.
    assert order(fn -> Swarm.estop() end) == :ok
    for id <- ids, do: assert(Board.latched?(Board.find!(id)))
    still = fn -> for id <- ids, do: truth(fleet, id) end

    eventually(fn ->
      Enum.all?(Fleet.moment(fleet).world.robots, fn {_, body} ->
        body.speed == {0.0, 0.0}
      end)
    end)

    # Whoever looks sees that they are held, and by whom.
    eventually(fn -> match?(%{held: ^ids, of: 3}, Fleet.scene(fleet).estop) end)
    assert %{estop: %{by: ["this program"]}, robots: robots} = Fleet.scene(fleet)
    assert Enum.map(robots, & &1.state) == [:estop, :estop, :estop]
    assert List.last(stages(fleet)) == :estop_holds

    before = still.()
    assert order(fn -> Swarm.stop(hd(ids)) end) == :ok
    assert {:error, line} = Swarm.start(robots: [hd(ids)])
    assert line =~ "emergency stop"
    assert still.() == before
    assert order(fn -> Swarm.reset() end) == :ok

    eventually(fn -> Fleet.scene(fleet).estop == nil end)
    assert List.last(stages(fleet)) == :estop_over

    # Their missions ended with the stop; they start again.
    eventually(fn -> Fleet.scene(fleet).leader == nil end)
    assert order(fn -> Swarm.start() end) == :ok
    eventually(fn -> Fleet.scene(fleet).leader end)
    leader = Fleet.scene(fleet).leader

    # The leader dies: its body stays, the others know, and one of them takes over.
    assert Fleet.kill(fleet, :leader) == :ok
    assert Fleet.living(fleet) == ids -- [leader]
    assert Names.whereis(leader, :robot) == nil
    body = truth(fleet, leader)
    assert Fleet.kill(fleet, leader) |> elem(1) =~ "no robot"
    assert :killed in stages(fleet)
    [other | _] = ids -- [leader]
    eventually(fn -> Board.peers(Board.find!(other))[leader].mode == :dead end)
    eventually(fn -> Fleet.scene(fleet).leader not in [nil, leader] end)
    assert truth(fleet, leader) == body

    assert %{alive: false, state: :dead} =
             Enum.find(Fleet.scene(fleet).robots, &(&1.id == leader))

    assert Fleet.result(fleet).leaders_at_once_max == 1
    stop(fleet)
  end

  test "a robot whose processes crash too often is a wreck, and the others live on" do
    fleet = fleet(%{robots: [:mag91, :mag92], mission: false})

    eventually(fn -> Enum.all?([:mag91, :mag92], &(&1 in Swarm.Directory.robots())) end)

    # A single failure does not count.
    kill(:mag91, :executive)

    eventually(fn ->
      Names.whereis(:mag91, :comms) && match?({:ok, _}, Swarm.tell(:mag91, "ping"))
    end)

    assert Fleet.living(fleet) == [:mag91, :mag92]

    Enum.find(1..8, fn _ ->
      kill(:mag91, :gate)

      eventually(fn -> Names.whereis(:mag91, :gate) || Names.whereis(:mag91, :robot) == nil end)

      Names.whereis(:mag91, :robot) == nil
    end)

    eventually(fn -> Fleet.living(fleet) == [:mag92] end)
    assert :killed in stages(fleet)
    assert {:ok, "mag92 on " <> _} = Swarm.tell(:mag92, "ping")
    stop(fleet)
  end

  defp kill(id, role) do
    pid = Names.whereis(id, role)
    monitor = Process.monitor(pid)
    Process.exit(pid, :kill)
    assert_receive {:DOWN, ^monitor, _, _, _}
  end

  test "the radio loses the given share, and the script is played" do
    fleet =
      fleet(%{
        robots: [:mag95, :mag96, :min95],
        loss: 0.3,
        blobs: :direct,
        mission: false,
        moves: [{{1.0, 0.0}, 0.5}],
        kills: [{:mag96, 0.3}]
      })

    eventually(fn -> stages(fleet) == [:killed, :landmark_moved] end)
    eventually(fn -> elem(Fleet.scene(fleet).landmark, 0) > 0.05 end)
    %{messages: %{sent: sent, lost: lost}} = Fleet.result(fleet)
    assert lost > 0 and lost < sent
    assert Fleet.move_landmark(fleet, {99.0, 0.0}) |> elem(1) =~ "99"
    assert Fleet.move_landmark(fleet, nil) == :ok
    assert Fleet.scene(fleet).landmark == nil
    assert List.last(stages(fleet)) == :landmark_removed
    stop(fleet)
  end

  defmodule Turn do
    @moduledoc "Another mission, which turns on the spot from its start on."
    @behaviour Robot.Mission

    @impl Robot.Mission
    def init(_robot, options), do: {:waiting, options[:rate], []}

    @impl Robot.Mission
    def handle({:command, :start}, rate) do
      goal = {Robot.Behaviour.Move, linear: 0.0, turn: rate}
      {:turning, rate, [{:goal, :turn, goal}, {:claim, %{phase: :lead}}]}
    end

    def handle(_event, rate), do: {:turning, rate, []}
  end

  test "a fleet runs the mission that it is given, or says why not" do
    fleet = fleet(%{robots: [:mag75], landmark: :none, mission: {Turn, rate: 0.3}})
    heading = truth(fleet, :mag75).heading
    eventually(fn -> Swarm.status(:mag75).state == :turning end)
    eventually(fn -> abs(Pose.wrap(truth(fleet, :mag75).heading - heading)) > 0.3 end)
    assert [%{state: :lead}] = Fleet.scene(fleet).robots
    assert order(fn -> Swarm.stop(:mag75) end) == :ok
    stop(fleet)

    for {mission, nodes?, word} <- [
          {{NoSuchModule, []}, false,
           "a Robot.Mission (init/2 and handle/2), got {NoSuchModule, []}"},
          {{Turn, [1]}, false, "options"},
          {5, false, "true, false, a name or"},
          {{Turn, rate: 0.3}, true, "processes of their own"}
        ] do
      options = %{robots: [:mag76], map: "hall", mission: mission, nodes: nodes?}
      assert {:error, line} = Fleet.start_link(options)
      assert line =~ "mission: expected" and line =~ word
    end
  end

  defmodule Formed do
    @moduledoc "Another mission, which leads and is formed from its start on."
    @behaviour Robot.Mission

    @impl Robot.Mission
    def init(_robot, options), do: {:waiting, options, []}

    @impl Robot.Mission
    def handle({:command, :start}, options) do
      stages = for name <- [:elected, :formed], do: {:stage, name, %{epoch: 1}}
      {:lead, options, stages ++ [{:claim, %{phase: :lead, formed: true, epoch: 1}}]}
    end

    def handle(_event, options), do: {:lead, options, []}
  end

  test "when the fleet announces a leader or a formation, its claims show it" do
    fleet = fleet(%{robots: [:mag77], landmark: :none, mission: false})
    :ok = Robot.Control.Pilot.start(:mag77, Formed, [])
    :ok = Robot.Control.Pilot.command(:mag77, :start)

    # It holds at once, and from then on.
    eventually(fn ->
      scene = Fleet.scene(fleet)
      told = Enum.map(scene.stages, & &1.stage)
      assert :elected not in told or scene.leader == :mag77
      assert :formed not in told or scene.formed?
      told == [:elected, :formed]
    end)

    assert %{leader: :mag77} = Fleet.result(fleet)
    stop(fleet)
  end

  test "errors in a fleet's options are returned before anything starts" do
    assert {:error, line} = Fleet.start_link(%{map: "mars"})
    assert line =~ "mars"
    assert {:error, line} = Fleet.start_link(%{landmark: {50, 50}})
    refute line =~ "\n"
    fleet = fleet(%{robots: [:mag99], mission: false})
    assert {:error, line} = Fleet.start_link(%{robots: [:mag98, :mag99]})
    assert line =~ "mag99 lives on this node already"
    stop(fleet)
  end
end
