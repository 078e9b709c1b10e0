defmodule Swarm.CommsTest do
  use Robot.Case, async: false
  @moduletag :realtime
  @moduletag :capture_log
  alias Hal.{Odometry, Pose}
  alias Robot.Mission.Letter
  alias Swarm.{Comms, Directory, Message}
  alias Swarm.Comms.NameClaim
  alias Swarm.Membership.Heartbeat

  # A robot with a comms process that knows where it is.
  defp talking(id, options \\ []) do
    {comms, options} = Keyword.pop(options, :comms, [])
    drive = {Hal.FakeDrive, test: self(), device: id}
    config = config(id, Keyword.put(options, :drive, drive))
    start_supervised!({Robot.Supervisor, Comms.join(config, comms)}, id: id, restart: :temporary)
    place(id)
    until(id, fn _ -> Directory.whereis(id) != nil end)
    id
  end

  defp place(id) do
    odometry = {:odometry, %Odometry{pose: Pose.new(0, 0), twist: Twist.zero()}}
    send(Names.whereis(id, :drive), {:readings, [odometry, {:bumpers, []}]})
  end

  # Reads the board again at each heartbeat, instead of sleeping.
  defp until(id, check, tries \\ 1_000) do
    cond do
      check.(Board.find!(id)) -> :ok
      tries == 0 -> flunk("#{id} did not come to it: #{inspect(Swarm.status(id))}")
      true -> receive(do: (:never -> :ok), after: (20 -> until(id, check, tries - 1)))
    end
  end

  # Odometry is repeated, as from wheels, because a pose that is 300 ms old does not count.
  defp rolls_of(id, tries \\ 1_000) do
    place(id)

    receive do
      {^id, {:drive, %Twist{linear: v, turn: w}}, _} when v != 0 or w != 0 -> :ok
    after
      100 ->
        if tries == 0, do: flunk("#{id} does not roll: #{inspect(Swarm.status(id))}")
        rolls_of(id, tries - 1)
    end
  end

  defp forget(id) do
    receive do
      {^id, {:drive, _}, _} -> forget(id)
    after
      0 -> :ok
    end
  end

  test "a robot that remembers walls by sonar is sent anywhere: it proves nothing beforehand" do
    plan = Nav.OccupancyGrid.new()
    id = talking(:comms_sonar, plan: plan, start: Pose.new(1.0, 1.0))
    until(id, &match?({:ok, %Pose{}, _at_ms}, Board.fetch(&1, :pose, :infinity)))
    assert Swarm.goto(id, {3.0, 1.0}) == :ok
  end

  test "a robot with a floor plan refuses at once to go where it cannot" do
    # Two rooms of 2 x 2 m without a door, and a third that is a cupboard.
    cells =
      for j <- 0..19, i <- 0..49, into: <<>> do
        wall? = i in [0, 20, 21, 42, 49] or j in [0, 19]
        if wall?, do: <<1>>, else: <<0>>
      end

    plan = Nav.Grid.new(cells, {50, 20}, 0.1, {0.0, 0.0})
    id = talking(:comms_plan, plan: plan, start: Pose.new(1.0, 1.0))
    until(id, &match?({:ok, %Pose{}, _at_ms}, Board.fetch(&1, :pose, :infinity)))

    for {place, why} <- [
          {{2.05, 1.0}, "there is a wall"},
          {{-3, 1.0}, "it is outside of the map"},
          {{0.2, 1.0}, "a wall is too near to it"},
          {{3.0, 1.0}, "no way leads there"}
        ] do
      {x, y} = place
      assert Swarm.goto(id, place) == {:error, "#{id} cannot go to #{x / 1},#{y}: #{why}"}
    end

    assert Swarm.status(id).state == :idle
    assert Swarm.goto(id, {1.4, 1.0}) == :ok

    assert Swarm.tell(id, "goto:3:1") ==
             {:error, "#{id} cannot go to 3.0,1.0: no way leads there"}

    # Refused, it goes on with what it was told before.
    assert Swarm.status(id).state == :goto
    rolls_of(id)
  end

  test "robots hear each other, and see silent ones grow old" do
    for id <- [:comms1, :comms2], do: talking(id, start: Pose.new(1, 2))

    until(:comms1, &match?(%{comms2: %{mode: :holding}}, Board.peers(&1)))
    assert %{comms2: %{pose: pose, beat: %Heartbeat{}}} = Board.peers(Board.find!(:comms1))
    assert Pose.distance(pose, {1.0, 2.0}) < 0.01
    until(:comms2, &is_map_key(Board.peers(&1), :comms1))
    stop_supervised!(:comms2)
    until(:comms1, &match?(%{comms2: %{mode: :dead}}, Board.peers(&1)))
  end

  # Two robots do not hear each other; the test hears all.
  def apart(test, from, to, message) do
    to = if to == :all, do: [:comms_a, :comms_b, :comms_c], else: to
    send(test, {:sent, from, to, message})
    cut = %{comms_a: :comms_c, comms_c: :comms_a}
    Swarm.Transport.transmit(from, List.wrap(to) -- [from, cut[from]], message)
  end

  test "a robot forwards between two that do not hear each other, whatever it does itself" do
    [a, b, c] = robots = [:comms_a, :comms_b, :comms_c]
    for id <- robots, do: talking(id, comms: [transport: {__MODULE__, :apart, [self()]}])
    until(c, &match?(%{^a => %{direct_ms: nil}}, Board.peers(&1)))
    until(a, &match?(%{^c => %{direct_ms: nil}}, Board.peers(&1)))

    letter = %Letter{to: :all, mission: __MODULE__, version: 1, kind: :seen, fields: []}
    Comms.say(a, [b, c], letter)

    assert_receive {:sent, ^b, [^c],
                    %Message{kind: :relay, body: %Message{from: ^a, body: ^letter}}}
  end

  test "malformed messages are dropped, counted and shown, and crash nobody" do
    id = talking(:comms3)
    comms = Names.whereis(id, :comms)
    for junk <- [:junk, %{a: 1}, nil, "text", {:robot, 1}], do: Comms.hear(id, junk)
    Comms.hear(id, Message.new(:comms4, :heartbeat, %{boot: "x"}))
    Comms.hear(id, Message.new(:comms4, :round, :nonsense))
    send(comms, :what)
    GenServer.cast(comms, {:unknown, 1})

    until(id, fn board ->
      match?(
        {:ok, %{rejected: %{not_a_message: 7, heartbeat: 1, round: 1}}, _},
        Board.fetch(board, :radio, :infinity)
      )
    end)

    assert %{rejected: %{heartbeat: 1}} = Swarm.status(id)
    assert inspect(Swarm.status(id)) =~ "dropped 9 messages"
    assert Names.whereis(id, :comms) == comms
  end

  test "whatever is sent to a comms process, by cast, call or plain message, crashes nothing of the robot" do
    id = talking(:linkattacked)
    parts = parts(id, [:comms, :pilot, :executive, :gate])
    [comms, pilot | _] = parts
    ref = :erlang.alias([:reply])
    deep = Enum.reduce(1..10_000, [], fn _, deep -> {deep} end)

    junk = [
      :x,
      nil,
      -1.5,
      "text",
      [1 | 2],
      %{},
      {:a, :b, :c},
      deep,
      self(),
      :binary.copy("x", 100_000)
    ]

    for junk <- junk do
      send(comms, junk)

      for {tag, junk} <- [{:"$gen_cast", junk}, {:"$gen_call", junk}, {:rival, junk}],
          do: send(comms, {tag, junk})

      send(comms, {:"$gen_call", {self(), make_ref()}, junk})

      for word <- [:say, :command, :rival, :hear, :result],
          do: GenServer.cast(comms, {word, junk})

      for word <- [:say, :command, :rival], do: GenServer.cast(comms, {word, junk, junk})
      GenServer.cast(comms, {:say, [:mag1], junk})
      GenServer.cast(comms, {:rival, {junk, node()}, self()})
      GenServer.cast(comms, {:command, junk, self()})
      GenServer.cast(comms, {:command, junk, ref})

      for outcome <- [junk, {:error, junk}, {:error, :unheard_of}],
          do: GenServer.cast(comms, {:result, {:delivered, :start, ref}, outcome})

      for word <- [:start, :goto, :move, :follow_the_leader, :find_blob, :position, :subscribe],
          do: GenServer.cast(comms, {:command, {word, junk}, ref})

      GenServer.cast(comms, {:command, {:start, [formation: junk]}, ref})
      GenServer.cast(comms, {:command, {:start, [{:assign, junk}]}, ref})
      GenServer.cast(comms, {:command, {:goto, junk, 1.0, nil}, ref})
      GenServer.cast(comms, {:command, {:formation, junk, junk}, ref})
      GenServer.cast(pilot, junk)
      Comms.hear(id, Message.new(:linkother, :command, junk))
    end

    assert Swarm.ask(id, :stop) == :ok
    assert %{rejected: %{not_a_message: dropped}} = Swarm.status(id)
    assert dropped > 50

    assert Swarm.ask(id, {:goto, :far, 0.0, nil}) |> elem(1) =~
             "goto: expected a number from -10000 to 10000, got :far"

    assert Swarm.ask(id, {:dance, 1}) |> elem(1) =~
             "expected a command of Robot.Command, got {:dance, 1}"

    assert Swarm.ask(id, {:start, [assign: :luck]}) |> elem(1) =~ "assign"
    assert parts(id, [:comms, :pilot, :executive, :gate]) == parts
  end

  test "an e-stop spreads, survives the comms process, and does not stop a robot again after a reset" do
    ids = for id <- [:comms5, :comms6, :comms7], do: talking(id)
    # A drive that has just opened is not armed yet.
    for id <- ids, do: until(id, fn _ -> Swarm.ask(id, {:move, 0.1, 0.0}) == :ok end)
    for id <- ids, do: rolls_of(id)

    # One robot is told; the others hear of it.
    assert Swarm.ask(:comms5, :estop) == :ok
    for id <- ids, do: until(id, &Board.latched?/1)
    kill(:comms6, :comms)
    found = fn -> {Names.whereis(:comms6, :comms), Directory.members({:robot, :comms6})} end
    until(:comms6, fn _ -> match?({comms, [comms]} when comms != nil, found.()) end)
    assert Board.latched?(Board.find!(:comms6))

    # They are reset one by one, and stay released although the others still report the stop.
    for id <- ids, do: assert(Swarm.ask(id, :reset) == :ok)
    for id <- ids, do: refute(Board.latched?(Board.find!(id)))

    # Wishes from before the stop are forgotten: only a new command moves a robot.
    for id <- ids, do: until(id, &match?({:ok, %{by: :rest}, _}, Board.fetch(&1, :doing, 500)))
    for id <- ids, do: forget(id)
    for id <- ids, do: assert(Swarm.ask(id, {:move, 0.1, 0.0}) == :ok)
    for id <- ids, do: rolls_of(id)
    assert Swarm.ask(:comms7, :estop) == :ok
    for id <- ids, do: until(id, &Board.latched?/1)
    # Else it would be repeated to the robots of the next test.
    assert Swarm.reset() == :ok
  end

  test "when the directory crashes, robots drive on, and enter the new one by themselves" do
    id = talking(:comms8)
    assert Swarm.ask(id, {:move, 0.1, 0.0}) == :ok
    rolls_of(id)
    [comms, gate, executive] = parts(id, [:comms, :gate, :executive])
    scope = Process.whereis(Directory)
    monitor = Process.monitor(scope)
    Process.exit(scope, :kill)
    assert_receive {:DOWN, ^monitor, _, _, :killed}
    forget(id)
    until(id, fn _ -> Directory.whereis(id) == comms end)
    rolls_of(id)
    assert parts(id, [:comms, :gate, :executive]) == [comms, gate, executive]
  end

  test "of two robots with the same name the later one gives way" do
    id = talking(:comms9, comms: [boot: 1_000])
    :ok = Hal.Event.attach(:comms9, [:swarm, :comms, :duplicate_id], &__MODULE__.tell/4, self())
    on_exit(fn -> Hal.Event.detach(:comms9) end)
    comms = Names.whereis(id, :comms)
    until(id, fn _ -> Directory.whereis(id) == comms end)

    # A later robot is told who this one is, and nothing changes.
    GenServer.cast(comms, {:rival, {2_000, node()}, self()})
    assert_receive {:"$gen_cast", {:rival, {1_000, _}, ^comms}}
    assert Directory.members({:robot, id}) == [comms]

    # If there is an earlier one, this one stops, and falls silent.
    :ok = Directory.enter(self(), [{:robot, id}])
    GenServer.cast(comms, {:rival, {500, node()}, self()})
    assert_receive {:event, %{robot: ^id}}
    until(id, fn _ -> Directory.members({:robot, id}) == [self()] end)
    {:ok, %{state: :idle}, _} = Board.fetch(Board.find!(id), :mission, :infinity)
    :ok = Directory.leave(self(), [{:robot, id}])
  end

  test "a name is taken back when the other robot has not been heard for ten seconds" do
    name = NameClaim.new(:comms20, {1_000, node()})
    # One heartbeat from another node in its name, with the lowest number of a life.
    assert {%{left?: true} = name, [_, _ | told]} = NameClaim.rival(name, {0, :twin@far}, nil, 0)
    duplicate = {:event, [:swarm, :comms, :duplicate_id], %{other: :twin@far}}
    assert told == [{:cast, :pilot, {:halt, nil, nil}}, duplicate]
    assert {^name, []} = NameClaim.look(name, false, 9_999)
    # Later lives, and itself, do not count; as long as the first is heard, it stays away.
    assert {^name, []} = NameClaim.rival(name, {2_000, :twin@far}, nil, 9_999)
    assert {name, []} = NameClaim.rival(name, {0, :twin@far}, nil, 9_000)
    assert {^name, []} = NameClaim.look(name, false, 18_999)

    # One that is known by the directory alone is there, too.
    assert {name, []} = NameClaim.look(name, true, 19_000)
    assert {^name, []} = NameClaim.look(name, false, 28_999)
    assert {%{left?: false} = name, [_, _, unique]} = NameClaim.look(name, false, 29_000)
    assert unique == {:event, [:swarm, :comms, :unique_id], %{}}
    assert {^name, [_challenge]} = NameClaim.look(name, false, 99_000)
    # And the same again.
    assert {%{left?: true}, [_ | _]} = NameClaim.rival(name, {0, :twin@far}, nil, 100_000)
  end

  @tag long: true, realtime: :long
  test "a robot of which a forged heartbeat said that it was there before speaks again after ten seconds" do
    id = talking(:comms21, comms: [boot: 1_000])
    comms = Names.whereis(id, :comms)
    for event <- [:duplicate_id, :unique_id], do: :ok = listen(id, [:swarm, :comms, event])
    :ok = Comms.rival(id, {0, :twin@far})
    assert_receive {[:swarm, :comms, :duplicate_id], %{robot: ^id}}
    until(id, fn _ -> Directory.members({:robot, id}) == [] end)
    assert_receive {[:swarm, :comms, :unique_id], %{robot: ^id}}, 15_000
    until(id, fn _ -> Directory.members({:robot, id}) == [comms] end)
    until(id, fn _ -> match?({:ok, _}, Swarm.ask(id, :ping)) end)
    assert Swarm.ask(id, {:move, 0.1, 0.0}) == :ok
    rolls_of(id)
  end

  @doc false
  def tell(_event, _measurements, metadata, test), do: send(test, {:event, metadata})

  test "a comms process that crashes takes no other process of the robot along" do
    id = talking(:comms10)
    parts = parts(id, [:gate, :executive, :pilot])
    kill(id, :comms)
    until(id, fn _ -> Directory.whereis(id) != nil and Names.whereis(id, :comms) != nil end)
    assert parts(id, [:gate, :executive, :pilot]) == parts
  end

  test "messages go by a transport from the options" do
    id = talking(:comms11, comms: [transport: {__MODULE__, :carry, [self()]}])
    Comms.say(id, [:mag7, :comms11], Message.new(id, :claim, :start))
    assert_receive {:carried, ^id, [:mag7], %Message{body: :start}}
    assert_receive {:carried, ^id, _all, %Message{kind: :heartbeat}}
  end

  @doc false
  def carry(test, from, ids, message), do: send(test, {:carried, from, ids, message})

  test "what it says is for one robot, for several, or for all others, and never for itself" do
    id = talking(:comms12, comms: [transport: {__MODULE__, :carry, [self()]}])
    message = Message.new(id, :claim, :start)

    for {to, ids} <- [all: :all, comms13: [:comms13]] ++ [{[id, :comms14], [:comms14]}] do
      assert Comms.say(id, to, message) == :ok
      assert_receive {:carried, ^id, ^ids, ^message}
    end
  end

  test "a stop pressed on a robot's own gate spreads, and a newcomer is not stopped by a cleared one" do
    ids = for id <- [:comms15, :comms16], do: talking(id)
    until(:comms16, &is_map_key(Board.peers(&1), :comms15))
    :ok = Gate.estop(:comms15)
    for id <- ids, do: until(id, &Board.latched?/1)

    says = fn id, other, held? ->
      until(id, fn board ->
        case Board.peers(board) do
          %{^other => %{beat: %{estop: tags}}} -> tags != [] == held?
          _not_heard -> false
        end
      end)
    end

    pairs = [ids, Enum.reverse(ids)]
    for [id, other] <- pairs, do: says.(id, other, true)
    assert Swarm.reset() == :ok
    # A heartbeat from before the reset may still be under way, and would stop a newcomer.
    for [id, other] <- pairs, do: says.(id, other, false)

    talking(:comms17)
    until(:comms17, &is_map_key(Board.peers(&1), :comms15))
    refute Board.latched?(Board.find!(:comms17))

    # Its own stop is new to the others.
    assert Swarm.ask(:comms17, :estop) == :ok
    assert Board.latched?(Board.find!(:comms17))
    for id <- ids, do: until(id, &Board.latched?/1)
    assert Swarm.reset() == :ok
  end

  test "many robots of one node hear each other, five times a second" do
    ids = for k <- 1..12, do: talking(:"linkmany#{k}")
    [first, second | _] = Swarm.Case.standing(ids)

    beat = fn ->
      case Board.peers(Board.find!(first)) do
        %{^second => %{beat: beat}} -> beat
        _not_yet -> %{sequence: 0, heard: <<>>}
      end
    end

    until(first, fn _ -> ids -- [second | Swarm.Membership.NameSet.names(beat.().heard)] == [] end)

    {begun, from} = {System.monotonic_time(:millisecond), beat.().sequence}
    until(first, fn _ -> beat.().sequence >= from + 6 end)
    assert (System.monotonic_time(:millisecond) - begun) in 900..6_000
  end
end
