defmodule Lab.ProcessesTest do
  @moduledoc """
  The processes of a robot and `Swarm.Member.step/2` get the same input for a whole mission, and
  do the same: every speed, message, camera direction and stage is equal. Meanwhile the camera
  zooms, its pictures are 50 ms old, and the bumper is hit between two steps of the gate.
  """
  use Robot.Case, async: false
  alias Hal.Profile
  alias Sim.{Radio, World}
  alias Swarm.{Comms, Directory, Member}
  @moduletag :realtime

  @ids [:mag1, :mag2, :min1]
  @me :mag1
  @mission {Missions.Landmark, formation: {:column, 1.0}, assign: :cost}

  setup %{seed: seed} do
    {:ok, map} = Sim.Floorplan.open("hall", 3)
    profiles = %{mag1: Profile.magellan(), mag2: Profile.magellan(), min1: Profile.atrv_mini()}
    landmark = {0.0, 0.0}
    bodies = for id <- @ids, do: {id, profiles[id].radius}
    {:ok, starts} = Sim.Floorplan.starts(map, bodies, seed, landmark)

    robots =
      for {id, pose} <- Enum.zip(@ids, starts), do: %{id: id, profile: profiles[id], pose: pose}

    world = World.new!(map: map, seed: seed, noise: :default, landmark: landmark, robots: robots)

    members =
      Map.new(robots, fn %{id: id, pose: pose, profile: profile} ->
        {id, Member.new(id: id, profile: profile, start: pose, mission: @mission)}
      end)

    clock = :counters.new(1, [])
    start_live(Enum.find(robots, &(&1.id == @me)), clock)

    %{
      run: %{
        world: world,
        radio: Radio.new(seed: seed, loss: 0.1),
        members: members,
        clock: clock,
        pids:
          Map.new(
            [:drive, :ptz, :gate, :executive, :pilot, :comms],
            &{&1, Names.whereis(@me, &1)}
          ),
        at_ms: 0,
        looks: {nil, nil},
        pictures: %{},
        compared: %{drive: 0, send: 0, look: 0, stage: 0},
        hits: [],
        phases: MapSet.new()
      }
    }
  end

  defp start_live(%{id: id, pose: pose, profile: profile}, clock) do
    config =
      config(id,
        profile: profile,
        ptz: {Hal.FakePtz, test: self(), device: :ptz},
        start: pose,
        mission: @mission,
        clock: {:counters, :get, [clock, 1]},
        pace: :manual
      )

    # The others are in the directory, so that `:all` is the same as in the trial.
    groups = for other <- @ids, other != id, do: {:robot, other}
    :ok = Directory.enter(self(), groups)
    on_exit(fn -> Directory.leave(self(), groups) end)
    listen(id, [:robot, :stage])

    transport = {__MODULE__, :carry, [self()]}
    config = Comms.join(config, transport: transport, boot: 1)
    start_supervised!({Robot.Supervisor, config})
    online(id)
    :ok = Pilot.start(id)
  end

  @doc false
  def carry(test, _from, ids, message), do: send(test, {:carried, ids, message})

  # With one seed it follows, with the other it leads.
  for seed <- [3, 7] do
    @tag seed: seed
    test "the same input has the same effects by two clocks: seed #{seed}", %{run: run} do
      play(run)
    end
  end

  defp play(run) do
    # The gate told the wheels to stop when it started.
    run = sync(run)
    flush([])
    run = Enum.reduce(@ids, run, &input(&2, &1, {:command, :start, 0}))
    run = Enum.reduce(1..450, run, fn n, run -> run |> script(n) |> tenth(n) end)

    assert run.compared.drive > 900
    assert run.compared.send > 100
    assert run.compared.look > 100
    assert run.compared.stage > 0
    assert :lead in run.phases or :follow in run.phases
    ahead = for {before, now} <- run.hits, before > 0.0, do: now
    assert ahead != [] and Enum.all?(ahead, &(&1 == 0.0))
  end

  # What a person does meanwhile.
  defp script(run, 200), do: input(run, @me, {:command, {:formation, :wedge, 1.2}, run.at_ms})
  defp script(run, 260), do: input(run, @me, {:command, :stop, run.at_ms})
  defp script(run, 275), do: input(run, @me, {:command, :start, run.at_ms})
  # By a call of the test's: those that processes make have numbers of their own.
  defp script(run, 300), do: input(run, @me, {:command, {:estop, {:base@hall, 1, 1}}, run.at_ms})

  defp script(run, 320) do
    run = Enum.reduce(@ids, run, &input(&2, &1, {:command, :reset, run.at_ms}))
    Enum.reduce(@ids, run, &input(&2, &1, {:command, :start, run.at_ms}))
  end

  defp script(run, 350), do: %{run | world: World.move_landmark(run.world, {2.0, 1.0})}

  # From 60 degrees to 40 and back.
  defp script(run, n) when n in 100..119 or n in 130..149 do
    angle = if n < 120, do: 60 - (n - 99), else: 40 + (n - 129)
    %{run | world: World.zoom(run.world, @me, angle * :math.pi() / 180)}
  end

  defp script(run, _n), do: run

  # The same as in `Lab.Trial.step/1`.
  defp tenth(run, n) do
    run
    |> hear()
    |> sense()
    |> see()
    |> each(&{:tick, &1})
    |> each(&{:reflex, &1})
    |> act(n)
    |> hear()
    |> sense()
    |> expose()
    |> each(&{:reflex, &1})
    |> act()
  end

  defp hear(run) do
    {letters, radio} = Radio.receive(run.radio, run.at_ms)

    Enum.reduce(letters, %{run | radio: radio}, fn {to, _from, message}, run ->
      input(run, to, {:message, message, run.at_ms})
    end)
  end

  defp sense(run) do
    for id <- @ids, reading <- World.readings(run.world, id), reduce: run do
      run -> input(run, id, {:reading, reading, run.at_ms})
    end
  end

  defp see(run) do
    for {id, detections} <- run.pictures, reduce: run do
      run -> input(run, id, {:detections, detections})
    end
  end

  # What `see/1` passes on 50 ms later, when the camera may have zoomed further.
  defp expose(run) do
    %{run | pictures: for(id <- @ids, do: {id, World.detections(run.world, id)})}
  end

  defp each(run, make),
    do: Enum.reduce(@ids, run, fn id, run -> input(run, id, make.(run.at_ms)) end)

  defp act(run, n) when rem(n, 40) == 0, do: run |> act_for(20) |> hit() |> act_for(30)
  defp act(run, _n), do: act(run)

  defp act(run), do: act_for(run, 50)
  defp act_for(run, ms), do: %{run | world: World.step(run.world, ms), at_ms: run.at_ms + ms}

  # The wheels' speed before and after: nothing waits for the gate's next step.
  defp hit(run) do
    before = run.world.robots[@me].wanted.linear
    run = input(run, @me, {:reading, {:bumpers, [0]}, run.at_ms})
    %{run | hits: [{before, run.world.robots[@me].wanted.linear} | run.hits]}
  end

  defp input(run, @me, input) do
    :counters.put(run.clock, 1, run.at_ms)
    run = run |> feed(input) |> sync()
    {run, mine} = member(run, @me, input)
    compare(run, input, flush([]), mine)
  end

  defp input(run, id, input) do
    {run, _effects} = member(run, id, input)
    run
  end

  defp feed(run, input) do
    pids = run.pids

    case input do
      {:reading, {:ptz, _} = reading, _} -> send(pids.ptz, {:readings, [reading]})
      {:reading, reading, _} -> send(pids.drive, {:readings, [reading]})
      {:detections, _} -> Board.sense(Board.find!(@me), :blob_detector, input)
      {:message, message, _} -> Comms.hear(@me, message)
      {:command, command, _} -> :ok = Swarm.ask(@me, command)
      {:tick, _} -> send(pids.executive, :tick)
      {:reflex, _} -> send(pids.gate, :tick)
    end

    if elem(input, 0) == :tick do
      run = sync(run)
      send(pids.comms, :tick)
      run
    else
      run
    end
  end

  # In the order in which one passes data to the next; any answer says that everything before is
  # done.
  defp sync(%{pids: pids} = run) do
    for role <- [
          :drive,
          :ptz,
          :comms,
          :executive,
          :pilot,
          :executive,
          :gate,
          :comms,
          :drive,
          :ptz
        ],
        do: :sys.statistics(pids[role], :get)

    run
  end

  defp flush(effects) do
    receive do
      {:drive, {:drive, twist}, _pid} -> flush([{:drive, twist} | effects])
      {:ptz, {:look, pan, tilt}, _pid} -> flush([{:look, pan, tilt} | effects])
      {:carried, ids, message} -> flush([{:send, addressed(ids, @me), message} | effects])
      {[:robot, :stage], about} -> flush([stage(about) | effects])
    after
      0 -> Enum.reverse(effects)
    end
  end

  defp stage(about) do
    {stage, about} = Map.pop!(about, :stage)
    {:stage, stage, Map.delete(about, :robot)}
  end

  # Each member's effects reach world and radio; the live robot's are compared with its twin's.
  defp member(run, id, input) do
    {member, effects} = Member.step(run.members[id], input)
    effects = Enum.reject(effects, &match?({:reply, _answer}, &1))
    run = %{run | members: %{run.members | id => member}}
    {Enum.reduce(effects, run, &effect(&1, id, &2)), effects}
  end

  defp effect({:drive, twist}, id, run), do: %{run | world: World.drive(run.world, id, twist)}

  defp effect({:look, pan, tilt}, id, run),
    do: %{run | world: World.look(run.world, id, pan, tilt)}

  defp effect({:send, to, message}, id, run),
    do: %{run | radio: Radio.send(run.radio, run.at_ms, id, addressed(to, id), message)}

  defp effect({:stage, _name, _about}, _id, run), do: run

  defp addressed(:all, id), do: List.delete(@ids, id)
  defp addressed(to, id), do: List.delete(List.wrap(to), id)

  defp compare(run, input, live, mine) do
    for kind <- [:drive, :send, :stage] do
      told = Enum.filter(live, &(elem(&1, 0) == kind))
      expected = for effect <- mine, elem(effect, 0) == kind, do: resolved(effect)
      assert {run.at_ms, input, told} == {run.at_ms, input, expected}
    end

    # A command to look where the camera already looks changes nothing: only its target counts.
    {live_look, my_look} = run.looks
    looks = {last_look(live, live_look), last_look(mine, my_look)}
    assert elem(looks, 0) == elem(looks, 1)

    compared =
      Enum.reduce(mine, run.compared, fn effect, compared ->
        Map.update!(compared, elem(effect, 0), &(&1 + 1))
      end)

    phases = MapSet.put(run.phases, Swarm.Member.runner(run.members[@me]).phase)
    %{run | looks: looks, compared: compared, phases: phases}
  end

  defp resolved({:send, to, message}), do: {:send, addressed(to, @me), message}
  defp resolved(effect), do: effect

  defp last_look(effects, before),
    do: Enum.reduce(effects, before, fn effect, last -> looked(effect, last) end)

  defp looked({:look, _pan, _tilt} = look, _before), do: look
  defp looked(_other, before), do: before
end
