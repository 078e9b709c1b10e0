defmodule Swarm.MemberTest do
  @moduledoc "No message crashes a member; an emergency stop reaches everybody."
  use ExUnit.Case, async: true
  alias Hal.{Odometry, Pose, Profile, Twist}
  alias Swarm.{Member, Message}
  alias Missions.Landmark.{Beat, Reference}
  alias Swarm.Agreement.Round
  alias Swarm.Membership.Heartbeat

  @beat Beat.new(pose: {900, 0, 0}, phase: :search)
  @anchor %Reference{
    leader: :mag2,
    epoch: 1,
    sequence: 1,
    pose: {0, 0, 0},
    twist: {0, 0},
    formation: {:wedge, 1.0},
    order: [:mag1, :mag3],
    size: 3,
    places: [1, 2]
  }
  @report %{merit: 5, pose: {1, 2, 3}, led: 0, of: 0}
  @letter %Round.Letter{
    id: {1, 1, :mag2},
    view: [:mag1, :mag2],
    remaining_ms: 10,
    purpose: :search,
    report: @report,
    known: %{mag2: @report}
  }

  defp member(id \\ :mag1) do
    mission = {Missions.Landmark, []}

    member =
      Member.new(id: id, profile: Profile.magellan(), start: Pose.new(0, 0), mission: mission)

    {member, _} = Member.step(member, {:command, :start, 0})
    sense(member, 0)
  end

  defp sense(member, at_ms) do
    odometry = {:odometry, %Odometry{pose: Pose.new(0, 0), twist: Twist.zero()}}
    {member, []} = Member.step(member, {:reading, odometry, at_ms})
    {member, _} = Member.step(member, {:tick, at_ms})
    member
  end

  defp hear(member, term, at_ms \\ 100), do: elem(Member.step(member, {:message, term, at_ms}), 0)
  defp receiver(member), do: Member.role(member, :comms).receiver
  defp rejected(member), do: receiver(member).rejected |> Map.values() |> Enum.sum()
  defp deep(n), do: Enum.reduce(1..n, nil, fn _, term -> [term] end)

  defp junk do
    Enum.random([
      nil,
      -1,
      1.0e300,
      Bitwise.bsl(1, 5_000),
      -Bitwise.bsl(1, 5_000),
      "text",
      <<1::3>>,
      [],
      [:a | :b],
      [1 | 2],
      List.duplicate(:mag1, 5_000),
      deep(10_000),
      {},
      {1, 2, 3, 4},
      {Bitwise.bsl(1, 99), 0, 0},
      {0.5, 0, 0},
      {:column, 0.0},
      {:diamond, Bitwise.bsl(1, 70)},
      %{},
      %{merit: 1, pose: {1, 2, 3}, more: deep(100)},
      %{merit: 1},
      %{deep(5) => deep(5)},
      self(),
      make_ref(),
      &Enum.map/2,
      %{__struct__: Heartbeat},
      %{__struct__: NoSuchThing},
      @beat,
      @anchor,
      @letter,
      Pose.new(0, 0)
    ])
  end

  defp spoil(%{__struct__: _} = struct) do
    key = struct |> Map.keys() |> Enum.random()

    case :rand.uniform(4) do
      1 -> Map.delete(struct, key)
      2 -> Map.put(struct, :extra, junk())
      3 -> Map.put(struct, key, junk())
      4 -> Map.update!(struct, key, &nest/1)
    end
  end

  # Damages something inside a field.
  defp nest(%Robot.Mission.Claim{fields: fields} = claim),
    do: if(:rand.uniform(2) == 1, do: spoil(claim), else: %{claim | fields: nest(fields)})

  defp nest(tuple) when is_tuple(tuple) and tuple != {},
    do: put_elem(tuple, :rand.uniform(tuple_size(tuple)) - 1, junk())

  defp nest([_ | rest]), do: Enum.random([[junk() | rest], rest ++ [junk()], rest ++ :tail])

  defp nest(map) when is_map(map) and map_size(map) > 0 and not is_struct(map),
    do: Map.put(map, map |> Map.keys() |> Enum.random(), junk())

  defp nest(_plain), do: junk()

  test "2,000 damaged messages are counted or make sense, and nobody crashes" do
    {member, heard} =
      Enum.reduce(1..2_000, {member(), 0}, fn n, {member, heard} ->
        {kind, body} =
          Enum.random(
            heartbeat: %{@beat | sequence: n},
            heartbeat: Beat.new(sequence: n, phase: :lead, epoch: 1, anchor: @anchor),
            place: %{@anchor | sequence: n},
            round: @letter
          )

        message = Message.new(:mag2, kind, spoil(body))
        message = if rem(n, 10) == 0, do: spoil(message), else: message
        before = rejected(member)
        member = hear(member, message, n * 20)
        member = if rem(n, 5) == 0, do: sense(member, n * 20), else: member
        {member, heard + 1 - (rejected(member) - before)}
      end)

    assert rejected(member) + heard == 2_000
    assert rejected(member) > 1_000
    # It still works.
    assert {%Member{}, [_ | _]} = Member.step(member, {:tick, 50_000})
  end

  test "a term that is not a message is counted by what it claims to be" do
    for {term, reason} <- [
          {:junk, :not_a_message},
          {deep(100), :not_a_message},
          {%{__struct__: Message}, :not_a_message},
          {Message.new(:mag2, :command, :start), :not_a_message},
          {Message.new(nil, :heartbeat, @beat), :not_a_message},
          {Message.new("mag2", :heartbeat, @beat), :not_a_message},
          {Message.new(:mag2, :claim, @beat), :claim},
          {Message.new(:mag2, :round, @anchor), :round},
          {Message.new(:mag2, :heartbeat, @letter), :heartbeat},
          {Message.new(:mag2, :heartbeat, Beat.new(epoch: Bitwise.bsl(1, 64))), :heartbeat},
          {Beat.pass_on(:mag2, %{@anchor | order: [:mag1, :mag1]}), :claim},
          {Beat.pass_on(:mag2, %{@anchor | places: [1, 1]}), :claim},
          {Beat.pass_on(:mag2, %{@anchor | places: List.duplicate(1, 100_000)}), :claim},
          {Beat.pass_on(:mag2, %{@anchor | epoch: Bitwise.bsl(1, 64)}), :claim},
          {Beat.pass_on(:mag2, %{@anchor | leader: nil}), :claim},
          {Beat.pass_on(:mag2, Map.put(@anchor, :more, 1)), :claim},
          {Message.new(:mag2, :round, %{@letter | view: [:mag1 | :mag2]}), :round},
          {Message.new(:mag2, :round, %{@letter | digest: "short"}), :round}
        ] do
      before = member()
      later = hear(before, term)
      assert receiver(later).rejected == %{reason => 1}, inspect(term, limit: 5)
      assert later.lockstep.roles.pilot.runner == before.lockstep.roles.pilot.runner
    end
  end

  test "valid messages are heard" do
    %{body: claim} = Beat.pass_on(:mag2, @anchor)

    for {kind, body} <- [heartbeat: @beat, claim: claim, round: @letter],
        do: assert(receiver(hear(member(), Message.new(:mag2, kind, body))).rejected == %{})
  end

  test "an emergency stop spreads by heartbeats, and its own echo does not bring it back" do
    {one, _} = Member.step(member(), {:command, :estop, 0})
    assert [_tag] = one.lockstep.roles.estop.stop.held

    pressed = Message.new(:mag2, :heartbeat, %{@beat | estop: one.lockstep.roles.estop.stop.held})

    two = hear(member(:mag3), pressed)
    assert two.lockstep.roles.estop.stop.held == one.lockstep.roles.estop.stop.held
    assert sense(two, 100).lockstep.roles.pilot.runner.phase == :idle
    {_, [{:drive, twist}]} = Member.step(two, {:reflex, 100})
    assert Twist.zero?(twist)

    # A person resets it; the neighbour, not reset yet, repeats the old number.
    {two, _} = Member.step(two, {:command, :reset, 200})
    two = hear(two, put_in(pressed.body.sequence, 2), 300)
    assert two.lockstep.roles.estop.stop.held == []

    # The next stop is another one, and counts.
    {two, _} = Member.step(two, {:command, :estop, 400})
    assert [tag] = two.lockstep.roles.estop.stop.held
    assert tag not in one.lockstep.roles.estop.stop.held
  end

  defmodule Deaf do
    @moduledoc "A mission that goes on whatever it receives."
    @behaviour Robot.Mission

    @impl Robot.Mission
    def init(_robot, _options), do: {:rolling, :deaf, []}

    @impl Robot.Mission
    def handle(_event, mission),
      do: {:rolling, mission, [{:goal, :roll, {Robot.Behaviour.Move, linear: 0.2, turn: 0.0}}]}
  end

  test "a stop ends any mission at once, and no older order moves the robot until the next start" do
    options = [id: :mag1, profile: Profile.magellan(), start: Pose.new(0, 0), mission: {Deaf, []}]
    {member, [{:reply, :ok}]} = Member.step(Member.new(options), {:command, :start, 0})
    rolling = member |> sense(100) |> sense(200)
    assert {_, [{:drive, %Twist{linear: v}}]} = Member.step(rolling, {:reflex, 200})
    assert v > 0

    {stopped, [{:reply, :ok}]} = Member.step(rolling, {:command, :stop, 200})

    assert %{phase: :idle, module: nil, mission: nil, claim: claim} =
             stopped.lockstep.roles.pilot.runner

    assert claim == %{}
    assert Member.stands?(stopped)
    assert stands?(stopped, 200)
    # No mission takes it.
    shape = {:command, {:formation, :wedge, 1.0}, 300}
    {stopped, [{:reply, {:error, :no_formation}}]} = Member.step(stopped, shape)
    assert stopped |> sense(300) |> sense(400) |> stands?(400)

    {started, [{:reply, :ok}]} = Member.step(stopped, {:command, :start, 500})
    refute started |> sense(500) |> sense(600) |> stands?(600)
  end

  defp rolling do
    options = [id: :mag1, profile: Profile.magellan(), start: Pose.new(0, 0), mission: {Deaf, []}]
    {member, [{:reply, :ok}]} = Member.step(Member.new(options), {:command, :start, 0})
    member = member |> sense(100) |> sense(200)
    refute stands?(member, 200)
    elem(Member.step(member, {:reflex, 200}), 0)
  end

  test "a part that crashes begins anew, idle, with those behind it, until somebody starts it" do
    for role <- [:gate, :executive, :pilot] do
      {crashed, effects} = Member.step(rolling(), {:crash, role, 250})
      # Executive and pilot make the gate drop the wish, which is told to the wheels at once.
      assert List.last(for {:drive, twist} <- effects, do: twist) |> Twist.zero?()
      assert %{state: :idle} = crashed.lockstep.roles.pilot
      assert crashed.lockstep.config.boot == 2
      crashed = crashed |> sense(300) |> sense(400)
      assert stands?(crashed, 400)
      {started, [{:reply, :ok}]} = Member.step(crashed, {:command, :start, 500})
      refute started |> sense(500) |> sense(600) |> stands?(600)
    end
  end

  test "a gate that crashes while it is latched is latched again, and only a reset clears it" do
    {held, _} = Member.step(rolling(), {:command, :estop, 250})
    {held, _} = Member.step(held, {:crash, :gate, 300})
    assert {held, [{:drive, twist}]} = Member.step(held, {:reflex, 350})
    assert Twist.zero?(twist)
    assert %{driving: {%{limits: [:estop]}, 350}} = held.lockstep.board
    {free, _} = Member.step(held, {:command, :reset, 400})
    {free, _} = Member.step(free, {:command, :start, 450})
    refute free |> sense(500) |> sense(600) |> stands?(600)
  end

  test "an executive that hangs leaves the gate without wishes, and goes on, or is killed after 2 s" do
    {hung, []} = Member.step(rolling(), {:hang, {:executive, 1_000}, 250})
    hung = Enum.reduce(300..900//100, hung, &sense(&2, &1))
    # The dead man's switch.
    assert stands?(hung, 900)
    well = hung |> sense(1_000) |> sense(1_100)
    refute stands?(well, 1_100)
    assert {Deaf, _phase} = well.lockstep.roles.pilot.state

    {hung, []} = Member.step(rolling(), {:hang, {:executive, 60_000}, 250})
    killed = Enum.reduce(300..2_400//100, hung, &sense(&2, &1))
    assert %{state: :idle} = killed.lockstep.roles.pilot
    assert stands?(killed, 2_400)
  end

  test "a stop ends what a robot does while its mission hangs, and nothing that waited begins it again" do
    {hung, []} = Member.step(rolling(), {:hang, {:pilot, 1_000}, 250})
    hung = sense(hung, 300)
    refute stands?(hung, 300)
    {stopped, _} = Member.step(hung, {:command, :stop, 350})
    stopped = Enum.reduce(400..1_500//100, stopped, &sense(&2, &1))
    assert stands?(stopped, 1_500)
    assert %{state: :idle} = stopped.lockstep.roles.pilot
  end

  defp stands?(member, at_ms) do
    {_member, [{:drive, twist}]} = Member.step(member, {:reflex, at_ms})
    Twist.zero?(twist)
  end

  test "a touch stops a member that moves at once, and only one that moves" do
    options = [id: :mag1, profile: Profile.magellan(), start: Pose.new(0, 0), mission: {Deaf, []}]
    {member, [{:reply, :ok}]} = Member.step(Member.new(options), {:command, :start, 0})
    member = sense(member, 100)
    touch = {:reading, {:bumpers, [0]}, 220}
    assert {_, []} = Member.step(member, touch)
    {member, [{:drive, _}]} = Member.step(sense(member, 200), {:reflex, 200})
    assert {member, [{:drive, %Twist{linear: still}}]} = Member.step(member, touch)
    assert still == 0.0
    assert %{driving: {%{limits: limits}, 220}} = member.lockstep.board
    assert :bumper in limits
  end

  # How often each of these functions is called meanwhile, by this process alone.
  defp calls(functions, fun) do
    for function <- functions, do: :erlang.trace_pattern(function, true, [:local])
    test = self()

    {pid, monitor} =
      spawn_monitor(fn ->
        receive(do: (:go -> fun.()))
        delivered = :erlang.trace_delivered(self())
        receive(do: ({:trace_delivered, _me, ^delivered} -> send(test, :done)))
      end)

    :erlang.trace(pid, true, [:call])
    send(pid, :go)
    assert_receive :done
    assert_receive {:DOWN, ^monitor, :process, ^pid, :normal}
    for function <- functions, do: :erlang.trace_pattern(function, false, [:local])
    Enum.frequencies(called(pid))
  end

  defp called(pid) do
    receive do
      {:trace, ^pid, :call, {module, name, arguments}} ->
        [{module, name, length(arguments)} | called(pid)]
    after
      0 -> []
    end
  end

  test "a tick evaluates the landmark in the picture once, and once whether the robot must be cautious" do
    blob = %Vision.Blob{
      colour: "YellowLandmark",
      area: 800,
      share: 0.01,
      x: 200.5,
      y: 119.5,
      left: 191,
      right: 210,
      top: 100,
      bottom: 140,
      width: 320,
      height: 240,
      distance: 2.5
    }

    picture = &{:detections, %Vision.Detections{at_ms: &1, blobs: [blob]}}
    {searches, []} = member() |> sense(100) |> Member.step(picture.(200))
    assert %{phase: :search} = searches.lockstep.roles.pilot.runner
    evaluated = {Robot.Percept.Sighting, :bearing, 3}
    cautious = {Robot.Behaviour.Avoid.Caution, :check, 4}

    assert calls([evaluated, cautious], fn -> Member.step(searches, {:tick, 200}) end) ==
             %{evaluated => 1, cautious => 1}
  end

  defmodule Watcher do
    @moduledoc "A mission that reports the camera's field of view."
    @behaviour Robot.Mission

    @impl Robot.Mission
    def init(_robot, _options), do: {:watching, :watcher, []}

    @impl Robot.Mission
    def handle({:tick, percept}, _mission),
      do: {:watching, :watcher, [{:stage, :seen, Map.take(percept, [:detections])}]}

    def handle(_event, mission), do: {:watching, mission, []}
  end

  test "a picture keeps the field of view it was taken with, though the camera zooms on" do
    options = [
      id: :mag1,
      profile: Profile.magellan(),
      start: Pose.new(0, 0),
      mission: {Watcher, []}
    ]

    zoomed = {:reading, {:ptz, %{pan: 0.3, tilt: 0.0, field_of_view: 0.4}}, 50}
    seen = %Vision.Detections{at_ms: 0, blobs: [], pan: 0.2, field_of_view: 0.5}
    {member, []} = Member.step(Member.new(options), {:detections, seen})
    {member, []} = Member.step(member, zoomed)
    {_member, effects} = Member.step(member, {:tick, 100})
    assert {:stage, :seen, %{detections: seen}} in effects
  end

  test "what people asked of the group's mission survives a stop" do
    {member, [{:reply, :ok}]} = Member.step(member(), {:command, {:formation, :wedge, 1.2}, 0})
    {stopped, [{:reply, :ok}]} = Member.step(member, {:command, :stop, 100})
    {started, [{:reply, :ok}]} = Member.step(stopped, {:command, :start, 200})

    assert %{formation: {:wedge, 1.2}, started?: true} =
             started.lockstep.roles.pilot.runner.mission

    assert sense(started, 300).lockstep.roles.pilot.runner.phase == :search
  end

  test "while it is stopped, it accepts no command but stop" do
    {member, _} = Member.step(member(), {:command, :estop, 0})
    held = {:error, "mag1 is held by the emergency stop; reset it first"}
    assert {^member, [{:reply, ^held}]} = Member.step(member, {:command, :start, 100})
  end
end
