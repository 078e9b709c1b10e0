defmodule Swarm.CommandsTest.Tacks do
  @moduledoc "Goes at a speed, as a behaviour of one's own."
  @behaviour Robot.Behaviour
  alias Hal.{Options, Twist}

  @impl Robot.Behaviour
  def option_table do
    legs = [{:list, {:integer, 0, 9, "m"}, 9}, default: []]
    [speed: [{:number, 0, 1, "m/s"}, default: 0.1], legs: legs]
  end

  @impl Robot.Behaviour
  def new(options), do: {__MODULE__, Options.check!(options, option_table(), "tacks")}

  @impl Robot.Behaviour
  def tick(_percept, options) do
    wish = Robot.Wish.new(:tacks, %{Twist.zero() | linear: options[:speed]}, 0.5)
    {:running, wish, {__MODULE__, options}}
  end
end

defmodule Swarm.CommandsTest do
  use Swarm.Case, async: false
  @moduletag :realtime
  @moduletag :capture_log
  alias Swarm.CommandsTest.Tacks

  defp line({:error, line}) do
    assert is_binary(line)
    refute line =~ "\n"
    line
  end

  defp state(id),
    do: Board.fetch(Board.find!(id), :mission, :infinity) |> elem(1) |> Map.fetch!(:state)

  defp mission(id) do
    {_phase, %{state: %{runner: %{mission: mission}}}} = :sys.get_state(Names.whereis(id, :pilot))
    mission
  end

  # A camera that shows nothing, and the colours that it looks for.
  defp eyes do
    box = %{y: {80, 240}, u: {60, 90}, v: {130, 145}}
    classes = for name <- ["Yellow", "Red"], do: Map.put(box, :name, name)
    {:ok, colours} = Vision.Colours.new(classes)
    [camera: {Hal.FakeCamera, test: self(), device: :camera}, colours: colours]
  end

  # The behaviour that drives the robot now.
  defp doing(id) do
    with {:ok, %{by: behaviour}, _age} <- Board.fetch(Board.find!(id), :doing, 300), do: behaviour
  end

  # Wheels that report, ten times a second, that the robot turns left: one turn in 1.3 s.
  defp turning(id) do
    turn = fn n -> stand(id, Pose.new(0, 0, Pose.wrap(0.5 * n))) end
    start_supervised!({Task, fn -> Enum.each(Stream.interval(100), turn) end}, id: {:turning, id})
  end

  test "single commands work from idle and replace each other" do
    id = robot(:door1, eyes())
    standing([id])
    assert order(fn -> Swarm.goto(id, {2.0, 1}) end) == :ok
    assert state(id) == {Robot.Mission.Manual, :goto}
    eventually(fn -> doing(id) == :goto end)

    assert order(fn -> Swarm.tell("door1", "MOVE:0.1:0") end) == :ok
    eventually(fn -> doing(id) == :move end)

    assert %Swarm.Status{state: :move, robot: :door1} = Swarm.status(id)
    assert order(fn -> Swarm.stop(id) end) == :ok
    assert state(id) == :idle
    eventually(fn -> doing(id) == :rest end)

    assert order(fn -> Swarm.tell([id], "findblob:Yellow") end) == :ok
    assert order(fn -> Swarm.tell(id, "lead") end) == :ok
    assert {:ok, "door1 on " <> _} = Swarm.tell(id, "ping")
    assert order(fn -> Swarm.goto(id, {1, 2, 1.5}) end) == :ok
    assert order(fn -> Swarm.goto(id, Pose.new(1, 2)) end) == :ok
  end

  test "an unknown colour is refused with the colours that the robot looks for" do
    id = robot(:command_sees, eyes())
    blind = robot(:command_blind)
    standing([id, blind])

    assert Swarm.tell(id, "findblob:Blue") ==
             {:error, ~s(command_sees does not know the colour "Blue"; it looks for Yellow, Red)}

    assert state(id) == :idle
    assert order(fn -> Swarm.tell(id, "findblob") end) == :ok
    assert Swarm.tell(blind, "findblob") == {:error, "command_blind has no camera to look with"}

    assert Swarm.tell(blind, "look:1") ==
             {:error, "command_blind has no camera that it could turn"}

    assert order(fn -> Swarm.tell(id, "findblob:Red") end) == :ok
    assert state(id) == {Robot.Mission.Manual, :find_blob}
    # A full turn shows nothing.
    :ok = stop_supervised({:wheels, [id, blind]})
    turning(id)
    eventually(fn -> Swarm.status(id).state == :not_found end)
  end

  test "robots follow each other, but not in a circle" do
    [a, b, c] = for k <- 1..3, do: robot(:"command_follow#{k}")
    standing([a, b, c])
    assert line(Swarm.follow(a, a)) =~ "itself"
    assert order(fn -> Swarm.follow(a, b) end) == :ok
    assert order(fn -> Swarm.follow(b, c) end) == :ok

    leader = fn id, of ->
      match?({:ok, %{beat: %{leader: ^of}}, _}, Board.fetch(Board.find!(c), {:peer, id}, 1_000))
    end

    eventually(fn -> leader.(a, b) and leader.(b, c) end)
    assert line(Swarm.follow(c, a)) =~ "command_follow1 -> command_follow2 -> command_follow3"
    assert line(Swarm.tell(c, "followtheleader:nobody")) =~ "nobody"
    assert order(fn -> Swarm.stop([a, b]) end) == :ok
    eventually(fn -> leader.(a, nil) end)
    assert order(fn -> Swarm.follow(c, a) end) == :ok
  end

  test "a person writes to the mission that a robot runs; its table says what is wrong, and the e-stop holds it as an order" do
    id = robot(:command_flock)
    standing([id])
    line = line(Swarm.tell(id, "send:leg:leg=2"))
    assert line == "command_flock: it has no mission that could hear a message; start it first"

    assert order(fn -> Swarm.start(:flock, robots: [id], course: [{0, 0}, {9, 0}]) end) == :ok
    eventually(fn -> match?({Missions.Flock, phase} when phase != :idle, state(id)) end)
    assert order(fn -> Swarm.tell(id, "send:leg:leg=2") end) == :ok
    assert mission(id).leg == 2
    assert {Missions.Flock, :flock} = state(id)

    assert line(Swarm.tell(id, {:send, "leg:leg=0"})) ==
             "command_flock: message leg option leg: expected a whole number from 1 to 65, got 0"

    assert line(Swarm.tell(id, "send:member:leg=3")) =~ "flock hears of people leg"
    assert line(Swarm.tell(id, {:send, <<255>>})) =~ "not text"
    assert order(fn -> Swarm.estop() end) == :ok
    assert line(Swarm.tell(id, "send:leg:leg=3")) =~ "is held by the emergency stop"
    assert order(fn -> Swarm.reset() end) == :ok
  end

  test "the mission starts, takes a formation, stops, and a robot that is sent elsewhere leaves it" do
    id = robot(:command_group)
    assert line(Swarm.formation(:wedge)) =~ "start it first"
    assert order(fn -> Swarm.start(robots: [id], formation: :line) end) == :ok
    assert {Missions.Landmark, _} = state(id)
    standing([id])
    eventually(fn -> state(id) != {Missions.Landmark, :idle} end)
    assert order(fn -> Swarm.formation(:wedge, spacing: 1.2) end) == :ok
    assert order(fn -> Swarm.formation("column") end) == :ok
    assert order(fn -> Swarm.stop(id) end) == :ok
    assert state(id) == :idle
    assert order(fn -> Swarm.start() end) == :ok
    assert {Missions.Landmark, _} = state(id)
    eventually(fn -> state(id) != {Missions.Landmark, :idle} end)
    # The last requested shape.
    assert {:column, 1.0} = mission(id).formation
    assert order(fn -> Swarm.goto(id, {1, 1}) end) == :ok
    assert state(id) == {Robot.Mission.Manual, :goto}
    assert order(fn -> Swarm.start() end) == :ok
    assert {Missions.Landmark, _} = state(id)
  end

  test "a mission is started by its name, in words, or by its module; a wrong name starts nothing" do
    id = robot(:command_named)
    standing([id])
    assert order(fn -> Swarm.start(:landmark, formation: :wedge) end) == :ok
    assert %{formation: {:wedge, 1.0}} = mission(id)
    assert order(fn -> Swarm.tell(id, "start:landmark:formation=line:1.5") end) == :ok
    assert %{formation: {:line, 1.5}} = mission(id)
    assert order(fn -> Swarm.start(Robot.Mission.Manual, robots: [id]) end) == :ok
    assert {Robot.Mission.Manual, _} = state(id)
    assert order(fn -> Swarm.start("landmark") end) == :ok
    assert {Missions.Landmark, _} = state(id)

    for wrong <- [
          Swarm.start(:landmrk),
          Swarm.start("landmrk", robots: [id]),
          Swarm.tell(id, "start:landmrk")
        ],
        do:
          assert(
            line(wrong) =~ ~r/^mission :?"?landmrk"? is not known; .* did you mean :?landmark\?$/
          )

    assert line(Swarm.start(:landmark, formatoin: :line)) =~ "did you mean formation?"
    assert line(Swarm.start(:landmark, 5)) =~ "5"
    # Even if it is sent past the public interface.
    assert line(Swarm.ask(id, {:start, Enum, []})) =~ "mission Enum is not known"

    assert line(Swarm.ask(id, {:start, :landmark, [assign: :luck]})) =~
             ~r/assign: expected .*, got :luck/

    assert line(Swarm.ask(id, {:start, "landmark", []})) =~ "expected a command"
    assert {Missions.Landmark, _} = state(id)
  end

  test "behaviours drive one robot by their names" do
    id = robot(:command_behaves)
    standing([id])

    for {text, name} <- [{"wander", :wander}, {"square:0.5", :goto}, {"rest", :rest}] do
      assert order(fn -> Swarm.tell(id, text) end) == :ok
      eventually(fn -> doing(id) == name end)
    end

    assert line(Swarm.tell(id, "square:50")) ==
             "square: expected a side from 0.2 to 10.0 m, got 50.0"

    assert line(Swarm.tell(id, "wandr")) =~ "did you mean wander?"
  end

  test "a behaviour of one's own is run by its name, and by nothing else" do
    Application.put_env(:swarm, :behaviours, tacks: Tacks, drift: Robot.Behaviour.Wander)
    on_exit(fn -> Application.delete_env(:swarm, :behaviours) end)
    id = robot(:command_runs)
    standing([id])

    assert order(fn -> Swarm.tell(id, "run:tacks:legs=[1,2]") end) == :ok
    assert state(id) == {Robot.Mission.Manual, :run}
    eventually(fn -> doing(id) == :tacks end)
    assert order(fn -> Swarm.run(:all, :drift) end) == :ok
    eventually(fn -> doing(id) == :wander end)
    assert order(fn -> Swarm.run(id, "tacks", speed: 0.2) end) == :ok
    eventually(fn -> doing(id) == :tacks end)

    known = "expected tacks or drift"

    assert line(Swarm.run(id, :tcaks)) ==
             "behaviour :tcaks is not known; #{known}; did you mean tacks?"

    assert line(Swarm.tell(id, "run:tcaks")) =~ known
    assert line(Swarm.tell(id, "run:tacks:sped=1")) =~ "option sped is not known"

    assert line(Swarm.run(id, :tacks, speed: 9)) =~
             "speed: expected a number from 0 to 1 m/s, got 9"

    assert line(Swarm.run(id, :tacks, 5)) =~ "expected options [key: value, …], got 5"
    assert line(Swarm.tell(id, "run:drift:speed=1")) == "drift takes no options as text"
    assert line(Swarm.start(:tacks)) =~ "tacks is a behaviour: run:tacks"

    # What comes past the public interface: no module without a name, and no wrong options.
    assert line(Swarm.ask(id, {:run, Robot.Behaviour.Goto, [x: 1, y: 1]})) =~
             "behaviour Robot.Behaviour.Goto is not known"

    assert line(Swarm.ask(id, {:run, Tacks, [speed: :fast]})) =~ "got :fast"
    assert line(Swarm.ask(id, {:run, Tacks, 5})) =~ "expected a command"
    Application.put_env(:swarm, :behaviours, [])
    assert line(Swarm.run(id, :tacks)) =~ "none has a name (config :swarm, behaviours: …)"
  end

  test "a formation is :ok only when all on the mission have it; a robot that does not answer is named" do
    for id <- [:shape1, :shape2, :shape3], do: robot(id)
    standing([:shape1, :shape2, :shape3])
    assert order(fn -> Swarm.start(robots: [:shape1, :shape2]) end) == :ok
    # The third is not on a mission.
    assert order(fn -> Swarm.formation(:wedge) end) == :ok
    comms = Names.whereis(:shape2, :comms)
    :ok = :sys.suspend(comms)
    told = "shape2 does not answer; the others accepted it"
    assert Swarm.formation(:column) == {:error, told}
    :ok = :sys.resume(comms)
    assert order(fn -> Swarm.estop() end) == :ok
    assert {:error, line} = Swarm.formation(:wedge)
    assert line =~ "shape1 is held by the emergency stop; reset it first; shape2 is held by"
    assert order(fn -> Swarm.reset() end) == :ok
  end

  test "wrong input is one line that says what is allowed, and never raises" do
    id = robot(:command_wrong)
    assert line(Swarm.goto(:command_wrnog, {1, 1})) =~ "did you mean command_wrong?"
    assert line(Swarm.goto(id, {:nan, 1})) =~ "number"
    assert line(Swarm.formation(:wegde)) =~ "did you mean :wedge?"

    assert line(Swarm.formation(:line, length: "4")) =~
             ~s(line option length: expected a number from 0.0 to 1.0e3 m)

    assert line(Swarm.start(assign: :luck)) =~ ":chain or :cost"
    assert line(Swarm.start(leader_chnage: true)) =~ "did you mean leader_change?"

    wrong = [
      nil,
      :nobody,
      "nobody",
      1,
      1.5,
      {},
      {1},
      %{},
      [],
      [nil],
      [id | id],
      [[id]],
      self(),
      "",
      -1,
      {1, :inf},
      {nil, nil}
    ]

    for term <- wrong do
      line(Swarm.goto(term, {1, 1}))
      line(Swarm.goto(id, term))
      line(Swarm.follow(term, id))
      line(Swarm.follow(id, term))
      line(Swarm.tell(term, "ping"))
      line(Swarm.tell(id, term))
      line(Swarm.status(term))
      line(Swarm.stop(term))
      line(Swarm.formation(term))
      if term != [], do: line(Swarm.formation(:wedge, term))
      if term != [], do: line(Swarm.start(term))
      line(Swarm.formation(:wedge, spacing: term))
      line(Swarm.start(formation: term))
      line(Swarm.start(robots: term))
    end
  end

  test "a robot that does not answer is named after half a second, while it still does not" do
    id = robot(:command_deaf)
    :ok = :sys.suspend(Names.whereis(id, :comms))
    {took, answer} = :timer.tc(fn -> Swarm.goto(id, {1, 1}) end)
    assert line(answer) == "command_deaf does not answer"
    assert took >= 450_000

    assert Enum.any?(Swarm.status(), &match?(%{robot: :command_deaf, state: :no_answer}, &1))
    # A stop does not go through the comms process.
    assert order(fn -> Swarm.stop(id) end) == :ok
    :ok = :sys.resume(Names.whereis(id, :comms))
    assert %Swarm.Status{} = Swarm.status(id)
    refute_received {_alias, :command_deaf, _answer}
  end
end
