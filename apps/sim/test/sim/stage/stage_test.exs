defmodule Sim.StageTest do
  @moduledoc "World files in the style of Stage's: what is read, what is told, and that no file does harm."
  use ExUnit.Case, async: true
  alias Hal.Pose
  alias Sim.Stage

  # A function that reads these files.
  defp files(files) do
    fn file ->
      case files do
        %{^file => text} -> {:ok, text}
        _none -> {:error, "no such file or directory"}
      end
    end
  end

  defp read(text, more \\ %{}),
    do: Stage.read("w/a.world", files(Map.put(more, "w/a.world", text)))

  defp read!(text, more \\ %{}) do
    assert {:ok, world} = read(text, more)
    world
  end

  defp error(text, more \\ %{}) do
    assert {:error, line} = read(text, more)
    assert line =~ ~r/\A[^\n]{1,300}\z/
    line
  end

  @robot "define rover position ( size [0.5 0.3 0.2] )\n"

  test "robots have their place, body and sensors from definitions of definitions" do
    world =
      read!(
        """
        include "parts.inc" # beside this file
        define scout rover
        (
          front ( pose [0.1 0 0 0] ) /* two sonars,
          on two lines */ sicklike ( pose [0.05 0 0.1 180] )
          blobfinder ( fov 70 )
          bumper ()
          velocity_bounds [-0.4 0.4 0 0 0 0 -45 45]
        )
        scout ( name "r0" pose [1 -2 0 90] )
        scout ( pose [3 0 0 -180] mass 12 )
        """,
        %{
          "w/parts.inc" => """
          define rover position ( size [0.5 0.3 0.2] origin [-0.04 0 0 0] mass 20 )
          define eye sensor ( range [0.1 4] fov 20 samples 1 )
          define front ranger ( eye ( pose [0.1 0.1 0 30] ) eye ( pose [0.1 -0.1 0 -30] ) )
          define sicklike ranger ( sensor ( range [0 8] fov 180 samples 181 ) )
          """
        }
      )

    assert [%{name: "r0", kind: "scout"} = first, %{name: nil} = second] = world.robots
    assert first.pose == Pose.new(1, -2, :math.pi() / 2)

    assert Keyword.take(first.body, [:length, :width, :offset, :height, :mass, :bumpers]) ==
             [length: 0.5, width: 0.3, offset: -0.04, height: 0.2, mass: 20.0, bumpers: 16]

    assert second.body[:mass] == 12.0
    assert {first.body[:sonar_min], first.body[:sonar_max]} == {0.1, 4.0}
    assert_in_delta first.body[:sonar_cone], 20 * :math.pi() / 180, 1.0e-9
    assert [{x, y, turn}, _right] = first.body[:sonars]
    assert_in_delta x, 0.2, 1.0e-9
    assert_in_delta y, 0.1, 1.0e-9
    assert_in_delta turn, :math.pi() / 6, 1.0e-9
    assert first.body[:scan][:rays] == 181
    assert first.body[:scan][:pose] == {0.05, 0.0, :math.pi()}
    assert_in_delta first.body[:camera][:field_of_view], 70 * :math.pi() / 180, 1.0e-9
    assert first.body[:limits][:max_linear] == 0.4
    assert_in_delta first.body[:limits][:max_turn], :math.pi() / 4, 1.0e-9
    assert world.notes == []
  end

  test "things are what colour, size and name say; parts of a model stand in its frame" do
    world =
      read!(
        @robot <>
          """
          rover ()
          model ( color "Yellow" size [0.3 0.3 1] pose [2 0 0 0] )
          model ( color_rgba [1 0.65 0 1] size [0.2 0.2 0.2] pose [-1 1 0 0] )
          model ( color "blue" size [0.8 0.4 0.3] pose [0 3 0 90] )
          model ( color "orange" size [3 3 0.1] obstacle_return 0 ranger_return -1 )
          model ( size [2 1 1] pose [5 0 0 90] model ( size [0.2 0.2 1] color "yellow" pose [1 0 0 0] ) )
          """
      )

    assert world.landmark == {2.0, 0.0}
    assert world.balls == [{-1.0, 1.0, 0.1}]
    assert [{%Pose{x: x, y: 3.0}, 0.8, 0.4}] = world.boxes
    assert x == 0.0
    assert [{:polygon, whole}, {:polygon, part}] = world.walls
    near = fn points, {x, y} -> Enum.any?(points, &(Pose.distance(&1, {x, y}) < 1.0e-9)) end
    assert near.(whole, {4.5, 1.0}) and near.(whole, {5.5, -1.0})
    assert near.(part, {5.1, 1.1}) and near.(part, {4.9, 0.9})

    assert world.notes == [
             "w/a.world:6: what neither stops robots nor is seen by rangers is left out"
           ]
  end

  test "what is not supported is told once each, with file and line; display is not" do
    world =
      read!("""
      resolution 0.02 speedup 2 quit_time 60
      window ( size [600 600] scale 30 )
      charger ()
      #{@robot}
      rover ( gui_nose 1 trail_length 9 ctrl "wander" gripper ( paddle 1 ) drive "omni" )
      rover ( pose [2 0 0 0] gripper () ctrl "wander" )
      """)

    assert world.notes == [
             "w/a.world:3: charger is left out",
             "w/a.world:6: ctrl is left out",
             ~s(w/a.world:6: drive "omni" is left out: it has two wheels),
             "w/a.world:6: gripper is left out"
           ]
  end

  test "what a robot would be without a body, or unseen, is told" do
    notes = read!(@robot <> "rover ( obstacle_return 0 ranger_return 0.5 blob_return 0 )").notes

    assert notes == [
             "w/a.world:2: blob_return of 0.0 on a robot is left out: cameras see robots",
             "w/a.world:2: obstacle_return of 0.0 on a robot is left out: robots are solid"
           ]
  end

  test "marks hang before their models where a robot has a finder" do
    text = "model ( size [0.2 1 1] pose [1 0 0 180] fiducial_return 7 )\n" <> @robot
    assert read!(text <> "rover ()").marks == []

    assert [{7, %Pose{x: x, y: y}, {"w/a.world", 1, _column}}] =
             read!(text <> "rover ( fiducial () )").marks

    assert_in_delta x, 0.87, 1.0e-9
    assert_in_delta y, 0.0, 1.0e-9
  end

  test "poses and sonars as Stage 2 wrote them" do
    [robot] =
      read!("""
      position ( pose [1 2 90] ranger ( scount 2 spose[1] [0 0 90] spose[0] [0.1 0 0] sview [0 2 30] ) )
      """).robots

    assert robot.pose == Pose.new(1, 2, :math.pi() / 2)
    assert robot.body[:sonars] == [{0.1, 0.0, 0.0}, {0.0, 0.0, :math.pi() / 2}]
    assert robot.body[:sonar_max] == 2.0
  end

  test "blocks on a circle are a round robot, others cut its corners" do
    ring =
      for k <- 0..15, into: "" do
        a = k * :math.pi() / 8
        "point[#{k}] [#{Float.round(:math.cos(a), 4)} #{Float.round(:math.sin(a), 4)}] "
      end

    [round] = read!("position ( size [0.4 0.4 0.1] block ( points 16 #{ring} z [0 1] ) )").robots
    assert_in_delta round.body[:radius], 0.2, 1.0e-3
    refute Keyword.has_key?(round.body, :length)

    cross = "point[0] [2 0] point[1] [0 1] point[2] [-2 0] point[3] [0 -1]"
    [cut] = read!("position ( size [0.4 0.4 0.1] block ( points 4 #{cross} ) )").robots
    assert_in_delta cut.body[:radius], 0.2, 1.0e-9
  end

  describe "wrong files are refused in one line with file, line and column" do
    test "by grammar" do
      assert error("model\n  (\n") == "w/a.world:2:3: the ( here is never closed"
      assert error("model ( size [1 2 )") =~ "w/a.world:1:14: the [ here is never closed"
      assert error("define a (") =~ "w/a.world:1:1: define is written"
      assert error("model ( size )") == "w/a.world:1:9: size has no value"
      assert error("/* a\n b") == "w/a.world:1:1: the comment that begins here has no closing */"
      assert error("a \"b\n\"") == "w/a.world:1:3: the text that begins here has no closing \""
      assert error("x 1.2.3") == "w/a.world:1:3: 1.2.3 is not a number"
      assert error("x 1e99") == "w/a.world:1:3: 1e99 is not a number"
      assert error("\x00") == "w/a.world:1:1: byte 0 is not allowed outside of texts and comments"
      assert error("a \"\xFF\"") =~ "w/a.world:1:3: the text that begins here is not UTF-8"
      assert error("model ()") == "w/a.world: there is no robot in it: no model is a position"
    end

    test "by value" do
      assert error("position ( pose 3 )") ==
               "w/a.world:1:12: pose: expected 3 to 4 numbers, got 3.0"

      assert error("position (\n size [0 1 1] )") =~ "w/a.world:2:2: size: expected more than 0"

      assert error("position ( pose [1 1 \"a\" 0] )") =~
               ~s(expected 3 to 4 numbers, got [1.0 1.0 "a" 0.0])

      assert error("position ( ranger ( sensor ( fov \"wide\" ) ) )") =~
               "fov: expected 1 to 2 numbers"
    end

    test "by what is included" do
      assert error(~s(\ninclude "b.inc")) == "w/a.world:2:1: w/b.inc: no such file or directory"
      assert error("include b") == ~s(w/a.world:1:1: include is written: include "FILE")

      assert error(~s(include "sub/b.inc"), %{"w/sub/b.inc" => ~s(\n include "../a.world")}) ==
               "w/sub/b.inc:2:2: ../a.world includes itself"

      assert error(~s(include "b.inc"), %{"w/b.inc" => "model (\n x"}) ==
               "w/b.inc:2:2: x has no value"
    end
  end

  test "an include is looked for beside its file, then beside the world's" do
    more = %{
      "w/sub/b.inc" => ~s(include "c.inc"\ninclude "d.inc"),
      "w/sub/c.inc" => "define near position ()",
      "w/c.inc" => "define far position ()",
      "w/d.inc" => "define beside position ()"
    }

    used = "near () far () beside ( pose [2 0 0 0] ) position ()"
    world = read!(~s(include "sub/b.inc"\n) <> used, more)
    assert Enum.map(world.robots, & &1.kind) == ["near", "beside", "position"]
    assert world.notes == ["w/a.world:2: far is left out"]
  end

  describe "no file does harm" do
    test "deep nesting, long files, definitions that double" do
      assert error(String.duplicate("model (", 1_000)) =~ "nested more than 30 levels deep"
      assert error("a " <> String.duplicate("[", 1_000)) =~ "nested more than 30 levels deep"
      assert error(String.duplicate("a 1\n", 1_000_001)) =~ "more than 4 MB"

      doubling =
        for k <- 1..60,
            into: "define m0 model ( size [1 1 1] )\n",
            do: "define m#{k} m#{k - 1} ( m#{k - 1} () m#{k - 1} () )\n"

      assert error(doubling <> "m60 ()") =~ "more than 100000 properties"

      includes =
        for k <- 0..60,
            into: %{},
            do: {"w/#{k}.inc", ~s(include "#{k + 1}.inc"\ninclude "#{k + 1}.inc")}

      assert error(~s(include "0.inc"), Map.put(includes, "w/61.inc", "")) =~
               "more than 100 files are included"
    end

    test "random bytes and random words give a world or a line, and no atoms" do
      words =
        ~w|( ) [ ] model position define include "a.inc" size pose 1 -2.5 "x" # /* */ ranger sensor block point[0] =|

      seed = :rand.seed_s(:exsss, {7, 7, 7})
      read(@robot <> "rover ()")
      atoms = :erlang.system_info(:atom_count)

      Enum.reduce(1..2_000, seed, fn n, seed ->
        {length, seed} = :rand.uniform_s(60, seed)

        {parts, seed} =
          Enum.map_reduce(1..length, seed, fn _k, seed ->
            {k, seed} = :rand.uniform_s(if(rem(n, 2) == 0, do: 256, else: length(words)), seed)
            {if(rem(n, 2) == 0, do: <<k - 1>>, else: Enum.at(words, k - 1) <> " "), seed}
          end)

        case read(IO.iodata_to_binary([@robot, "rover (name \"r#{n}\")\n" | parts])) do
          {:ok, world} -> assert [_ | _] = world.robots
          {:error, line} -> assert line =~ ~r/\A[^\n]+\z/
        end

        seed
      end)

      assert :erlang.system_info(:atom_count) - atoms < 500
    end
  end
end
