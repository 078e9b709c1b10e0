defmodule Lab.Hardware.FleetTest do
  @moduledoc "Fleets in which some robots have the real drivers."
  use ExUnit.Case, async: false
  import Swarm.Case, only: [eventually: 1, order: 1]
  alias Hal.Pose
  alias Robot.Board
  alias Lab.{Fleet, Trial}
  alias Sim.World
  @moduletag :realtime
  @moduletag :capture_log

  test "a robot with real drivers goes where it is sent, and leaves nothing behind" do
    {:ok, fleet} =
      Fleet.start_link(
        robots: [:mag61, :min61],
        hardware: [:mag61, :min61],
        landmark: :none,
        mission: false
      )

    lines = Fleet.lines(fleet)

    assert [folder] =
             Regex.run(~r"(/\S+)/mag61\.base", Enum.at(lines, 1), capture: :all_but_first)

    assert Enum.sort(File.ls!(folder)) == ~w(mag61.base mag61.camera min61.base min61.camera)
    assert Enum.at(lines, 2) =~ "min61 has real drivers"

    for id <- [:mag61, :min61] do
      eventually(fn -> match?(%Swarm.Status{pose: %Pose{}}, Swarm.status(id)) end)
      start = World.truth(Fleet.moment(fleet).world, id)
      place = Pose.place(start, {0.7, 0.2})
      assert order(fn -> Swarm.goto(id, place) end) == :ok
      eventually(fn -> Swarm.status(id).state == :done end)

      eventually(fn ->
        Pose.distance(World.truth(Fleet.moment(fleet).world, id), place) < 0.15
      end)

      {:ok, board} = Board.find(id)
      assert {:ok, ranges, _at_ms} = Board.fetch(board, :sonar, 1_000)
      assert length(ranges) == 16
      assert {:ok, %{pan: _, field_of_view: angle}, _at_ms} = Board.fetch(board, :ptz, 1_000)
      assert_in_delta angle, :math.pi() / 3, 1.0e-6
    end

    assert {:ok, [_ | _], _at_ms} = Board.fetch(Board.find!(:mag61), :ir, 1_000)
    assert Fleet.kill(fleet, :mag61) == :ok
    assert Fleet.living(fleet) == [:min61]
    assert Fleet.result(fleet).collisions == 0
    Fleet.stop(fleet)
    refute File.exists?(folder)
  end

  test "so does a Burger with its lidar, a Create 2 and a Kobuki, each by its own driver" do
    robots = [:burger1, :create2_1, :kobuki1]

    {:ok, fleet} =
      Fleet.start_link(robots: robots, hardware: robots, landmark: :none, mission: false)

    assert Enum.any?(Fleet.lines(fleet), &(&1 =~ ~r"burger1 has real drivers: .*burger1\.scan"))

    for id <- robots do
      eventually(fn -> match?(%Swarm.Status{pose: %Pose{}, arming: :armed}, Swarm.status(id)) end)
      start = World.truth(Fleet.moment(fleet).world, id)
      place = Pose.place(start, {0.5, 0.1})
      assert order(fn -> Swarm.goto(id, place) end) == :ok
      eventually(fn -> Swarm.status(id).state == :done end)

      eventually(fn ->
        Pose.distance(World.truth(Fleet.moment(fleet).world, id), place) < 0.15
      end)
    end

    assert {:ok, %Hal.Scan{}, _at_ms} = Board.fetch(Board.find!(:burger1), :scan, 1_000)
    assert Fleet.result(fleet).collisions == 0
    Fleet.stop(fleet)
  end

  test "lockstep has no serial lines, and only a fleet's robots can be hardware" do
    assert {:error, line} = Trial.new(%{robots: [:mag1], hardware: [:mag1]})
    assert line =~ "mag1"
    assert line =~ "lockstep"
    assert {:error, line} = Fleet.start_link(robots: [:mag1], hardware: [:mag2])
    assert line =~ ~r/hardware: expected .*, got \[:mag2\]/
  end
end
