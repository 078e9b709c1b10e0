defmodule Lab.BodiesTest do
  @moduledoc "Fleets of any bodies and any names, in lockstep: they form, their runs replay, and what is wrong is one line."
  use Lab.LockstepCase, async: true
  alias Lab.{Recording, Replay, Run, Trial}
  alias Lab.Trial.Setup
  alias Sim.World

  @mixed [:burger1, :burger2, :mag1, :mag2]

  test "burgers and Magellans form in the hall, without a collision" do
    {:ok, trial} = Trial.new(%{robots: @mixed, seed: 3, plan: :known, duration_s: 120})
    result = trial |> Run.play() |> Trial.result()
    assert Enum.any?(result.stages, &(&1.stage == :formed))
    assert result.collisions == 0
  end

  # As the file holds it.
  defp replayed(options, ticks) do
    {:ok, setup} = Trial.setup(options)
    {:ok, read} = Recording.read_start(Recording.start(setup))

    {trial, replay} =
      Enum.reduce(1..ticks, {Trial.begin(setup, record: true), Replay.new(read)}, fn _, {t, r} ->
        {entries, t} = t |> Trial.step() |> Trial.take_entries()
        {:ok, tick} = {t.at_ms, entries} |> Recording.tick() |> Recording.read_tick()
        {r, differences} = Replay.step(r, tick)
        assert differences == []
        {t, r}
      end)

    assert Replay.trial(replay).world == trial.world
    trial
  end

  test "a run of any bodies replays to the byte" do
    replayed(%{robots: @mixed, seed: 3, plan: :known}, 100)
    robots = [:create2_1, :kobuki1, :pioneer3_1, :waffle1, :rex]
    trial = replayed(%{robots: robots, bodies: [rex: :atrv_mini], seed: 1, plan: :known}, 100)
    assert trial.world.robots.rex.profile == Hal.Profile.atrv_mini()
  end

  test "a reader learns the names of robots and bodies from the recording, and nothing else" do
    {:ok, body} = Robot.File.Bodies.fetch("kobuki")
    body = %{body | name: :body_of_a_test}
    {:ok, setup} = Trial.setup(%{robots: [:robot_of_a_test], bodies: [robot_of_a_test: body]})
    {:convoy, version, names, start} = :erlang.binary_to_term(Recording.start(setup))
    assert Enum.sort(names) == ["body_of_a_test", "robot_of_a_test"]

    # The same from a machine whose names nobody here knows.
    start = start |> :erlang.binary_to_term() |> :erlang.term_to_binary()
    number = Integer.to_string(1_000 + rem(System.unique_integer([:positive]), 1_000))
    strange = fn text -> String.replace(text, "_of_a_test", "_of_a_" <> number) end
    write = &:erlang.term_to_binary({:convoy, version, &1, strange.(start)})
    known? = fn -> Hal.ExternalTerm.atom("robot_of_a_" <> number) != :error end

    assert {:error, "begins with something that this program did not record"} =
             Recording.read_start(write.([]))

    refute known?.()
    assert {:ok, %Setup{robots: [robot]}} = Recording.read_start(write.(Enum.map(names, strange)))
    assert known?.()
    assert Atom.to_string(robot.id) == "robot_of_a_" <> number
    assert Atom.to_string(robot.profile.name) == "body_of_a_" <> number

    assert {:error, "names what is no name" <> _} = Recording.read_start(write.(["two words"]))
    assert {:error, "has more than 1000 names" <> _} = Recording.read_start(write.(many(number)))
  end

  defp many(number), do: for(n <- 1..1_001, do: "one_of_#{n}_names_#{number}")

  test "each body drives in a world, and reports what it has" do
    {:ok, map} = Sim.Floorplan.open("hall", 1)

    for body <- Robot.File.Bodies.all() do
      robot = %{id: :rex, profile: body, pose: Hal.Pose.new(0, 0)}
      world = World.new!(map: map, robots: [robot], noise: :off)
      world = World.drive(world, :rex, Hal.Twist.new(0.2, 0.0))
      world = Enum.reduce(1..40, world, fn _, world -> World.step(world, 50) end)
      assert World.truth(world, :rex).x > 0.1
      senses = for {sense, _} <- World.readings(world, :rex), do: sense
      assert :sonar in senses == (body.sonars != [])
      assert :ptz in senses == (body.camera != nil)
      assert World.camera?(world, :rex) == (body.camera != nil)
      assert :odometry in senses and :bumpers in senses
    end
  end

  test "bumpers of the front half feel nothing behind" do
    {:ok, map} = Sim.Floorplan.open("hall", 2)
    {:ok, kobuki} = Robot.File.Bodies.fetch("kobuki")

    for {speed, felt?} <- [{0.3, true}, {-0.3, false}] do
      x = if speed > 0, do: 0.6, else: -0.6

      robots = [
        %{id: :rex, profile: kobuki, pose: Hal.Pose.new(0, 0)},
        %{id: :post, profile: kobuki, pose: Hal.Pose.new(x, 0)}
      ]

      world = World.new!(map: map, robots: robots, noise: :off, landmark: nil)
      world = World.drive(world, :rex, Hal.Twist.new(speed, 0.0))
      world = Enum.reduce(1..60, world, fn _, world -> World.step(world, 50) end)
      assert world.collisions == 1
      {:bumpers, pressed} = world |> World.readings(:rex) |> List.keyfind(:bumpers, 0)
      assert pressed == if(felt?, do: [0], else: [])
    end
  end

  test "the body of a robot is found by the longest name that fits" do
    {:ok, bodies} =
      Trial.Options.bodies([:rover1, :rover_b, :mag3, :min2], rover: :kobuki, rover_b: :create2)

    assert Map.new(bodies, fn {id, body} -> {id, body.name} end) ==
             %{rover1: :kobuki, rover_b: :create2, mag3: :magellan, min2: :atrv_mini}

    {:ok, setup} = Trial.setup(%{robots: [:mag1], bodies: [mag1: :kobuki]})
    assert [%{profile: %{name: :kobuki}}] = setup.robots
  end

  test "a scenario names robots of any body, and any robots as text, whose bodies it says" do
    text = """
    [
      robots: ["rex_of_a_scenario", "mag1"],
      bodies: [rex: "kobuki"],
      script: [{1, {:kill, :rex_of_a_scenario}}],
      expect: [{:never, :collision}]
    ]
    """

    assert {:ok, scenario} = Lab.Scenario.File.parse(text)
    assert [rex, :mag1] = scenario.options[:robots]
    assert Atom.to_string(rex) == "rex_of_a_scenario"
    assert scenario.options[:bodies] == [rex: "kobuki"]
    assert Lab.Scenario.File.parse(Lab.Scenario.File.text(scenario)) == {:ok, scenario}
    assert {:ok, _scenario} = Lab.Scenario.File.parse("[robots: [:burger1, :create2_2]]")
    assert {:error, [line]} = Lab.Scenario.File.parse("[robots: [\"Rex\"]]")

    assert line =~
             "scenario:1: robots: expected a number of robots, 1 to 100, or a list of names, "

    assert {:error, [line]} = Lab.Scenario.File.parse("[robots: [:dog_of_a_scenario]]")
    assert line =~ "got [:dog_of_a_scenario]"
  end

  test "what is wrong with names and bodies is one line" do
    for {options, begins} <- [
          {%{robots: [:rex]}, "the body of robot rex: no body is named rex: there are burger, "},
          {%{robots: [:mag1], bodies: [mag: :magelan]},
           "the body of robot mag1: no body is named magelan: there are burger, "},
          {%{robots: [:mag1], bodies: [mag: 5]},
           "trial option bodies: expected [rover: :kobuki, mag3: :atrv_mini], bodies by what robots' names begin with, got "},
          {%{robots: [:Mag]}, "trial option robots: expected a list of different names, "},
          {%{robots: [:mag1, :mag1]},
           "trial option robots: expected a list of different names, "},
          {%{robots: [:pioneer3_1], hardware: [:pioneer3_1]},
           "pioneer3_1 cannot be hardware: its body names no controller "}
        ] do
      assert {:error, line} = Setup.new(options)
      assert String.starts_with?(line, begins), line
      refute line =~ "\n"
    end
  end
end
