defmodule Robot.FleetTest do
  use Robot.Case, async: false
  @moduletag :capture_log
  alias Robot.Fleet

  defp fleet, do: start_supervised!({Fleet, []}, restart: :temporary)

  test "twenty robots live on one node, each with its own parts" do
    fleet = fleet()
    ids = for n <- 1..20, do: :"fleet#{n}"
    goal = {:goal, :roll, {Acts.Roll, twist: Twist.new(0.1, 0.0)}}

    for id <- ids do
      drive = {Hal.FakeDrive, test: self(), device: id}
      mission = {Acts.Mission, effects: [goal]}
      assert {:ok, _} = Fleet.start_robot(fleet, config(id, drive: drive, mission: mission))
      assert :ok = id |> online() |> Pilot.start()
    end

    assert ids -- Names.robots() == []
    for id <- ids, do: assert_receive({^id, {:drive, %Twist{linear: v}}, _} when v > 0)

    # One falls, and the others do not notice.
    [wreck | others] = ids
    gates = Enum.map(others, &Names.whereis(&1, :gate))
    Process.exit(Names.whereis(wreck, :robot), :kill)
    for id <- others, do: assert(:ok = Fleet.stop_robot(fleet, id))
    refute Enum.any?(gates, &Process.alive?/1)
    for id <- others, do: assert_receive({^id, :terminate, _})
  end

  test "a robot cannot be twice, and an unknown one cannot be stopped" do
    fleet = fleet()
    assert {:ok, pid} = Fleet.start_robot(fleet, config(:twice))
    assert {:error, {:already_started, ^pid}} = Fleet.start_robot(fleet, config(:twice))
    assert Fleet.stop_robot(fleet, :twice) == :ok
    assert Fleet.stop_robot(fleet, :twice) == {:error, :unknown}
  end

  test "a permanent robot takes its fleet along, a temporary one does not" do
    fleet = fleet()
    monitor = Process.monitor(fleet)
    {:ok, wreck} = Fleet.start_robot(fleet, config(:temporary))
    {:ok, real} = Fleet.start_robot(fleet, config(:permanent), :permanent)
    gone = Process.monitor(wreck)
    Process.exit(wreck, :kill)
    assert_receive {:DOWN, ^gone, _, _, _}
    refute_receive {:DOWN, ^monitor, _, _, _}, 50
    Process.exit(real, :kill)
    assert_receive {:DOWN, ^monitor, _, _, :shutdown}
  end
end
