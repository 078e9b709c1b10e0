defmodule Lab.Trial.WorldFileTest do
  @moduledoc "World files of Stage as runs in lockstep."
  use ExUnit.Case, async: true
  alias Hal.Pose
  alias Lab.Trial
  alias Lab.Trial.{Setup, WorldFile}

  @moduletag :tmp_dir

  defp write(folder, text) do
    file = Path.join(folder, "a.world")
    File.write!(file, text)
    file
  end

  @yard Path.expand("../../../../../examples/stage/yard.world", __DIR__)

  test "a fleet finds the landmark of a world, and forms in it" do
    {:ok, trial} = Trial.new(%{world: @yard, seed: 3, duration_s: 120})
    assert Trial.living(trial) == [:r0, :r1, :r2, :rover1]
    assert trial.world.landmark == {0.5, 0.0}
    assert [%{id: "ball1", size: 0.11}, %{id: "box1", size: {0.8, 0.5}}] = trial.world.objects
    assert_in_delta trial.world.robots.r1.pose.heading, -20 * :math.pi() / 180, 1.0e-9
    assert %{about: "a rover", radius: radius, bumpers: 16} = trial.world.robots.r0.profile
    assert_in_delta radius, 0.2, 0.001
    assert length(trial.world.robots.r0.profile.sonars) == 8

    trial = trial |> Stream.iterate(&Trial.step/1) |> Enum.find(&Trial.done?/1)
    assert Trial.formed?(trial)
    assert trial.world.collisions == 0
    assert Enum.any?(Trial.living(trial), &near?(trial.world, &1))
  end

  defp near?(world, id), do: Pose.distance(world.robots[id].pose, world.landmark) < 2.5

  test "names are small letters, and each once", %{tmp_dir: folder} do
    file =
      write(folder, """
      define p3dx position ()
      position ( name "R2-D2" )
      position ( name "c" pose [2 0 0 0] )
      position ( name "c" pose [4 0 0 0] )
      p3dx ( pose [6 0 0 0] )
      """)

    assert {:ok, world} = WorldFile.open(file)
    assert world.options[:robots] == [:r2_d2, :position1, :position2, :p3dx1]
  end

  test "what the file says is said nowhere else; the rest is", %{tmp_dir: folder} do
    file =
      write(folder, "position () model ( color \"orange\" size [0.2 0.2 0.2] pose [1 0 0 0] )")

    {:ok, setup} = Setup.new(world: file, landmark: {0, 0.8}, balls: [], noise: :off)
    assert setup.world.landmark == {0.0, 0.8}
    assert setup.world.objects == []
    # Checked options are whole without the file.
    assert {:ok, again} = Setup.new(setup.options)
    assert again.world == setup.world

    assert {:error, "trial option robots is said by the world's file; leave it out"} =
             Setup.new(world: file, robots: [:mag1])

    assert {:error, "trial option world: no.world: no such file or directory"} =
             Setup.new(world: "no.world")
  end

  @tag skip: with({:error, line} <- Vision.Marks.available(), do: line, else: (_ok -> nil))
  test "marks hang at models and on the backs of robots that have one of their own", %{
    tmp_dir: folder
  } do
    text = """
    define finder position ( fiducial () fiducial_return 1 )
    finder ( name "a" ) finder ( name "b" pose [2 0 0 0] )
    finder ( name "c" pose [4 0 0 0] fiducial_return 9 )
    model ( size [0.2 1 1] pose [0 3 0 -90] fiducial_return 7 )
    model ( size [0.2 1 1] pose [9 3 0 -90] fiducial_return 60000 )
    """

    file = write(folder, text)
    assert {:ok, world} = WorldFile.open(file)

    assert [size: 0.3, at: [{7, {x, y, turn}}], known: [], robots: [{9, :c}]] =
             world.options[:marks]

    assert_in_delta x, 0.0, 1.0e-9
    assert_in_delta y, 2.87, 1.0e-9
    assert_in_delta turn, -90.0, 1.0e-9

    assert [
             "2: fiducial_return 1 of robots is left out: several have it",
             "5: fiducial_return 60000 is left out: tag36h11 has no such mark"
           ] = for(note <- world.notes, do: String.replace_prefix(note, file <> ":", ""))

    assert {:ok, setup} = Setup.new(world: file)
    assert length(setup.world.marks) == 2
  end

  test "without a landmark there is none, and two robots or a wall in one place are refused", %{
    tmp_dir: folder
  } do
    {:ok, setup} = Setup.new(world: write(folder, "position () position ( pose [2 0 0 0] )"))
    assert setup.world.landmark == nil
    assert setup.options.robots == [:position1, :position2]

    assert {:error, line} =
             Setup.new(world: write(folder, "position () position ( pose [0.2 0 0 0] )"))

    assert line =~ ~r/\Aposition2 cannot start at 0.2,0.0 of map .*a.world: position1 is there\z/

    assert {:error, line} = Setup.new(world: write(folder, "model ( size [1 1 1] ) position ()"))
    assert line =~ "position1 cannot start at 0.0,0.0"
  end

  test "bodies that cannot be are refused with their place", %{tmp_dir: folder} do
    sonars = String.duplicate("sensor ()", 65)
    assert {:error, line} = WorldFile.open(write(folder, "\nposition ( ranger ( #{sonars} ) )"))
    assert line =~ ~r/a.world:2:1: position1: sonars: expected a list of up to 64/
  end
end
