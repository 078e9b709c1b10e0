defmodule Swarm.MeshConsumerTest do
  use Swarm.Case, async: true
  alias Swarm.Agreement.Round.Letter
  alias Swarm.Message.Checked
  alias Swarm.MeshConsumer

  defp beat(id) do
    beat = %Heartbeat{boot: 7, sequence: 9, pose: {0, 0, 0}, twist: {0, 0}}
    Message.new(id, :heartbeat, beat)
  end

  test "a message is identified by its authors, a heartbeat by its number" do
    assert MeshConsumer.read(beat(:mag1)) == {:ok, beat(:mag1), %{robots: [:mag1], beat: {7, 9}}}
    letter = %Letter{id: {1, 1, :mag1}, view: [:mag1], remaining_ms: 9, purpose: :search}
    letter = Message.new(:mag1, :round, letter)
    assert {:ok, ^letter, %{robots: [:mag1], beat: nil}} = MeshConsumer.read(letter)

    # A relayed heartbeat is not a heartbeat of the robot that relays it.
    {:ok, relay} = Message.pass_on(beat(:mag2), :mag1)
    assert {:ok, ^relay, %{robots: [:mag1, :mag2], beat: nil}} = MeshConsumer.read(relay)
    for junk <- [nil, :junk, %{relay | body: 1}], do: assert(MeshConsumer.read(junk) == :error)
  end

  test "each service has a process that receives it" do
    services = MeshConsumer.services()
    assert Enum.sort(Map.keys(services)) == [:rows, :stop]

    for {_service, {m, f, a}} <- services,
        do: assert(function_exported?(m, f, length(a) + 2))

    # Nothing else may be old.
    assert MeshConsumer.late() == [:stop]
  end

  test "messages and commands reach the comms process of a robot, and no other" do
    :ok = Names.register(:consumer1, :comms, nil)
    assert MeshConsumer.deliver([:consumer1, :consumer_away], :b@lab, beat(:mag1)) == :ok
    assert_received {:"$gen_cast", {:hear, heard}}
    assert {:ok, %Message{from: :mag1}} = Checked.open(heard)
    ref = make_ref()

    # The reference is one of this node, so that a giver is said, although it is not known which.
    for {request, told} <- [
          {{:stamp, ref}, {:stamp, ref}},
          {{:command, :stop, ref}, {:command, :stop, ref, {:by, "another node"}}},
          {{:command, :start, ref, {7, 5}}, {:command, :start, ref, {7, 5}, "another node"}},
          {{:command, :start, ref, {7, 5}, "a@b"}, {:command, :start, ref, {7, 5}, "a@b"}}
        ] do
      assert MeshConsumer.command(:consumer1, request) == :ok
      assert_received {:"$gen_cast", ^told}
      assert MeshConsumer.command(:consumer_away, request) == :error
    end

    # What only this node may say, or has no stamp: nobody knows when it was given.
    for request <- [
          {:stamp, :ref},
          {:command, :start, ref},
          {:command, :start, ref, {:asked, 5}},
          {:command, :start, ref, nil},
          {:command, :start, ref, nil, "a@b"},
          {:command, :start, ref, {7, 5}, "two\nlines"},
          {:command, :start, ref, {7, 5}, :a@b},
          {:in_time, :reset, ref, 5},
          {:say, [], nil}
        ] do
      assert MeshConsumer.command(:consumer1, request) == :error
      refute_received {:"$gen_cast", _any}
    end

    # Another robot of this name is a rival, if it speaks for itself.
    assert MeshConsumer.deliver(:all, :b@lab, beat(:consumer1)) == :ok
    assert_received {:"$gen_cast", {:rival, {7, :b@lab}, nil}}
    assert_received {:"$gen_cast", {:hear, _}}
    assert MeshConsumer.deliver([:consumer1], :b@lab, beat(:consumer1)) == :ok
    refute_received {:"$gen_cast", {:rival, _, _}}
  end
end
