defmodule Swarm.MessageTest do
  @moduledoc "The receiver survives whatever arrives from outside."
  use ExUnit.Case, async: true
  alias Swarm.Message
  alias Swarm.Agreement.Round
  alias Swarm.Membership.Heartbeat
  alias Swarm.Message.{Checked, Receiver}
  doctest Swarm.EStop.State
  doctest Swarm.Order.Freshness
  doctest Swarm.Comms.NameClaim
  doctest Swarm.Wire
  doctest Swarm.Wire.StopTags
  doctest Checked
  doctest Receiver
  doctest Swarm.Comms.PingReply

  @beat %Heartbeat{boot: 1, sequence: 1, pose: {0, 0, 0}, twist: {0, 0}}
  @claim %Robot.Mission.Claim{mission: Some.Mission, version: 1, fields: %{}}
  @letter %Round.Letter{id: {1, 1, :mag1}, view: [:mag1], remaining_ms: 10, purpose: :search}

  test "a message is checked once a node, and only what this node has marked is believed" do
    message = Message.new(:mag1, :heartbeat, @beat)
    assert {mark, ^message} = marked = Checked.mark(message)
    assert is_reference(mark)
    assert Checked.open(marked) == {:ok, message}

    wrong = Message.new(:mag1, :heartbeat, %{@beat | pose: :here})
    assert Checked.mark(wrong) == wrong
    assert Checked.open(wrong) == {:error, :heartbeat}

    for mark <- [make_ref(), nil],
        do: assert(Checked.open({mark, wrong}) == {:error, :not_a_message})
  end

  defp junk do
    Enum.random([
      nil,
      :atom,
      "text",
      1,
      -1,
      1.5,
      1.0e300,
      999_999_999_999_999,
      [],
      [:a | :b],
      [1],
      [[]],
      {},
      {1},
      {1, 2},
      {1, 2, 3},
      {1.5, nil, :x},
      {:column, :x},
      {:circle, 1},
      %{},
      %{size_ppm: :x, distance: nil},
      %{size_ppm: 1, distance: -1},
      %{:a => 1, 2 => 3},
      %{merit: 1, pose: nil},
      %{mag1: %{}},
      self(),
      make_ref(),
      fn -> 1 end,
      %{__struct__: Heartbeat},
      %{__struct__: :nothing},
      <<1::3>>,
      @beat,
      @claim
    ])
  end

  test "no damaged message raises, or passes as valid with a number out of range" do
    for _ <- 1..20_000 do
      {kind, whole} =
        Enum.random(
          heartbeat: @beat,
          heartbeat: %{@beat | claim: @claim},
          claim: @claim,
          round: @letter
        )

      key = whole |> Map.keys() |> Enum.random()

      body =
        case Enum.random(1..3) do
          1 ->
            Map.delete(whole, key)

          2 ->
            Map.put(whole, key, junk())

          3 ->
            whole |> Map.put(key, junk()) |> Map.put(whole |> Map.keys() |> Enum.random(), junk())
        end

      message = Message.new(:mag1, kind, body)

      message =
        if :rand.uniform(20) == 1,
          do: Map.put(message, Enum.random([:from, :kind, :body]), junk()),
          else: message

      {heard, receiver} = Receiver.take(Receiver.new(:mag2), Message.check(message), 0)

      case heard do
        {:heartbeat, id, _beat} ->
          assert %{mode: _} = Swarm.Membership.Peers.percept(receiver.peers, id, 0)

        {:message, _message} ->
          :ok

        :nothing ->
          assert map_size(receiver.rejected) == 1
      end
    end
  end

  test "of a mission that this build does not have, only the robot's body is heard" do
    beat = %{@beat | claim: %{@claim | fields: %{more: :binary.copy("x", 1_000_000)}}}
    assert {:ok, %{body: @beat}} = Message.check(Message.new(:mag1, :heartbeat, beat))
    {:ok, relayed} = Message.pass_on(Message.new(:mag1, :heartbeat, beat), :mag2)
    assert {:ok, %{body: %{body: @beat}}} = Message.check(relayed)
  end

  test "sizes are bounded, and names must be names" do
    many = List.duplicate(1, 1_000_000)
    names = List.duplicate(:mag1, 1_001)
    large = :binary.copy("x", 1_000_000)
    report = %{merit: 1, pose: {0, 0, 0}, led: 0, of: 0}

    for {kind, body} <- [
          claim: @claim,
          claim: nil,
          claim: %{@claim | fields: large},
          heartbeat: %{@beat | heard: <<0, large::binary, 0>>},
          heartbeat: %{@beat | heard: [:mag1]},
          heartbeat: %{@beat | sequence: Integer.pow(10, 1_000)},
          heartbeat: %{@beat | boot: Integer.pow(10, 1_000)},
          heartbeat: %{@beat | claim: %{@claim | fields: large}},
          heartbeat: %{@beat | claim: Map.put(@claim, :more, large)},
          round: %{@letter | view: names},
          round: %{@letter | digest: large},
          round: %{@letter | report: Map.put(report, :more, large)},
          round: %{
            @letter
            | known:
                Map.new(many |> Enum.take(1_001) |> Enum.with_index(), fn {_, k} -> {k, nil} end)
          }
        ] do
      assert Message.check(Message.new(:mag1, kind, body)) == {:error, kind}
    end

    assert Message.check(Message.new(nil, :heartbeat, @beat)) == {:error, :not_a_message}
    assert {:ok, _} = Message.check(Message.new(:mag1, :round, %{@letter | report: report}))
  end

  test "a number that is far too high leaves room for later ones" do
    round = Round.open(Round.new(:mag1), 1, [:mag1, :mag2], :search, 100, 0)

    for id <- [{999_999_999, 1, :mag2}, {1, 999_999_999, :mag2}] do
      letter = %{@letter | id: id, view: [:mag1, :mag2]}
      assert Round.hear(round, :mag2, letter, 0) == round
    end

    near = %{@letter | id: {7, 1, :mag2}, view: [:mag1, :mag2]}
    assert Round.hear(round, :mag2, near, 0).id == near.id

    # A wrong sequence number of a robot is forgotten with the robot.
    peers =
      Swarm.Membership.Peers.hear(
        Swarm.Membership.Peers.new(:mag2),
        :mag1,
        %{@beat | sequence: 1_000_000_000},
        0
      )

    assert Swarm.Membership.Peers.hear(peers, :mag1, @beat, 1_900) == peers
    assert Swarm.Membership.Peers.hear(peers, :mag1, @beat, 2_000).rows.mag1.beat == @beat
  end

  test "repeated calls from two lives of a node do not count as new in turn" do
    alias Swarm.EStop
    calls = for boot <- [7, 5], counter <- [1, 2], do: {:base@hall, boot, counter}

    stop =
      calls |> Enum.reduce(EStop.State.new(), &EStop.State.call(&2, &1)) |> EStop.State.reset()

    assert Enum.reduce(calls ++ calls, stop, &EStop.State.call(&2, &1)) == stop
    assert EStop.State.held?(EStop.State.call(stop, {:base@hall, 5, 3}))
    assert EStop.State.held?(EStop.State.call(stop, {:base@hall, 8, 1}))
  end
end
