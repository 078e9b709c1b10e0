defmodule Lab.Fleet.ScriptTest do
  @moduledoc "The events of a script, done to real processes in real time."
  use ExUnit.Case, async: false
  import Swarm.Case, only: [eventually: 1]
  alias Hal.Pose
  alias Robot.Names
  alias Lab.Fleet
  alias Sim.World
  @moduletag :realtime
  @moduletag :capture_log

  defp fleet(robots, script, more \\ %{}) do
    options = %{robots: robots, map: "hall", seed: 3, landmark: :none, mission: false}
    {:ok, fleet} = Fleet.start_link(Map.merge(Map.put(options, :script, script), more))
    fleet
  end

  defp stage(fleet, name),
    do: eventually(fn -> Enum.find(Fleet.scene(fleet).stages, &(&1.stage == name)) end)

  defp suspended?(id, role),
    do: Process.info(Names.whereis(id, role), :status) == {:status, :suspended}

  test "a robot freezes and goes on; a part of another one crashes, or hangs until it is killed" do
    script = [
      {0.5, {:crash, :mag61, :executive}},
      {1.0, {:freeze, :mag62, 1.5}},
      {1.0, {:hang, :mag63, :executive, 10}},
      {1.2, {:blind, :mag61, 1}}
    ]

    fleet = fleet([:mag61, :mag62, :mag63], script)
    [crashes, hangs] = for id <- [:mag61, :mag63], do: Names.whereis(id, :executive)
    crashed = Process.monitor(crashes)
    hung = Process.monitor(hangs)
    assert_receive {:DOWN, ^crashed, _, _, :killed}
    assert %{robot: :mag61, crash: "its executive, by the script"} = stage(fleet, :crashed)
    assert %{robot: :mag62, for_s: 1.5} = stage(fleet, :frozen)
    for role <- [:executive, :gate, :comms, :board], do: assert(suspended?(:mag62, role))
    assert %{robot: :mag63} = stage(fleet, :hangs)
    assert suspended?(:mag63, :executive)
    refute suspended?(:mag63, :gate)
    assert %{robot: :mag61} = stage(fleet, :blind)
    eventually(fn -> not suspended?(:mag62, :executive) and not suspended?(:mag62, :board) end)
    # By the robot's own watch.
    assert_receive {:DOWN, ^hung, _, _, {:hung, _code}}
    # What is frozen does not keep the fleet from ending.
    Fleet.stop(fleet)
    assert Names.whereis(:mag62, :robot) == nil
  end

  test "people stop, reset and order robots, one is lifted elsewhere, and one is not" do
    script = [
      {0.5, {:tell, :mag64, "wander"}},
      {1.0, {:estop, :mag64}},
      {2.0, {:reset}},
      {2.5, {:displace, :mag65, {3.0, 3.0, 90}}},
      {2.6, {:displace, :mag64, {3.0, 3.0, 0}}}
    ]

    fleet = fleet([:mag64, :mag65], script)
    assert %{robot: :mag64, command: "wander"} = stage(fleet, :told)
    assert %{robot: :mag64} = stage(fleet, :estop)
    # It reaches all.
    for id <- [:mag64, :mag65], do: eventually(fn -> Swarm.status(id).estop end)
    stage(fleet, :reset)
    for id <- [:mag64, :mag65], do: eventually(fn -> not Swarm.status(id).estop end)
    assert %{robot: :mag65} = stage(fleet, :displaced)
    %{world: world} = Fleet.moment(fleet)
    assert Pose.distance(World.truth(world, :mag65), {3.0, 3.0}) < 0.01
    assert %{robot: :mag64} = stage(fleet, :not_displaced)
    Fleet.stop(fleet)
  end

  test "the radio is cut and whole again, and loses what the script says" do
    script = [
      {0.5, {:cut, [[:mag66], [:mag67]]}},
      {3.5, {:join}},
      {5.0, {:loss, 1.0}}
    ]

    fleet = fleet([:mag66, :mag67], script)
    hears? = fn -> :mag67 in Swarm.status(:mag66).hears end
    eventually(hears?)
    stage(fleet, :radio_cut)
    eventually(fn -> not hears?.() end)
    stage(fleet, :radio_whole)
    eventually(hears?)
    stage(fleet, :radio_loss)
    eventually(fn -> not hears?.() end)
    assert Fleet.result(fleet).messages.lost > 0
    Fleet.stop(fleet)
  end

  test "robots in processes of their own take no script" do
    assert {:error, line} =
             Fleet.start_link(%{nodes: true, cuts: [{1, 2, {:link, :mag1, :mag2}}]})

    assert line =~ "take no script and no cuts"
  end
end
