defmodule Soak.Deeds do
  @moduledoc """
  Does to a fleet what a schedule says (`Soak.Schedule`), and notes it for the judge before it takes effect.
  What is not possible now, such as to freeze a node that is down, is left out, and the journal says so.
  """
  alias Lab.Node.Log
  alias Soak.{Fleet, Junk, Orders, State}
  alias Soak.Fleet.Tree
  alias Vm.Net
  alias Lab.Node.Network

  @order_ms 8_000

  @doc "Does it, or begins it."
  @spec carry_out(State.t(), tuple() | atom()) :: State.t()
  def carry_out(s, {:process, robot, chance} = deed) do
    with_node(s, robot, deed, fn s, vm ->
      Orders.aside(fn -> {robot, Vm.call(vm, Tree, :kill, [chance], @order_ms)} end, fn {robot,
                                                                                         words} ->
        "killed on #{robot}: #{words || "nothing, there is no robot"}"
      end)

      s = %{s | processes: Map.put(s.processes, robot, now())}
      s |> State.count(:process) |> State.note({now(), :soak, :process, robot})
    end)
  end

  def carry_out(s, {:node, robot} = deed),
    do: with_node(s, robot, deed, &kill(&1, robot, &2, :node))

  def carry_out(s, :world), do: with_node(s, :world, :world, &kill(&1, :world, &2, :world))

  def carry_out(s, {:freeze, robot, ms} = deed) do
    with_node(s, robot, deed, fn s, vm ->
      :ok = Vm.freeze(vm)
      Process.send_after(self(), {:later, {:thaw, robot, vm}}, ms)
      s = %{s | frozen: MapSet.put(s.frozen, robot)}

      s
      |> State.count(:freeze)
      |> State.note({now(), :soak, :freeze, robot})
      |> State.write("frozen for #{ms} ms: #{robot}")
    end)
  end

  def carry_out(s, {kind, _what, ms} = deed) when kind in [:split, :loss],
    do: network(s, kind, ms, deed)

  def carry_out(s, {:block, _a, _b, ms} = deed), do: network(s, :block, ms, deed)

  def carry_out(s, {:junk, robot, kind, size, seed}) do
    at(s, robot, Junk.datagrams(kind, size, seed, Enum.reverse(s.recorded)))

    s
    |> State.count(:junk)
    |> State.write(
      "#{size} datagrams of junk (#{kind}, #{length(s.recorded)} recorded) to #{robot}"
    )
  end

  def carry_out(s, {:flood, robot, size, seed}) do
    mixed =
      Enum.flat_map([:random, :mutated], &Junk.datagrams(&1, 100, seed, Enum.reverse(s.recorded)))

    at(s, robot, mixed |> Stream.cycle() |> Stream.take(size))
    s |> State.count(:flood) |> State.write("flood of #{size} datagrams to #{robot}")
  end

  def carry_out(s, {:formation, kind}),
    do:
      %{s | formation: kind}
      |> Orders.order({:formation, [kind]})
      |> State.write("formation: #{kind}")

  def carry_out(s, {:landmark, place}) do
    with_node(s, :world, {:landmark, place}, fn s, vm ->
      Orders.aside(
        fn ->
          Vm.call(vm, Lab.Node.World, :change, [Lab.Node.Fleet, {:move, place}], @order_ms)
        end,
        fn :ok ->
          "the landmark moves"
        end
      )

      s
    end)
  end

  def carry_out(s, {:estop, robot}), do: estop(s, [robot | s.fleet.robots -- [robot]])

  def carry_out(s, :reset) do
    %{s | reset?: true}
    |> State.note({now(), :soak, :reset, nil})
    |> Orders.order({:reset, []})
    |> State.write("reset")
  end

  def carry_out(s, :start) do
    s = State.note(%{s | start_until_us: now() + 15_000_000}, {now(), :soak, :start, nil})
    State.write(s, "start of the mission, where it does not run")
  end

  def carry_out(s, :calm), do: State.write(%{s | start_until_us: now() + 30_000_000}, "calm")

  defp estop(s, robots) do
    case Enum.drop_while(robots, &(not State.here?(s, &1))) do
      [] ->
        State.write(s, "no e-stop: nobody is here")

      [from | others] ->
        s =
          %{s | reset?: false} |> State.count(:estop) |> State.note({now(), :soak, :estop, from})

        s
        |> Orders.call(from, {:estop, []}, {:estop_answer, from, others})
        |> State.write("e-stop ordered on #{from}")
    end
  end

  @doc "Ends what lasts, and hears the answer to an e-stop."
  @spec end_of(State.t(), tuple()) :: State.t()
  # A node whose robot is being started again knows of none, and says so; then a person presses another one's.
  def end_of(s, {{:estop_answer, from, others}, {:error, _line}, []}) do
    if s.judge.stops.order == nil,
      do: s,
      else: s |> State.note({now(), :soak, :estop_refused, from}) |> estop(others)
  end

  # Any other answer, also that somebody did not answer, is for the judge.
  def end_of(s, {{:estop_answer, _from, _others}, _answer, _known}), do: s

  def end_of(s, {:thaw, robot, vm}) do
    :ok = Vm.signal(vm, "CONT")

    case s.vms[robot] do
      ^vm ->
        State.note(%{s | frozen: MapSet.delete(s.frozen, robot)}, {now(), :soak, :thaw, robot})

      _another_life ->
        s
    end
  end

  def end_of(s, :network) do
    :ok = Net.heal(s.fleet.network.place)
    s |> State.note({now(), :soak, :heal, nil}) |> State.write("the network is whole")
  end

  defp kill(s, name, vm, kind) do
    s = %{s | ended: Map.put(s.ended, name, :killed)}
    s = s |> State.count(kind) |> State.write("kill -9 of #{name}")
    :ok = Vm.signal(vm, "KILL")
    s
  end

  defp network(s, kind, ms, deed) do
    # Nobody waits for the last cut beyond the end of the run.
    Process.send_after(self(), {:later, :network}, ms)
    pairs = Fleet.cut(s.fleet.network.place, deed)
    event = if pairs == [], do: {now(), :soak, :network, :loss}, else: {now(), :soak, :cut, pairs}
    s |> State.count(kind) |> State.note(event) |> State.write(text(deed))
  end

  defp text({:block, a, b, ms}), do: "the link of #{a} and #{b} is cut for #{ms} ms"

  defp text({:loss, share, ms}),
    do: "#{round(100 * share)} % of all packets are lost for #{ms} ms"

  defp text({:split, parts, ms}),
    do: "cut in two for #{ms} ms: " <> Enum.map_join(parts, " | ", &Enum.join(&1, " "))

  defp with_node(s, name, deed, do_it) do
    case s.vms[name] do
      vm when vm != nil -> if name in s.frozen, do: skip(s, deed), else: do_it.(s, vm)
      nil -> skip(s, deed)
    end
  end

  defp skip(s, deed), do: State.write(s, "left out, its node is not there: #{inspect(deed)}")

  defp now, do: Log.now()

  # Sends a stranger's datagrams to a node of a run, beside everything else.

  # Between so many datagrams of a flood others get their turn.
  @burst 200

  # Begins to send them to a robot's node; where there is no stranger, nothing.
  defp at(%{stranger: nil}, _robot, _datagrams), do: :ok

  defp at(s, robot, datagrams) do
    {address, port} = Network.address(s.fleet.network, robot)

    spawn(fn ->
      for burst <- Stream.chunk_every(datagrams, @burst) do
        for datagram <- burst, do: _ = :gen_udp.send(s.stranger, address, port, datagram)

        receive do
        after
          10 -> :ok
        end
      end
    end)

    :ok
  end
end
