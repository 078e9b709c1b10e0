defmodule Swarm.Membership.PeersTest do
  use ExUnit.Case, async: true
  alias Swarm.Membership.{Heartbeat, Peers}
  doctest Peers

  defp beat(boot, sequence, x \\ 0),
    do: %Heartbeat{boot: boot, sequence: sequence, pose: {x, 0, 0}, twist: {0, 0}}

  defp hear(peers, boot, sequence, now_ms),
    do: Peers.hear(peers, :mag2, beat(boot, sequence, boot * 100 + sequence), now_ms)

  defp newest(peers), do: elem(peers.rows.mag2.beat.pose, 0)

  test "percepts are those of the newest heartbeats at any time, whoever falls silent, and if the clock jumps" do
    for _ <- 1..50 do
      Enum.reduce(1..60, {Peers.new(:me), 0}, fn sequence, {peers, now_ms} ->
        now_ms = now_ms + Enum.random([10, 200, 700, 1_500, 2_500, -100])
        from = Enum.random([:mag1, :mag2, :mag3, :min1])

        peers =
          Peers.hear(peers, from, beat(1, sequence, sequence), now_ms, Enum.random([true, false]))

        for later_ms <- [0, 150, 1_999, 2_000], at_ms = now_ms + later_ms do
          one_by_one = for id <- Map.keys(peers.rows), do: {id, Peers.percept(peers, id, at_ms)}
          assert Peers.percepts(peers, at_ms) == Map.new(one_by_one)
        end

        {peers, now_ms}
      end)
    end
  end

  test "a peer is suspect after 1 s, gone after 2 s, and stays an obstacle" do
    peers = hear(Peers.new(:mag1), 1, 1, 0)

    for {at_ms, status, mode, heard, view} <- [
          {999, :alive, :moving, [:mag2], [:mag1, :mag2]},
          {1_000, :suspect, :moving, [], [:mag1, :mag2]},
          {1_999, :suspect, :moving, [], [:mag1, :mag2]},
          {2_000, :gone, :dead, [], [:mag1]},
          {900_000, :gone, :dead, [], [:mag1]}
        ] do
      assert Peers.status(peers, :mag2, at_ms) == status
      assert Peers.percepts(peers, at_ms).mag2.mode == mode
      assert Peers.heard(peers, at_ms) == heard
      assert Peers.view(peers, at_ms) == view
      assert Peers.gone(peers, at_ms) == [:mag2] -- view
      assert Map.keys(Peers.beats(peers, at_ms)) == view -- [:mag1]
    end

    assert Peers.status(peers, :mag1, 900_000) == :alive
    assert Peers.status(peers, :mag9, 0) == :gone
  end

  test "late and duplicate heartbeats change nothing, not even the age" do
    peers = Peers.new(:mag1) |> hear(1, 5, 0) |> hear(1, 5, 900) |> hear(1, 4, 900)
    assert newest(peers) == 105
    assert Peers.status(peers, :mag2, 1_000) == :suspect
  end

  test "a restarted robot counts as another, and its former life is over" do
    peers = Peers.new(:mag1) |> hear(1, 900, 0) |> hear(2, 1, 100) |> hear(1, 901, 200)
    assert newest(peers) == 201
  end

  test "a clock that was set back silences nobody for long" do
    peers = Peers.new(:mag1) |> hear(9, 1, 0) |> hear(3, 1, 1_000)
    assert newest(peers) == 901
    assert peers |> hear(3, 2, 2_000) |> newest() == 302
  end

  test "in any order the newest wins" do
    for _ <- 1..100 do
      lives = for boot <- 1..3, sequence <- 1..4, do: {boot, sequence}

      peers =
        lives
        |> Enum.shuffle()
        |> Enum.reduce(Peers.new(:mag1), fn {b, s}, p -> hear(p, b, s, 0) end)

      assert newest(peers) == 304
    end
  end

  test "the number of the view grows with each robot that comes, goes, returns or restarts" do
    peers = Peers.new(:mag1)
    assert Peers.members(peers, 0) == {0, []}
    peers = hear(peers, 1, 1, 0)
    assert Peers.members(peers, 0) == {1, [mag2: 1]}
    peers = hear(peers, 1, 2, 500)
    assert Peers.members(peers, 2_499) == {1, [mag2: 1]}
    assert Peers.members(peers, 2_500) == {2, []}
    peers = hear(peers, 1, 3, 3_000)
    assert Peers.members(peers, 3_000) == {3, [mag2: 1]}
    peers = hear(peers, 2, 1, 3_100)
    assert Peers.members(peers, 3_100) == {4, [mag2: 2]}
    # Gone, and back in another life: two changes.
    assert peers |> hear(3, 1, 9_000) |> Peers.members(9_000) == {6, [mag2: 3]}
  end

  test "a relayed heartbeat is a sign of life, but does not count as heard" do
    peers = Peers.hear(Peers.new(:mag1), :mag2, beat(1, 1), 0, false)
    assert Peers.view(peers, 0) == [:mag1, :mag2]
    assert Peers.heard(peers, 0) == []
    # The direct one was overtaken.
    peers = Peers.hear(peers, :mag2, beat(1, 1), 40, true)
    assert Peers.heard(peers, 900) == [:mag2]
    peers = Peers.hear(peers, :mag2, beat(1, 2), 990, false)
    assert Peers.heard(peers, 1_000) == []
    assert Peers.status(peers, :mag2, 1_900) == :alive
  end

  test "nobody hears itself" do
    assert Peers.hear(Peers.new(:mag1), :mag1, beat(1, 1), 0) == Peers.new(:mag1)
  end
end
