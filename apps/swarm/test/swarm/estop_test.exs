defmodule Swarm.EStopTest do
  use Swarm.Case, async: false
  @moduletag :realtime
  @moduletag :capture_log
  alias Swarm.EStop
  alias Swarm.EStop.Broadcaster

  defp latched?(id), do: Board.latched?(Board.find!(id))

  defp stop_of(id) do
    {:ok, stop, _at_ms} = Board.fetch(Board.find!(id), :estop, :infinity)
    stop
  end

  # A different call in each test, because a node remembers what it heard.
  defp call(counter),
    do: {:base@hall, 1_700_000_000_000, 10 * Process.get(:ten) + counter}

  setup do
    Process.put(:ten, System.unique_integer([:positive, :monotonic]))
    :ok
  end

  test "an e-stop does not wait for a comms process that hangs, nor does a stop or the reset" do
    id = robot(:estop_hangs)
    comms = Names.whereis(id, :comms)
    assert order(fn -> Swarm.goto(id, {1, 1}) end) == :ok
    :ok = :sys.suspend(comms)
    assert order(fn -> Swarm.stop(id) end) == :ok
    assert order(&Swarm.estop/0) == :ok
    assert latched?(id)
    assert order(&Swarm.reset/0) == :ok
    refute latched?(id)
    :ok = :sys.resume(comms)

    # The mission ended with the stop, before the reset.
    assert {:ok, %{state: :idle}, _} = Board.fetch(Board.find!(id), :mission, :infinity)
  end

  test "an e-stop reaches a robot whose comms process is dead, and the next comms process spreads it" do
    [a, b] = standing(for id <- [:estop_dead, :estop_beside], do: robot(id))
    eventually(fn -> is_map_key(Board.peers(Board.find!(b)), a) end)
    comms = Names.whereis(a, :comms)
    :ok = :sys.suspend(comms)
    # Only this robot is called.
    assert Swarm.ask(a, {:estop, call(1)}) == :ok
    assert latched?(a)
    kill(a, :comms)
    eventually(fn -> latched?(b) end)
    assert order(&Swarm.reset/0) == :ok
  end

  test "all robots of a node hear a call that arrives by datagram; junk does nothing" do
    [a, b] = for id <- [:estop_air1, :estop_air2], do: robot(id)

    for junk <- [
          :x,
          {:estop, call(1)},
          {:estop, :x, 0},
          {:estop, {1, 2, 3}, 0},
          {:estop, {nil, 1, 1}, 0},
          {:estop, call(1), -1},
          {:estop, call(1), nil},
          {:reset, call(1)}
        ] do
      assert EStop.hear(:base@hall, junk) == :ok
      GenServer.cast(Names.whereis(a, :estop), junk)
      send(Names.whereis(a, :estop), junk)
    end

    refute latched?(a)
    assert EStop.hear(:base@hall, {:estop, call(7), 0}) == :ok
    for id <- [a, b], do: eventually(fn -> latched?(id) end)

    # Repeats, even late ones, do not undo what a person has done.
    assert order(&Swarm.reset/0) == :ok
    for counter <- [7, 6, 7], do: EStop.hear(:base@hall, {:estop, call(counter), 0})
    for id <- [a, b], do: assert({{:ok, _}, false} = {Swarm.ask(id, :ping), latched?(id)})

    for id <- [a, b],
        do: assert(%EStop.State{held: [], cleared: [_tag]} = stop_of(id))

    # Nor does an older call that is heard for the first time now, for example from a node that
    # was cut off.
    far = {:far@hall, 1, 1}
    assert EStop.hear(:base@hall, {:estop, far, 60_000}) == :ok
    for id <- [a, b], do: assert({{:ok, _}, false} = {Swarm.ask(id, :ping), latched?(id)})
    # The next call does.
    assert EStop.hear(:base@hall, {:estop, call(8), 0}) == :ok
    for id <- [a, b], do: eventually(fn -> latched?(id) end)
    assert order(&Swarm.reset/0) == :ok
  end

  test "heard calls survive the e-stop process, and the next one carries out the latch" do
    id = robot(:estop_falls)
    assert Swarm.ask(id, {:estop, call(1)}) == :ok
    assert order(&Swarm.reset/0) == :ok
    [gate, pilot] = [Names.whereis(id, :gate), Names.whereis(id, :pilot)]
    estop = kill(id, :estop)
    eventually(fn -> (now = Names.whereis(id, :estop)) && now != estop end)
    eventually(fn -> Directory.members({:estop, id}) == [Names.whereis(id, :estop)] end)
    EStop.hear(:base@hall, {:estop, call(1), 0})
    assert Swarm.ask(id, :stop) == :ok
    refute latched?(id)
    assert [gate, pilot] == [Names.whereis(id, :gate), Names.whereis(id, :pilot)]
  end

  defp sound do
    call = Broadcaster.call()
    :ok = Broadcaster.sound(call)
    call
  end

  test "the call is repeated even if the caller ends, and passed on once" do
    id = robot(:estop_repeat)
    :ok = Directory.enter(self(), [:estops])
    {caller, monitor} = spawn_monitor(fn -> exit({:called, sound()}) end)
    assert_receive {:DOWN, ^monitor, :process, ^caller, {:called, call}}
    for _ <- 1..10, do: assert_receive({:"$gen_cast", {:estop, ^call, _age}})
    assert latched?(id)

    # A person ends the repeats.
    call = sound()
    assert_receive {:"$gen_cast", {:estop, ^call, _age}}
    assert Swarm.ask(id, {:estop, call}) == :ok
    assert order(&Swarm.reset/0) == :ok
    :sys.get_state(Broadcaster)
    forget(call)
    refute_receive {:"$gen_cast", {:estop, ^call, _age}}, 150

    # Each node hears another's call from each node that heard it, three times.
    EStop.hear(:base@hall, {:estop, call(1), 0})
    far = call(1)
    for _ <- 1..3, do: assert_receive({:"$gen_cast", {:estop, ^far, _age}})
    refute_received {:"$gen_cast", {:estop, _more, _age}}
    :ok = Directory.leave(self(), [:estops])
    assert order(&Swarm.reset/0) == :ok
  end

  # What was repeated before the reset.
  defp forget(call) do
    receive do
      {:"$gen_cast", {:estop, ^call, _age}} -> forget(call)
    after
      0 -> :ok
    end
  end

  test "a stop spreads by heartbeats that are sent at once and then ten more times" do
    [a, b] =
      for id <- [:estop_beats1, :estop_beats2],
          do: robot(id, comms: [transport: {__MODULE__, :carry, [self()]}])

    standing([a, b])
    assert_receive {:carried, ^a, %Message{body: %Heartbeat{estop: [], sequence: before}}}
    :ok = Gate.estop(a)
    assert_receive {:carried, ^a, %Message{body: %Heartbeat{estop: [tag]}} = message}
    assert message.body.sequence - before < 10
    Comms.hear(b, message)
    assert_receive {:carried, ^b, %Message{body: %Heartbeat{estop: [^tag]}}}
    eventually(fn -> latched?(b) end)
    for _ <- 1..10, do: assert_receive({:carried, ^b, %Message{kind: :heartbeat}})
    assert order(&Swarm.reset/0) == :ok
  end

  @doc false
  def carry(test, from, _ids, message), do: send(test, {:carried, from, message})

  test "an e-stop, and its reset, get through to a flooded robot, whose mailbox stays short" do
    id = robot(:estop_flooded)
    comms = Names.whereis(id, :comms)
    flood = start_supervised!({Task, fn -> pour(comms, id) end})
    eventually(fn -> flooded(id) > 0 end)
    assert order(&Swarm.estop/0) == :ok
    assert latched?(id)
    assert {:ok, _} = eventually(fn -> Swarm.ask(id, :ping) end)
    assert order(&Swarm.reset/0) == :ok
    refute latched?(id)
    # It is shortened whenever the robot gets a processor, as long as the flood lasts.
    queued = fn -> comms |> Process.info(:message_queue_len) |> elem(1) end
    eventually(fn -> queued.() > 2_000 end)
    eventually(fn -> queued.() < 2_000 end)
    stop_supervised!(Task)
    refute Process.alive?(flood)
  end

  defp pour(comms, id) do
    beat = %Heartbeat{boot: 1, sequence: 1, pose: {0, 0, 0}, twist: {0, 0}}
    message = Message.new(:estop_pouring, :heartbeat, beat)

    for _ <- 1..1_000, do: GenServer.cast(comms, {:hear, message})
    for _ <- 1..100, do: GenServer.cast(comms, :junk)
    for _ <- 1..100, do: send(comms, {:junk, id})
    pour(comms, id)
  end

  defp flooded(id) do
    case Board.fetch(Board.find!(id), :radio, :infinity) do
      {:ok, %{rejected: %{flooded: n}}, _at_ms} -> n
      _none -> 0
    end
  end
end
