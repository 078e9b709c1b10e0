defmodule Swarm.EStop.OwnerTest do
  @moduledoc """
  One process owns the state of the emergency stop: what reaches it, and who does not wait for it.
  """
  use Swarm.Case, async: false
  @moduletag :realtime
  @moduletag :capture_log
  alias Swarm.EStop

  doctest Swarm.EStop.Calls

  defp latched?(id), do: Board.latched?(Board.find!(id))

  defp stop_of(id) do
    {:ok, stop, _at_ms} = Board.fetch(Board.find!(id), :estop, :infinity)
    stop
  end

  defp beat(tags) do
    beat = %Heartbeat{boot: 1, sequence: 1, pose: {0, 0, 0}, twist: {0, 0}}
    Message.new(:owner_far, :heartbeat, %{beat | estop: tags})
  end

  # Everything that was sent to these processes so far has been handled, in this order.
  defp settled(id, roles), do: for(role <- roles, do: :sys.get_state(Names.whereis(id, role)))

  @doc false
  def carry(test, from, _ids, message), do: send(test, {:carried, from, message})

  test "a direct stop of the gate reaches it even if the comms process hangs" do
    id = robot(:owner_direct)
    comms = Names.whereis(id, :comms)
    :ok = :sys.suspend(comms)
    :ok = Gate.estop(id)
    eventually(fn -> match?(%{held: [_tag]}, stop_of(id)) end)
    :ok = Gate.reset(id)
    eventually(fn -> match?(%{held: [], cleared: [_tag]}, stop_of(id)) end)
    :ok = :sys.resume(comms)
  end

  @tag :tmp_dir
  test "an e-stop is confirmed once it is on the disk, and a disk that hangs is named", %{
    tmp_dir: folder
  } do
    file = Path.join(folder, "estop")
    id = robot(:owner_disk, estop_file: file)
    assert Swarm.ask(id, :estop) == :ok
    assert File.exists?(file)
    assert Swarm.ask(id, :reset) == :ok
    eventually(fn -> not File.exists?(file) end)

    Robot.Case.hang(file)
    assert {:error, line} = Swarm.ask(id, :estop)
    assert line =~ "#{id} is held, but its disk has not taken the e-stop yet"
    assert latched?(id)
    # Neither its owner nor its gate waits for the disk.
    assert Swarm.ask(id, :reset) == :ok
    refute latched?(id)
    Robot.Case.resume(file)
    eventually(fn -> not File.exists?(file) end)
    assert Swarm.ask(id, :estop) == :ok
    assert File.read!(file) == "e-stop\n"
  end

  @tag :tmp_dir
  test "an e-stop that its file does not take is no success: the answer and the status name the file until it holds",
       %{
         tmp_dir: folder
       } do
    # Root may write into any folder, but not into a file as if it were one.
    place = Path.join(folder, "place")
    File.write!(place, "")
    file = Path.join(place, "estop")
    id = robot(:owner_full, estop_file: file)
    why = "#{id} is held, but the stop is not in its file #{file} (not a directory)"

    for _ <- 1..2 do
      assert {:error, line} = Swarm.ask(id, :estop)
      assert line =~ why
      assert latched?(id)
    end

    assert inspect(Swarm.status(id)) =~ "E-STOP NOT ON ITS DISK (not a directory: #{file})"
    File.rm!(place)
    File.mkdir!(place)
    eventually(fn -> File.exists?(file) end)
    eventually(fn -> not (inspect(Swarm.status(id)) =~ "NOT ON ITS DISK") end)
    assert Swarm.ask(id, :estop) == :ok

    # A reset that the disk does not take is carried out, and told as well: the next start would be held.
    File.rm!(file)
    File.mkdir!(file)
    assert Swarm.ask(id, :reset) == :ok
    eventually(fn -> inspect(Swarm.status(id)) =~ "RESET NOT ON ITS DISK (" end)
    File.rmdir!(file)
    eventually(fn -> not (inspect(Swarm.status(id)) =~ "NOT ON ITS DISK") end)
  end

  test "if a latch changed often during a delay, it follows the last change" do
    id = robot(:owner_late)
    estop = Names.whereis(id, :estop)
    :ok = :sys.suspend(estop)
    for press <- [:estop, :reset, :estop], do: :ok = apply(Gate, press, [id])
    :ok = :sys.resume(estop)
    settled(id, [:estop])
    assert %{held: [_tag]} = stop_of(id)
    assert latched?(id)
    assert Swarm.ask(id, :reset) == :ok
    refute latched?(id) or EStop.State.held?(stop_of(id))
  end

  test "a direct stop of the gate while there was no e-stop process is followed by the next one" do
    id = robot(:owner_gone)
    estop = Names.whereis(id, :estop)
    :ok = :sys.suspend(estop)
    :ok = Gate.estop(id)
    ^estop = kill(id, :estop)
    eventually(fn -> match?(%{held: [_tag]}, stop_of(id)) end)
    assert latched?(id)
  end

  test "a press on a robot that is held already, which an e-stop process left undone, is one more for the next one" do
    id = robot(:owner_undone)
    assert Swarm.ask(id, :estop) == :ok
    assert %{held: [first]} = stop_of(id)
    estop = Names.whereis(id, :estop)
    :ok = :sys.suspend(estop)
    :ok = Gate.estop(id)
    ^estop = kill(id, :estop)
    eventually(fn -> match?(%{held: [_second, ^first]}, stop_of(id)) end)
    # What was followed is not followed again.
    held = stop_of(id).held
    estop = Names.whereis(id, :estop)
    ^estop = kill(id, :estop)
    eventually(fn -> Names.whereis(id, :estop) not in [nil, estop] end)
    settled(id, [:estop])
    assert stop_of(id).held == held
  end

  test "an e-stop ends the mission, is passed on, and is answered while the gate hangs" do
    [id, near] = for id <- [:owner_hung, :owner_hung_near], do: robot(id)
    :ok = Swarm.tell(id, "move:0.2:0")
    gate = Names.whereis(id, :gate)
    :ok = :sys.suspend(gate)
    {:error, line} = Swarm.ask(id, :estop)
    assert line =~ "#{id} is told to stop, but its gate does not answer"
    assert {:ok, %{state: :idle}, _at_ms} = Board.fetch(Board.find!(id), :mission, :infinity)
    assert latched?(near)
    # The one that follows is latched by what was written down.
    ^gate = kill(id, :gate)
    eventually(fn -> Names.whereis(id, :gate) not in [nil, gate] and latched?(id) end)
  end

  test "the comms process does not wait for an e-stop process that hangs, and passes on only changes" do
    id = robot(:owner_hangs, comms: [transport: {__MODULE__, :carry, [self()]}])
    standing([id])
    estop = Names.whereis(id, :estop)
    # What the board already says is not passed on.
    Comms.hear(id, beat([]))
    settled(id, [:comms])
    :ok = :sys.suspend(estop)
    Comms.hear(id, beat([]))
    Comms.hear(id, beat([3]))
    for _ <- 1..8, do: assert_receive({:carried, ^id, %Message{kind: :heartbeat}})
    assert {:ok, _line} = Swarm.ask(id, :ping)
    refute latched?(id)

    {:messages, queued} = Process.info(estop, :messages)
    beats = for {:"$gen_cast", cast} <- queued, elem(cast, 0) == :beat, do: cast
    assert beats == [{:beat, [3]}]

    :ok = :sys.resume(estop)
    eventually(fn -> latched?(id) end)
    assert stop_of(id).held == [3]
    assert_receive {:carried, ^id, %Message{body: %Heartbeat{estop: [3]}}}
    # A neighbour that nobody has reset yet does not set the stop again.
    assert Swarm.ask(id, :reset) == :ok
    Comms.hear(id, put_in(beat([3]).body.sequence, 2))
    settled(id, [:comms, :estop])
    refute latched?(id)
  end

  test "a direct stop of the gate while a reset is carried out is stronger" do
    id = robot(:owner_reset)
    pilot = Names.whereis(id, :pilot)
    assert Swarm.ask(id, :estop) == :ok
    :ok = :sys.suspend(pilot)
    asked = Task.async(fn -> Swarm.ask(id, :reset) end)
    eventually(fn -> Process.info(pilot, :message_queue_len) != {:message_queue_len, 0} end)
    :ok = Gate.estop(id)
    settled(id, [:estop])
    :ok = :sys.resume(pilot)
    assert {:error, line} = Task.await(asked)
    assert line =~ "stopped again meanwhile"
    assert latched?(id)
    assert Swarm.ask(id, :reset) == :ok
    refute latched?(id)
  end

  test "a reset from before a direct stop of the gate does not clear it" do
    id = robot(:owner_before)
    estop = Names.whereis(id, :estop)
    :ok = :sys.suspend(estop)
    asked = Task.async(fn -> Swarm.ask(id, :reset) end)
    eventually(fn -> Process.info(estop, :message_queue_len) != {:message_queue_len, 0} end)
    :ok = Gate.estop(id)
    :ok = :sys.resume(estop)
    assert {:error, line} = Task.await(asked)
    assert line =~ "stopped meanwhile"
    assert latched?(id)
  end

  test "a direct stop of one gate stops another robot that is being reset" do
    [here, there] = for id <- [:owner_here, :owner_there], do: robot(id)
    assert Swarm.estop() == :ok
    pilot = Names.whereis(here, :pilot)
    :ok = :sys.suspend(pilot)
    asked = Task.async(fn -> Swarm.ask(here, :reset) end)
    eventually(fn -> Process.info(pilot, :message_queue_len) != {:message_queue_len, 0} end)
    # While the first waits for its pilot, the gate of the other is stopped directly.
    :ok = Gate.estop(there)
    settled(there, [:estop])
    settled(here, [:estop])
    :ok = :sys.resume(pilot)
    assert {:error, line} = Task.await(asked)
    assert line =~ "stopped again meanwhile"
    assert latched?(here) and latched?(there)
    assert Swarm.reset() == :ok
  end

  test "a call from after a reset stops a robot that carries out the reset late" do
    id = robot(:owner_late_reset)
    assert Swarm.ask(id, :estop) == :ok
    pilot = Names.whereis(id, :pilot)
    :ok = :sys.suspend(pilot)
    asked = Task.async(fn -> Swarm.ask(id, :reset) end)
    eventually(fn -> Process.info(pilot, :message_queue_len) != {:message_queue_len, 0} end)
    made = System.monotonic_time(:millisecond)
    # The call is on its way for as long as the pilot waits.
    eventually(fn -> System.monotonic_time(:millisecond) - made > 20 end)
    :ok = :sys.resume(pilot)
    assert Task.await(asked) == :ok
    call = {:base@hall, System.system_time(:millisecond), 1}
    EStop.hear(:base@hall, {:estop, call, System.monotonic_time(:millisecond) - made})
    settled(id, [:estop])
    assert latched?(id)
    assert Swarm.reset() == :ok
  end

  test "a direct stop of the gate when it is about to be released is stronger" do
    id = robot(:owner_about)
    [pilot, estop] = for role <- [:pilot, :estop], do: Names.whereis(id, role)
    assert Swarm.ask(id, :estop) == :ok
    :ok = :sys.suspend(pilot)
    asked = Task.async(fn -> Swarm.ask(id, :reset) end)
    eventually(fn -> Process.info(pilot, :message_queue_len) != {:message_queue_len, 0} end)
    :ok = :sys.suspend(estop)
    :ok = :sys.resume(pilot)
    # The gate has said that the robot may be released, and nobody has heard it yet.
    eventually(fn -> Process.info(estop, :message_queue_len) != {:message_queue_len, 0} end)
    :ok = Gate.estop(id)
    :ok = :sys.resume(estop)
    # On a busy machine nobody waits for the answer any more.
    assert {:error, line} = Task.await(asked) || {:error, "stopped again meanwhile"}
    assert line =~ "stopped again meanwhile"
    settled(id, [:estop])
    assert latched?(id) and EStop.State.held?(stop_of(id))
    assert Swarm.ask(id, :reset) == :ok
  end

  test "a reset that was given before a neighbour's stop was heard does not clear it" do
    id = robot(:owner_neighbour)
    estop = Names.whereis(id, :estop)
    GenServer.cast(estop, {:stamp, ref = :erlang.alias([:reply])})
    assert_receive {^ref, stamp}
    Comms.hear(id, beat([3]))
    eventually(fn -> latched?(id) end)
    GenServer.cast(estop, {:command, :reset, ref = :erlang.alias([:reply]), stamp})
    assert_receive {^ref, {:error, line}}
    assert line =~ "was stopped after"
    assert latched?(id)
    assert Swarm.ask(id, :reset) == :ok
    refute latched?(id)
  end

  test "a reset that only says when it was given counts from this node alone" do
    id = robot(:owner_said)
    estop = Names.whereis(id, :estop)
    assert Swarm.ask(id, :estop) == :ok
    GenServer.cast(estop, {:command, :reset, nil, {:asked, System.monotonic_time(:microsecond)}})
    settled(id, [:estop, :pilot, :executive, :gate, :estop, :gate, :estop])
    assert latched?(id)
    assert Swarm.ask(id, :reset) == :ok
  end

  test "it keeps up with neighbours that report one stop after the other, and a reset holds" do
    id = robot(:owner_flooded)
    comms = Names.whereis(id, :comms)
    for number <- 1..20_000, do: GenServer.cast(comms, {:hear, beat([number])})
    eventually(fn -> Process.info(comms, :message_queue_len) == {:message_queue_len, 0} end)
    settled(id, [:comms, :estop])
    assert latched?(id)
    assert length(stop_of(id).held) == 16
    assert Swarm.ask(id, :reset) == :ok
    refute latched?(id)
  end
end
