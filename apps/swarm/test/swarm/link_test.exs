defmodule Swarm.LinkTest do
  use Robot.Case, async: false
  @moduletag :capture_log
  alias Hal.{Odometry, Pose}
  alias Swarm.{Directory, Heartbeat, Link, Message}

  # A robot that talks, and knows where it is.
  defp talking(id, options \\ []) do
    {link, options} = Keyword.pop(options, :link, [])
    drive = {Hal.FakeDrive, test: self(), device: id}
    config = config(id, Keyword.put(options, :drive, drive))
    start_supervised!({Robot.Supervisor, Link.join(config, link)}, id: id, restart: :temporary)
    place(id)
    until(id, fn _ -> Directory.whereis(id) != nil end)
    id
  end

  defp place(id) do
    odometry = {:odometry, %Odometry{pose: Pose.new(0, 0), twist: Twist.zero()}}
    send(Names.whereis(id, :drive), {:readings, [odometry, {:bumpers, []}]})
  end

  # Reads the board again at each heartbeat, instead of sleeping.
  defp until(id, check, tries \\ 100) do
    cond do
      check.(Board.find!(id)) -> :ok
      tries == 0 -> flunk("#{id} did not come to it: #{inspect(Swarm.status(id))}")
      true -> receive(do: (:never -> :ok), after: (20 -> until(id, check, tries - 1)))
    end
  end

  # Odometry comes again and again, as from wheels: a place that is 300 ms old is none.
  defp rolls_of(id, tries \\ 10) do
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

  test "robots hear each other, and see each other grow old" do
    for id <- [:link1, :link2], do: talking(id, start: Pose.new(1, 2))

    until(:link1, &match?(%{link2: %{mode: :holding}}, Board.peers(&1)))
    assert %{link2: %{pose: pose, beat: %Heartbeat{}}} = Board.peers(Board.find!(:link1))
    assert Pose.distance(pose, {1.0, 2.0}) < 0.01
    until(:link2, &is_map_key(Board.peers(&1), :link1))
    stop_supervised!(:link2)
    until(:link1, &match?(%{link2: %{mode: :dead}}, Board.peers(&1)), 200)
  end

  test "what is malformed is dropped, counted and shown, and crashes nobody" do
    id = talking(:link3)
    link = Names.whereis(id, :link)
    for junk <- [:junk, %{a: 1}, nil, "text", {:robot, 1}], do: Link.hear(id, junk)
    Link.hear(id, Message.new(:link4, :heartbeat, %{boot: "x"}))
    Link.hear(id, Message.new(:link4, :round, :nonsense))
    send(link, :what)
    GenServer.cast(link, {:unknown, 1})

    until(id, fn board ->
      match?(
        {:ok, %{rejected: %{not_a_message: 7, heartbeat: 1, round: 1}}, _},
        Board.fetch(board, :radio, :infinity)
      )
    end)

    assert %{radio: {%{rejected: %{heartbeat: 1}}, _age}} = Swarm.status(id)
    assert Names.whereis(id, :link) == link
  end

  test "an e-stop spreads, survives the link, and is not caught again after a reset" do
    ids = for id <- [:link5, :link6, :link7], do: talking(id)
    for id <- ids, do: assert(Swarm.ask(id, {:move, 0.1, 0.0}) == :ok)
    for id <- ids, do: rolls_of(id)

    # One is told; the others hear of it.
    assert Swarm.ask(:link5, :estop) == :ok
    for id <- ids, do: until(id, &Board.latched?/1)
    kill(:link6, :link)
    until(:link6, fn _ -> Names.whereis(:link6, :link) != nil end)
    assert Board.latched?(Board.find!(:link6))

    # One after the other is reset, and stays so though the others still tell of the stop.
    for id <- ids, do: assert(Swarm.ask(id, :reset) == :ok)
    for id <- ids, do: forget(id)
    for id <- ids, do: rolls_of(id)
    for id <- ids, do: refute(Board.latched?(Board.find!(id)))
    assert Swarm.ask(:link7, :estop) == :ok
    for id <- ids, do: until(id, &Board.latched?/1)
  end

  test "the directory falls: robots drive on, and enter the new one by themselves" do
    id = talking(:link8)
    assert Swarm.ask(id, {:move, 0.1, 0.0}) == :ok
    rolls_of(id)
    [link, gate, executive] = parts(id, [:link, :gate, :executive])
    scope = Process.whereis(Directory)
    monitor = Process.monitor(scope)
    Process.exit(scope, :kill)
    assert_receive {:DOWN, ^monitor, _, _, :killed}
    forget(id)
    until(id, fn _ -> Directory.whereis(id) == link end)
    rolls_of(id)
    assert parts(id, [:link, :gate, :executive]) == [link, gate, executive]
  end

  test "of two robots of one name the later one gives way" do
    id = talking(:link9, link: [boot: 1_000])
    :ok = Hal.Event.attach(:link9, [:swarm, :link, :duplicate_id], &__MODULE__.tell/4, self())
    on_exit(fn -> Hal.Event.detach(:link9) end)
    link = Names.whereis(id, :link)
    until(id, fn _ -> Directory.whereis(id) == link end)

    # A later one is told so, and nothing changes.
    GenServer.cast(link, {:rival, {2_000, node()}, self()})
    assert_receive {:"$gen_cast", {:rival, {1_000, _}, ^link}}
    assert Directory.members({:robot, id}) == [link]

    # In the presence of an earlier one this one stops, and falls silent.
    :ok = Directory.enter(self(), [{:robot, id}])
    GenServer.cast(link, {:rival, {500, node()}, self()})
    assert_receive {:event, %{robot: ^id}}
    assert Directory.members({:robot, id}) == [self()]
    {:ok, %{state: :idle}, _} = Board.fetch(Board.find!(id), :mission, :infinity)
    :ok = Directory.leave(self(), [{:robot, id}])
  end

  @doc false
  def tell(_event, _measurements, metadata, test), do: send(test, {:event, metadata})

  test "a link that falls takes nothing of the robot along" do
    id = talking(:link10)
    parts = parts(id, [:gate, :executive, :pilot])
    kill(id, :link)
    until(id, fn _ -> Directory.whereis(id) != nil and Names.whereis(id, :link) != nil end)
    assert parts(id, [:gate, :executive, :pilot]) == parts
  end

  test "a transport of one's own" do
    id = talking(:link11, link: [transport: {__MODULE__, :carry, [self()]}])
    Link.say(id, [:mag7, :link11], Message.new(id, :command, :start))
    assert_receive {:carried, ^id, [:mag7], %Message{body: :start}}
    assert_receive {:carried, ^id, _all, %Message{kind: :heartbeat}}, 500
  end

  @doc false
  def carry(test, from, ids, message), do: send(test, {:carried, from, ids, message})

  describe "the door" do
    test "one robot is sent, stopped, asked" do
      id = talking(:door1)
      assert Swarm.goto(id, {2, 1}) == :ok
      assert Swarm.goto(:nobody, {2, 1}) == {:error, :unknown}
      assert {:error, line} = Swarm.goto(id, {1.0e9, 0})
      assert line =~ "1000000"
      rolls_of(id)
      assert %{mission: {%{state: {Swarm.Missions.Manual, :goto}}, _}} = Swarm.status(id)
      assert Swarm.stop(id) == :ok
      assert %{mission: {%{state: {Swarm.Missions.Manual, :ready}}, _}} = Swarm.status(id)
      assert {:error, line} = Swarm.follow(id, id)
      assert line =~ "itself"
      assert Swarm.follow(id, :door9) == :ok
      assert Swarm.start(id) == {:error, :no_mission}
      assert Swarm.status(:nobody) == {:error, :unknown}
    end

    test "commands in words" do
      for id <- [:door6, :door7], do: talking(id)
      assert Swarm.tell(:door6, "goto:2.0:1.0") == :ok
      assert Swarm.tell([:door6, :door7], "ping") == %{door6: :ok, door7: :ok}
      assert Swarm.tell(:all, "stop") == %{door6: :ok, door7: :ok}
      assert Swarm.tell(:door6, "followtheleader:door7") == :ok
      assert {:error, line} = Swarm.tell(:door6, "followtheleader:mag77")
      assert line =~ "mag77"
      assert {:error, line} = Swarm.tell(:all, "goto:abc:1")
      assert line =~ "abc"
      assert {:error, _line} = Swarm.tell(:door6, nil)
      assert Swarm.tell(:door7, "subscribe:door6") == {:error, :idle}
    end

    test "all begin their mission, take a shape, and stop" do
      mission = {Acts.Mission, test: self()}
      ids = for id <- [:door2, :door3], do: talking(id, mission: mission)
      assert Swarm.formation(:wedge) == %{door2: {:error, :idle}, door3: {:error, :idle}}
      assert Swarm.start() == %{door2: :ok, door3: :ok}
      for _ <- ids, do: assert_receive({:mission, {:command, :start}})
      # Once more does not begin it anew.
      for _ <- ids, do: assert_received({:mission, {:init, _}})
      assert Swarm.start([:door2, :nobody]) == %{door2: :ok, nobody: {:error, :unknown}}
      refute_received {:mission, {:init, _}}
      assert Swarm.formation(:wedge, spacing: 1.2) == %{door2: :ok, door3: :ok}
      for _ <- ids, do: assert_receive({:mission, {:command, {:formation, :wedge, 1.2}}})
      assert {:error, line} = Swarm.formation(:heart)
      assert line =~ "heart"
      assert Swarm.stop(:all) == %{door2: :ok, door3: :ok}
      for _ <- ids, do: assert_receive({:mission, {:command, :stop}})
      assert %{door2: %{mission: _}, door3: %{mission: _}} = Swarm.status()
    end

    test "a robot that does not answer holds up nobody, and its late answer finds no mailbox" do
      for id <- [:door4, :door5], do: talking(id)
      link = Names.whereis(:door4, :link)
      :ok = :sys.suspend(link)
      assert Swarm.estop() == %{door4: {:error, :no_answer}, door5: :ok}
      :ok = :sys.resume(link)
      until(:door4, &Board.latched?/1)
      assert Swarm.reset() == %{door4: :ok, door5: :ok}
      {:messages, messages} = Process.info(self(), :messages)
      refute Enum.any?(messages, &match?({ref, _} when is_reference(ref), &1))
    end
  end
end
