defmodule Swarm.ReplacementTest do
  @moduledoc "One robot of this node with fake wheels: which orders it takes, and what comes of them."
  use Swarm.Case, async: false
  alias Robot.Mission.Manual
  alias Swarm.{Replacement, StandMission}
  alias Swarm.Replacement.Order
  @moduletag :capture_log
  @moduletag :realtime

  defp replaceable(id, options \\ []) do
    robot(id, [replace: true, comms: [boot: 7]] ++ options)
    standing([id])
    id
  end

  defp mission(id), do: value(id, :mission)
  defp replaced(id), do: value(id, :replaced)

  defp value(id, key) do
    case Board.fetch(Board.find!(id), key, :infinity) do
      {:ok, value, _at_ms} -> value
      :error -> nil
    end
  end

  defp stamp(id) do
    GenServer.cast(Names.whereis(id, :comms), {:stamp, ref = :erlang.alias([:reply])})
    receive(do: ({^ref, stamp} -> stamp))
  end

  # An order as it comes from anywhere.
  defp give(id, request, stamp) do
    GenServer.cast(
      Names.whereis(id, :comms),
      {:command, request, ref = :erlang.alias([:reply]), stamp}
    )

    receive(do: ({^ref, answer} -> answer))
  end

  defp content(id, mission \\ StandMission) do
    {:ok, content} = Replacement.order([id], mission)
    content
  end

  test "a robot that is on a mission stands, changes and goes on; its next start is of the new one" do
    id = replaceable(:repl_on)
    assert order(fn -> Swarm.goto(id, {1, 1}) end) == :ok
    assert order(fn -> Swarm.start(StandMission, robots: [id], formation: :wedge) end) == :ok
    assert %{state: {StandMission, :stand}, options: [formation: :wedge]} = mission(id)
    listen(id, [:robot, :stage])

    assert order(fn -> Swarm.replace(id, {StandMission, formation: :line}) end) == :ok
    assert_receive {_stage, %{stage: :replacement, what: :changing}}, 10_000
    assert_receive {_stage, %{stage: :replacement, what: :replaced} = about}, 10_000
    assert about.from == "#{node()}"
    assert about.says == "was given #{Swarm.MissionRegistry.name(StandMission)} by #{node()}"
    eventually(fn -> match?(%{state: {_, :stand}, options: [formation: :line]}, mission(id)) end)
    assert Swarm.status(id).replaced == about.says
    assert inspect(Swarm.status(id)) =~ about.says

    # What was given last is watched.
    watched = {:error, "#{id}: what it was given last is watched for 10 s first"}
    eventually(fn -> Swarm.replace(id, {StandMission, formation: :line}) == watched end)

    assert order(fn -> Swarm.stop(id) end) == :ok
    assert order(fn -> Swarm.tell(id, "start") end) == :ok
    assert %{options: [formation: :line]} = mission(id)
  end

  test "one that stands, or obeys an order of its own, is not disturbed, and its next start is of the new one" do
    id = replaceable(:repl_idle)
    assert order(fn -> Swarm.goto(id, {1, 1}) end) == :ok
    assert order(fn -> Swarm.replace(id, {StandMission, formation: :line}) end) == :ok
    eventually(fn -> match?(%{mission: {StandMission, [formation: :line]}}, replaced(id)) end)
    assert %{state: {Manual, :goto}} = mission(id)
    assert order(fn -> Swarm.stop(id) end) == :ok
    assert order(fn -> Swarm.tell(id, "start") end) == :ok
    assert %{state: {StandMission, :stand}, options: [formation: :line]} = mission(id)
  end

  test "a robot whose file does not allow it refuses" do
    id = robot(:repl_off)

    assert order(fn -> Swarm.replace(id, StandMission) end) ==
             {:error,
              "repl_off: its mission cannot be replaced: its file does not say replace: true"}

    assert replaced(id) == nil
  end

  test "the latch of the emergency stop refuses, and a person's stop after the order wins" do
    id = replaceable(:repl_stop)
    assert order(fn -> Swarm.start(StandMission, robots: [id]) end) == :ok
    assert order(fn -> Swarm.estop() end) == :ok
    assert {:error, line} = order(fn -> Swarm.replace(id, StandMission) end)
    assert line == "#{id}: it is held by the emergency stop; reset it first"
    assert order(fn -> Swarm.reset() end) == :ok

    assert order(fn -> Swarm.start(StandMission, robots: [id]) end) == :ok
    assert order(fn -> Swarm.replace(id, {StandMission, formation: :line}) end) == :ok
    assert order(fn -> Swarm.stop(id) end) == :ok
    eventually(fn -> match?(%{mission: {StandMission, _}, changing?: false}, replaced(id)) end)
    # Whatever is still under way: two ticks of the node's process.
    for _ <- 1..2, do: :sys.get_state(Replacement.Server)
    assert mission(id).state == :idle
  end

  test "unsigned, signed by another key, for another robot or time, changed, replayed: all are refused" do
    id = replaceable(:repl_key)
    {:replace, content, mac} = Replacement.seal(content(id), id, stamp(id))
    unsigned = {:error, "repl_key: this order is not signed by its fleet's key"}

    for mac <- [nil, "", :crypto.strong_rand_bytes(32), mac],
        do: assert(give(id, {:replace, content, mac}, stamp(id)) == unsigned)

    now = stamp(id)
    other = :crypto.mac(:hmac, :sha256, "another key", Order.signed_bytes(id, now, content))
    assert give(id, {:replace, content, other}, now) == unsigned

    now = stamp(id)
    {:replace, content, mac} = Replacement.seal(content, :repl_other, now)
    assert give(id, {:replace, content, mac}, now) == unsigned

    now = stamp(id)
    {:replace, content, mac} = Replacement.seal(content, id, now)
    assert give(id, {:replace, content <> <<0>>, mac}, now) == unsigned
    assert replaced(id) == nil

    assert give(id, {:replace, content, mac}, now) == :ok

    assert give(id, {:replace, content, mac}, now) ==
             {:error, "repl_key: this order was given before; repeat it"}

    {7, at_us} = now
    assert {:error, line} = give(id, {:replace, content, mac}, {7, at_us - 600_000})
    assert line =~ "too late"
    assert {:error, line} = give(id, {:replace, content, mac}, {6, at_us})
    assert line =~ "too late"
    assert {:error, line} = give(id, {:replace, content, mac}, nil)
    assert line =~ "too late"
  end

  test "what is signed, and malformed, or too large, or not for it, is refused" do
    id = replaceable(:repl_junk)

    for {content, line} <- [
          {"junk", "this order is malformed"},
          {:erlang.term_to_binary({2, 1}), "this order is malformed"},
          {content(:repl_other), "this order is malformed"},
          {String.duplicate("a", Order.most_bytes() + 1), "this order is larger than 128 kB"}
        ] do
      now = stamp(id)
      assert give(id, Replacement.seal(content, id, now), now) == {:error, "#{id}: #{line}"}
    end

    for request <- [{:replace, content(id)}, {:replace, 7, 7}, {:replace, "a", "b", "c"}] do
      GenServer.cast(Names.whereis(id, :comms), {:command, request, :erlang.alias(), stamp(id)})
    end

    assert {:ok, _up} = Swarm.tell(id, "ping")
    assert replaced(id) == nil
  end

  test "what people type is checked before it is sent" do
    id = replaceable(:repl_said)
    assert {:error, "mission :nothing is not known; " <> _} = Swarm.replace(id, :nothing)

    assert {:error, "spacing is not an option of standing"} =
             Swarm.replace(id, {StandMission, spacing: 1})

    assert {:error, "no robot :repl_nobody; " <> _} = Swarm.replace(:repl_nobody, StandMission)
    assert {:error, "mission: expected " <> _} = Swarm.replace(id, 7)
    # No code comes along.
    assert {:error, "mission: expected " <> _} = Swarm.replace(id, {:code, StandMission, []})

    deep = Enum.reduce(1..300, [], fn _n, deep -> [deep] end)

    for options <- [
          [formation: self()],
          [formation: fn -> 1 end],
          [formation: List.duplicate([], 10_000)],
          [formation: deep]
        ] do
      assert {:error, line} = Swarm.replace(id, {StandMission, options})
      assert line == "options: expected data of at most 64 kB, without processes and functions"
    end
  end
end
