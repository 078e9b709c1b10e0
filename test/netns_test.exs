Code.require_file("netns/case.exs", __DIR__)
why_not = Vm.Net.why_not()
if why_not, do: IO.puts("the tests in network namespaces are skipped: #{why_not}")

# Each is a module of its own, so that they wait side by side.
defmodule System.NetnsTest do
  @moduledoc "Networks that are cut in two (`Netns.Case`)."
  use Netns.Case, async: true
  @healed_ms 10_000

  test "cut in two, each part leads itself; healed, all are one, and old commands are dropped",
       %{fleet: fleet} do
    begun = start(fleet)
    start = formed(fleet, begun)
    across = [mag1: :mag3, mag5: :mag2]
    under_way = for {from, to} <- across, do: Fleet.call(fleet, from, Netns.Order, :prepare, [to])
    cut = Fleet.cut(fleet, @parts, &Net.split(&1, @parts))

    # Nobody has noticed yet: TCP keeps these for later, those whose robot has told its time before, and the others.
    for {{from, to}, order} <- Enum.zip(across, under_way) do
      :ok = Fleet.call(fleet, from, Netns.Order, :give, [order, {:goto, -5.0, 3.0, nil}])
      answer = Fleet.call(fleet, from, Swarm, :goto, [to, {-5.0, 3.0}])
      assert answer == {:error, "#{to} does not answer"}
    end

    apart = for part <- @parts, do: led(fleet, cut + @gone_ms * 1_000, part) + @gone_ms
    for part <- @parts, do: formed(fleet, cut + @gone_ms * 1_000, part)
    last(cut, 8_000)
    healed = Fleet.heal(fleet)
    led = led(fleet, healed, @all)
    formed = formed(fleet, healed)
    assert formed <= @healed_ms
    assert leader(fleet) in @larger

    Fleet.await(fleet, "old commands are dropped", 2 * @patience_ms, fn lines ->
      for({_, who, _, %{too_old: _}} <- Story.lines(lines, :rejected, healed, @all), do: who)
      |> Enum.uniq()
      |> Enum.sort() == [:mag2, :mag3]
    end)

    assert for({_, _, {:goto, _, _, _}} <- told(fleet, :command, cut), do: :goto) == []
    assert formed(fleet, healed) == formed

    lawful(fleet, "cut in two", begun,
      start: start,
      apart: Enum.max(apart),
      healed_led: led,
      healed_formed: formed
    )
  end

  @tag long: true, realtime: :long
  test "under the policy of a majority only the larger part leads itself", %{fleet: fleet} do
    begun = start(fleet, policy: :majority)
    formed(fleet, begun)
    cut = Fleet.cut(fleet, @parts, &Net.split(&1, @parts))
    led = led(fleet, cut + @gone_ms * 1_000, @larger) + @gone_ms

    waiting =
      when?(fleet, "the smaller part waits", cut, fn now ->
        Enum.all?(@smaller, &match?(%{phase: :wait}, now.claims[&1]))
      end)

    formed(fleet, cut + @gone_ms * 1_000, @larger)
    last(cut, waiting + 2 * @gone_ms)
    healed = Fleet.heal(fleet)
    assert for({_, _, %{phase: :lead}} <- told(fleet, :claim, cut, @smaller), do: :lead) == []
    back = led(fleet, healed, @all)
    formed = formed(fleet, healed)
    assert formed <= @healed_ms

    lawful(fleet, "majority", begun,
      apart: led,
      waiting: waiting,
      healed_led: back,
      healed_formed: formed
    )
  end
end

defmodule System.NetnsStopTest do
  @moduledoc "An emergency stop in a network that is cut."
  use Netns.Case, async: true

  @estop_ms 200
  # From 0.5 m/s by 0.5 m/s2, and what the wheels lag behind: then a body that was told to stand does.
  @brakes_ms 1_500
  # From a link that works again to what it was kept from: a heartbeat comes each 200 ms.
  @heard_ms 1_000

  test "an e-stop in a cut reaches all that are reachable, and the others once healed", %{
    fleet: fleet
  } do
    start(fleet)
    cut = Fleet.cut(fleet, @parts, &Net.split(&1, @parts))
    last(cut, @gone_ms)
    pressed = Log.now()
    Fleet.call(fleet, :mag1, Swarm, :estop, [])
    reached = stopped(fleet, pressed, @larger)
    assert reached <= @estop_ms
    last(pressed, @gone_ms)
    assert told(fleet, :estop, pressed, @smaller) == []

    # Some hear it before all the network is whole.
    healed = Fleet.heal(fleet)
    late = stopped(fleet, pressed, @smaller) - since(healed, pressed)
    assert late <= @heard_ms

    # Nobody moves till a person says so, and then they can.
    still = Log.now()
    last(still, 3_000)
    moved = for {who, ms, pose} <- told(fleet, :body, still), ms > @brakes_ms, do: {who, ms, pose}
    assert moved == []
    # The stop needs the radio only; who answers for a reset, is connected.
    met(fleet)
    assert told(fleet, :reset, pressed) == []
    assert order(fn -> Fleet.call(fleet, :mag5, Swarm, :reset, []) end) == :ok
    again = start(fleet)

    Fleet.await(fleet, "they drive", @patience_ms, fn _lines ->
      told(fleet, :body, again) != []
    end)

    lawful(fleet, "e-stop", again, reached: reached, healed_reached: late)
  end

  # When the last of these stood, in ms from then on.
  defp stopped(fleet, from, robots) do
    Fleet.await(fleet, "#{inspect(robots)} are stopped", @patience_ms, fn lines ->
      stops =
        Map.new(
          Enum.reverse(Story.lines(lines, :estop, from, robots)),
          &{elem(&1, 1), elem(&1, 0)}
        )

      if map_size(stops) == length(robots), do: stops |> Map.values() |> Enum.max() |> since(from)
    end)
  end
end

defmodule System.NetnsKillTest do
  @moduledoc "Links and nodes that fail one by one."
  use Netns.Case, async: true

  test "kill -9 of the leader: another leads; its node comes back and follows", %{fleet: fleet} do
    begun = start(fleet)
    formed(fleet, begun)
    leader = leader(fleet)
    killed = Fleet.kill(fleet, leader)
    rest = @all -- [leader]
    led = led(fleet, killed, rest)
    formed = formed(fleet, killed, rest)
    next = leader(fleet, rest)

    Fleet.revive(fleet, leader)
    on = Log.now()
    met(fleet)
    start(fleet, robots: [leader])
    back = led(fleet, on, @all)
    assert leader(fleet) == next
    lawful(fleet, "kill -9 of the leader", begun, led: led, formed: formed, back: back)
  end

  @tag long: true, realtime: :long
  test "one link is cut for good: nothing changes, and commands go by way of others", %{
    fleet: fleet
  } do
    begun = start(fleet)
    formed(fleet, begun)
    leader = leader(fleet)
    [other | _] = @all -- [leader]
    cut = Fleet.cut(fleet, [@all], &Net.block(&1, leader, other))

    # Both radios say that they do not hear each other; then as long again as a leader is waited for.
    Fleet.await(fleet, "the two do not hear each other", @patience_ms, fn lines ->
      deaf = for {_, who, _, {_, [_, _, _]}} <- Story.lines(lines, :mesh, cut, @all), do: who
      Enum.sort(Enum.uniq(deaf)) == Enum.sort([leader, other])
    end)

    last(Log.now(), 2 * @gone_ms)
    assert told(fleet, :view, cut) == []
    assert changes(fleet, cut) == []
    assert told(fleet, :commit, cut) == []

    for {from, to} <- [{leader, other}, {other, leader}] do
      status = Fleet.call(fleet, from, Swarm, :status, [to])
      assert %{from: :robot, robot: ^to, leader: ^leader} = status
    end

    Fleet.heal(fleet)

    Fleet.await(fleet, "all hear all", @patience_ms, fn lines ->
      Enum.all?([leader, other], fn robot ->
        {_, _, _, {_number, alive}} = List.last(Story.lines(lines, :mesh, cut, [robot]))
        length(alive) == length(@all) - 1
      end)
    end)

    assert changes(fleet, cut) == []
    assert Story.formed?(Story.now(Fleet.lines(fleet)), @all)
    lawful(fleet, "one link cut", begun, [])
  end

  @tag long: true, realtime: :long
  test "with 20 % of all packets lost they form, and stay one", %{fleet: fleet} do
    begun = start(fleet)
    lossy = Fleet.cut(fleet, [@all], &Net.lose(&1, 0.2))
    led = led(fleet, lossy, @all)
    formed = formed(fleet, lossy)
    leader = leader(fleet)
    last(Log.now(), 5_000)
    assert leader(fleet) == leader

    assert Enum.uniq(for {who, _, %{phase: :lead}} <- told(fleet, :claim, lossy), do: who) == [
             leader
           ]

    lawful(fleet, "20 % loss", begun, start_led: led, start_formed: formed)
  end

  @tag long: true, realtime: :long
  test "a robot that gets another address goes on where it is, and is commanded there", %{
    fleet: fleet
  } do
    begun = start(fleet)
    formed(fleet, begun)
    [moved | _] = @all -- [leader(fleet)]
    at = Fleet.cut(fleet, [@all], &Net.move(&1, moved))
    others = @all -- [moved]
    address = Net.moved(Fleet.net(fleet), moved)

    # Its connections are dead, as a release finds out after 8 s (net_ticktime); then come new ones.
    for robot <- others do
      Fleet.call(fleet, robot, :erlang, :disconnect_node, [:"#{moved}@convoy"])
      Fleet.call(fleet, moved, :erlang, :disconnect_node, [:"#{robot}@convoy"])
    end

    Fleet.await(fleet, "it is connected by its new address", @patience_ms, fn _lines ->
      Enum.all?(others, &(Fleet.call(fleet, &1, Netns.Connection, :address, [moved]) == address))
    end)

    for from <- others,
        do: assert(%{from: :robot} = Fleet.call(fleet, from, Swarm, :status, [moved]))

    assert told(fleet, :view, at) == []
    assert changes(fleet, at) == []
    lawful(fleet, "another address", begun, [])
  end
end
