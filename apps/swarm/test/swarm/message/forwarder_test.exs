defmodule Swarm.Message.ForwarderTest do
  use ExUnit.Case, async: true
  alias Robot.Mission.Letter
  alias Swarm.Message
  alias Swarm.Agreement.Round
  alias Swarm.Message.Forwarder
  alias Swarm.Membership.{Heartbeat, Peers}

  # What mag2 hears from mag1 and mag3, which list these robots as heard; numbered by time.
  defp peers(heard, now_ms) do
    beats =
      for {id, list} <- heard do
        beat = %Heartbeat{
          boot: 1,
          sequence: now_ms,
          pose: {0, 0, 0},
          twist: {0, 0},
          heard: Swarm.Membership.NameSet.new(list)
        }

        {id, beat}
      end

    beats
    |> Enum.reduce(Peers.new(:mag2), fn {id, beat}, p -> Peers.hear(p, id, beat, now_ms) end)
    |> Peers.percepts(now_ms)
  end

  # Runs so many ticks of 100 ms, with new heartbeats at each; returns what was sent in the last
  # one.
  defp run(heard, ticks, me \\ :mag2) do
    Enum.reduce(1..ticks, {Forwarder.new(), []}, fn n, {relay, _sent} ->
      Forwarder.beats(relay, me, peers(heard, n * 100), n * 100)
    end)
  end

  @apart [mag1: [:mag2], mag3: [:mag2]]

  test "forwards the heartbeats of two robots that do not hear each other, each once" do
    assert {_relay, []} = run(@apart, 3)
    {relay, sent} = run(@apart, 4)
    assert [{[:mag1], :mag3, 1}, {[:mag3], :mag1, 1}] = summary(sent)
    # The same again, without a new heartbeat.
    assert {_relay, []} = Forwarder.beats(relay, :mag2, peers(@apart, 400), 450)
    for {:send, _to, message} <- sent, do: assert({:ok, ^message} = Message.check(message))
  end

  defp summary(sent) do
    Enum.sort(
      for {:send, to, %{kind: :relay, from: :mag2, body: inner}} <- sent,
          do: {to, inner.from, inner.hops}
    )
  end

  test "forwards nothing if all hear each other, nor for a robot that does not hear this one" do
    assert {%{missing: missing}, []} = run([mag1: [:mag2, :mag3], mag3: [:mag1, :mag2]], 10)
    assert missing == %{}
    assert {_relay, []} = run([mag1: [], mag3: [:mag1, :mag2]], 10)
  end

  test "of several robots that could forward, the first two do" do
    all = [:aaa, :bbb, :mag1, :mag2, :mag3]
    others = [aaa: all -- [:aaa], bbb: all -- [:bbb]]
    apart = [mag1: [:aaa, :bbb, :mag2], mag3: [:aaa, :bbb, :mag2]] ++ others
    assert {_relay, []} = run(apart, 10)
    one = [mag1: [:aaa, :mag2], mag3: [:aaa, :bbb, :mag2]] ++ others
    # For what mag1 lacks, aaa is one way and this robot the other.
    {_relay, sent} = run(one, 10)
    assert summary(sent) == [{[:mag1], :bbb, 1}, {[:mag1], :mag3, 1}]
  end

  test "forwards letters too, but the same one not more often than it is repeated" do
    {relay, _sent} = run(@apart, 4)
    peers = peers(@apart, 400)
    view = [:mag1, :mag2, :mag3]
    letter = %Round.Letter{id: {1, 1, :mag1}, view: view, remaining_ms: 90, purpose: :search}
    hear = &Forwarder.letter(&1, :mag2, peers, Message.new(:mag1, :round, &2), &3)

    assert {relay, [{:send, [:mag3], %{body: %{from: :mag1, hops: 1}}}]} =
             hear.(relay, letter, 400)

    assert {relay, []} = hear.(relay, %{letter | remaining_ms: 50}, 440)
    assert {relay, [_]} = hear.(relay, %{letter | report: nil, ask: true}, 450)
    assert {_relay, [_]} = hear.(relay, %{letter | ask: true, report: nil}, 540)
    far = %{Message.new(:mag1, :round, letter) | hops: 3}
    assert {_, []} = Forwarder.letter(relay, :mag2, peers, far, 900)
  end

  test "forwards a mission's letter to its addressees, and to no other robot" do
    {relay, _sent} = run(@apart, 4)
    peers = peers(@apart, 400)

    for {to, forwarded} <- [{:all, [[:mag3]]}, {[:mag2, :mag3], [[:mag3]]}, {[:mag2], []}] do
      letter = %Letter{to: to, mission: __MODULE__, version: 1, kind: :seen, fields: []}
      message = Message.new(:mag1, :mission, letter)
      {_relay, sent} = Forwarder.letter(relay, :mag2, peers, message, 400)
      assert for({:send, to, _relayed} <- sent, do: to) == forwarded

      for {:send, _to, relayed} <- sent do
        assert {:ok, ^relayed} = Message.check(relayed)
        assert relayed.body == %{message | hops: 1}
      end
    end
  end

  test "forwards no claim: it is for the robots alone that were sent it" do
    {relay, _sent} = run(@apart, 4)
    claim = %Robot.Mission.Claim{mission: __MODULE__, version: 1, fields: %{}}
    message = Message.new(:mag1, :claim, claim)
    assert {^relay, []} = Forwarder.letter(relay, :mag2, peers(@apart, 400), message, 400)
  end

  test "relays only whole heartbeats and letters, wrapped once" do
    beat = %Heartbeat{boot: 1, sequence: 1, pose: {0, 0, 0}, twist: {0, 0}}
    {:ok, relay} = Message.pass_on(Message.new(:mag1, :heartbeat, beat), :mag2)
    assert {:ok, ^relay} = Message.check(relay)
    inner = relay.body

    for body <- [
          nil,
          beat,
          relay,
          %{inner | hops: 0},
          %{inner | hops: 4},
          %{inner | hops: :far},
          %{inner | body: nil},
          %{inner | from: nil}
        ],
        do: assert({:error, :relay} = Message.check(%{relay | body: body}))
  end
end
