defmodule Bench.Mesh.Runner do
  @moduledoc false
  # Measures one fleet: N nodes with a robot each and a base that asks, or one node with many. Bare
  # OTP runs first and ends before ours starts, so that neither disturbs the other.
  #
  # Fast cases are repeated many times inside the nodes; slow ones (a start, a death) are done a few
  # times from here.
  alias Bench.Mesh
  alias Bench.Mesh.{Bare, Figures, Nodes}

  @talk [:ping, :gather, :round, :join]
  @patience_ms 10_000
  @rate_s 5
  # Nodes that have just met compare their clocks more often.
  @settle_s 5
  @idle_s 15

  @typedoc """
  `share` is the share of the usual repetitions; `note` is called with what is going on.
  """
  @type plan :: %{
          cases: [Mesh.case()],
          share: float(),
          note: (String.t() -> term())
        }

  @doc "The rows of a fleet of so many nodes, or of so many robots in one node."
  @spec rows(Mesh.size(), robots :: pos_integer(), plan()) :: [Mesh.Report.row()]
  def rows(size, robots, plan) do
    bare = measure(:bare, size, robots, plan)
    ours = measure(:ours, size, robots, plan)

    for case <- plan.cases, figures = ours[case.name] do
      beside = if case.bare, do: bare[case.bare]
      %{case: case, size: size, robots: robots, ours: figures, bare: beside}
    end
  end

  defp measure(kind, :one, robots, plan) do
    fleet = Nodes.fleet(kind, robots)
    names = for n <- 1..robots, do: Nodes.name(fleet, n)

    try do
      node = Nodes.start(fleet, 0, names, 2)
      s = state(fleet, plan, :one, [node], node, names)
      _at_ns = Nodes.call(node, s.code, :full, [1, names])
      [:ping, :gather, :round, :rate] |> Enum.reduce(%{}, &one(&1, &2, s))
    after
      Nodes.stop(fleet)
    end
  end

  defp measure(kind, count, _robots, plan) do
    fleet = Nodes.fleet(kind, count)
    names = for n <- 1..count, do: Nodes.name(fleet, n)
    plan.note.("#{kind}: #{count} nodes start")

    try do
      nodes = Nodes.start_all(fleet, for(n <- 1..count, do: {n, [Nodes.name(fleet, n)]}))
      s = state(fleet, plan, count, nodes, nil, names)
      full_ns = full(s, nodes, count)
      began_ns = nodes |> Enum.map(& &1.began_ns) |> Enum.min()
      base = Nodes.start(fleet, 0, [])
      meet(s, [base], nodes)
      Nodes.call(base, s.code, :full, [count + 1, names], 60_000)
      memory = for node <- nodes, do: Vm.resident(node.vm)
      fixed = %{start: [[(full_ns - began_ns) / 1_000]], memory: [memory]}
      fixed = if wanted?(s, :cpu), do: Map.put(fixed, :cpu, [idle(nodes)]), else: fixed

      fixed =
        for {name, values} <- fixed, wanted?(s, name), into: %{}, do: {name, Figures.of(values)}

      s = %{s | base: base}
      figures = Enum.reduce(@talk, fixed, &one(&1, &2, s))
      dead(s, slow(s, figures))
    after
      Nodes.stop(fleet)
    end
  end

  # Of a core, in percent, once they have met.
  defp idle(nodes) do
    pause(@settle_s)
    before = each(nodes, &spent_ms/1)
    pause(@idle_s)

    for {then, now} <- Enum.zip(before, each(nodes, &spent_ms/1)),
        do: (now - then) / (10 * @idle_s)
  end

  defp spent_ms(node) do
    {ms, _since_last} = Nodes.call(node, :erlang, :statistics, [:runtime])
    ms
  end

  defp pause(seconds) do
    receive do
    after
      seconds * 1_000 -> :ok
    end
  end

  defp state(fleet, plan, size, nodes, base, names) do
    code = if fleet.kind == :ours, do: Mesh.Convoy, else: Bare
    %{fleet: fleet, plan: plan, size: size, nodes: nodes, base: base, names: names, code: code}
  end

  # A case's own name, and the names of cases that need it as their bare OTP counterpart.
  defp wanted?(%{fleet: %{kind: :ours}} = s, name),
    do: Enum.any?(s.plan.cases, &(&1.name == name))

  defp wanted?(s, name), do: Enum.any?(s.plan.cases, &(&1.bare == name))

  defp one(name, figures, s) do
    if wanted?(s, name) and not (s.fleet.kind == :bare and name == :gather) do
      s.plan.note.("#{s.fleet.kind}: #{s.size} nodes, #{name}")
      Map.put(figures, name, talk(name, s))
    else
      figures
    end
  end

  defp talk(:rate, s) do
    rates = Nodes.call(s.base, s.code, :rates, [s.names, @rate_s])
    middle = Figures.of([rates]).p50
    %{p50: Enum.min(rates), p99: middle, max: Enum.max(rates), count: length(rates)}
  end

  defp talk(:join, s) do
    {batches, times} = Mesh.times(:join, s.size, s.plan.share)
    newcomer = Nodes.name(s.fleet, s.size + 1)
    batches(s, :joins, [hd(s.nodes).node, newcomer], batches, times)
  end

  defp talk(name, s) do
    {batches, times} = Mesh.times(name, s.size, s.plan.share)
    batches(s, :"#{name}s", [s.names], batches, times)
  end

  # The first batch is for warming up.
  defp batches(s, function, arguments, batches, times) do
    [_warm | measured] =
      for _ <- 0..batches, do: Nodes.call(s.base, s.code, function, arguments ++ [times])

    Figures.of(measured)
  end

  defp meet(%{code: Mesh.Convoy}, _new, _nodes), do: :ok

  defp meet(s, new, nodes) do
    all = for node <- nodes, do: node.node

    (new ++ nodes)
    |> Enum.uniq()
    |> Enum.filter(&(&1 in new))
    |> each(&Nodes.call(&1, s.code, :connect, [List.delete(all, &1.node)]))
  end

  defp full(s, nodes, count) do
    meet(s, nodes, nodes)
    nodes |> each(&Nodes.call(&1, s.code, :full, [count, s.names], 60_000)) |> Enum.max()
  end

  defp each(nodes, fun),
    do: nodes |> Enum.map(&Task.async(fn -> fun.(&1) end)) |> Task.await_many(60_000)

  # A robot's node is killed and started again, several times.
  defp dead(s, figures) do
    if wanted?(s, :kill) or wanted?(s, :cold) do
      {_batches, times} = Mesh.times(:kill, s.size, s.plan.share)
      {all, _s} = Enum.map_reduce(1..times, s, &die/2)
      {kills, colds} = Enum.unzip(all)

      for {name, values} <- [kill: kills, cold: colds],
          wanted?(s, name),
          into: figures,
          do: {name, Figures.of([values])}
    else
      figures
    end
  end

  defp die(time, s) do
    s.plan.note.("#{s.fleet.kind}: #{s.size} nodes, death and cold start #{time}")
    victim = List.last(s.nodes)
    watch(s, victim)
    killed_ns = Nodes.signal(victim, "KILL")
    left_ns = seen(s, :leave)
    if s.code == Mesh.Convoy, do: seen(s, :gone)
    watch(s, victim)
    again = Nodes.start(s.fleet, s.size, [victim.name])
    meet(s, [again], [s.base])
    came_ns = seen(s, :join)
    # If it were killed again before its first datagram came, nobody would miss it.
    if s.code == Mesh.Convoy, do: seen(s, :up)
    s = %{s | nodes: List.replace_at(s.nodes, -1, again)}
    {{(left_ns - killed_ns) / 1_000, (came_ns - again.began_ns) / 1_000}, s}
  end

  # Bare OTP notices a freeze only because its nodes are started with a short tick. That takes
  # seconds, so only three of them are measured.
  defp slow(%{code: Bare, size: size}, figures) when size > 3, do: figures

  defp slow(s, figures) do
    for {name, quiet, wake} <- [
          {:freeze, &Nodes.signal(&1, "STOP"), &Nodes.signal(&1, "CONT")},
          {:silence, &silence(&1, true), &silence(&1, false)}
        ],
        wanted?(s, name),
        into: figures do
      {_batches, times} = Mesh.times(name, s.size, s.plan.share)
      {name, Figures.of([for(n <- 1..times, do: fall_silent(s, name, n, quiet, wake))])}
    end
  end

  defp silence(node, quiet?), do: Nodes.call(node, Mesh.Convoy, :silence, [quiet?])

  # Bare OTP cuts a connection that was silent too long, and somebody has to connect again.
  defp fall_silent(%{code: Bare} = s, name, time, quiet, wake) do
    s.plan.note.("bare: #{s.size} nodes, #{name} #{time}")
    victim = List.last(s.nodes)
    watch(s, victim)
    began_ns = quiet.(victim)
    noticed_ns = seen(s, :leave)
    wake.(victim)
    watch(s, victim)
    Nodes.call(victim, Bare, :again, [[s.base.node | Enum.map(s.nodes, & &1.node)]])
    seen(s, :join)
    (noticed_ns - began_ns) / 1_000
  end

  defp fall_silent(s, name, time, quiet, wake) do
    s.plan.note.("ours: #{s.size} nodes, #{name} #{time}")
    victim = List.last(s.nodes)
    watch(s, victim)
    began_ns = quiet.(victim)
    noticed_ns = seen(s, :suspect)
    seen(s, :gone)
    wake.(victim)
    seen(s, :up)
    # Nobody is notified of what happens to a robot before it is known again.
    seen(s, :join)
    (noticed_ns - began_ns) / 1_000
  end

  defp watch(s, victim), do: :ok = Nodes.call(s.base, s.code, :watch, [victim.name, victim.node])

  defp seen(s, what) do
    case Nodes.call(s.base, Bench.Mesh.Watch, :seen, [what, @patience_ms]) do
      at_ns when is_integer(at_ns) -> at_ns
      nil -> raise "#{what} was not noticed within #{div(@patience_ms, 1_000)} s"
    end
  end
end
