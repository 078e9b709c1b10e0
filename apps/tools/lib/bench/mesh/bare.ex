defmodule Bench.Mesh.Bare do
  @moduledoc false
  # Measures the same on bare OTP: processes, `:pg`, `send`. Written in Erlang's style, so that its nodes load little of
  # Elixir.
  alias Bench.Mesh.Watch

  @scope :bare
  @look_ms 5

  @doc "Makes this node one with a directory, and with agents of these names."
  @spec main(false, [atom()]) :: :ok
  def main(false, names) do
    {:ok, _scope} = :pg.start(@scope)
    :lists.foreach(&:pg.join(@scope, {:robot, &1}, spawn(__MODULE__, :agent, [0, nil])), names)
  end

  @doc "Connects to all these."
  @spec connect([node()]) :: :ok
  def connect(nodes) do
    :lists.foreach(&:net_kernel.connect_node/1, nodes)
  end

  @doc "The same for a node that was away: first removes what is left of old connections."
  @spec again([node()]) :: :ok
  def again(nodes) do
    nodes = :lists.delete(:erlang.node(), nodes)
    :lists.foreach(&:erlang.disconnect_node/1, nodes)
    connect(nodes)
  end

  @doc false
  @spec agent(non_neg_integer(), term()) :: no_return()
  def agent(heard, asked) do
    receive do
      {:ping, from, ref} ->
        send(from, {ref, :pong})
        agent(heard, asked)

      {:round, pids, from, ref} ->
        others = :lists.delete(self(), pids)
        :lists.foreach(&send(&1, {:word, self()}), others)
        complete(heard, {from, ref, length(others)})

      {:word, _from} ->
        complete(heard + 1, asked)
    end
  end

  defp complete(all, {from, ref, all}) do
    send(from, {ref, :done})
    agent(0, nil)
  end

  defp complete(heard, asked), do: agent(heard, asked)

  @doc """
  Waits until this node is connected to all nodes and knows all agents; returns when that was.
  """
  @spec full(pos_integer(), [atom()]) :: at_ns :: integer()
  def full(nodes, names) do
    if length(:erlang.nodes()) >= nodes - 1 and length(pids(names)) == length(names) do
      Watch.now_ns()
    else
      receive do
      after
        @look_ms -> full(nodes, names)
      end
    end
  end

  @doc """
  Sends to all agents and waits for all answers, `count` times; returns the microseconds of each.
  """
  @spec pings([atom()], pos_integer()) :: [float()]
  def pings(names, count) do
    pids = pids(names)

    Watch.repeat(count, fn ->
      ref = make_ref()
      :lists.foreach(&send(&1, {:ping, self(), ref}), pids)
      :lists.foreach(fn _ -> receive do: ({^ref, :pong} -> :ok) end, pids)
    end)
  end

  @doc "Lets everybody write to everybody; returns the microseconds of each round."
  @spec rounds([atom()], pos_integer()) :: [float()]
  def rounds(names, count) do
    pids = pids(names)

    Watch.repeat(count, fn ->
      ref = make_ref()
      :lists.foreach(&send(&1, {:round, pids, self(), ref}), pids)
      :lists.foreach(fn _ -> receive do: ({^ref, :done} -> :ok) end, pids)
    end)
  end

  @doc """
  How long it takes until a process that joins on that node is reported here; microseconds each.
  """
  @spec joins(node(), atom(), pos_integer()) :: [float()]
  def joins(node, name, count) do
    {monitor, []} = :pg.monitor(@scope, {:robot, name})

    for _ <- 1..count do
      pid = :erlang.spawn(node, __MODULE__, :newcomer, [self(), name])
      receive do: ({^monitor, :join, _group, _pids} -> :ok)
      here_ns = Watch.now_ns()
      at_ns = receive do: ({:joined, ^pid, at_ns} -> at_ns)
      :erlang.exit(pid, :kill)
      receive do: ({^monitor, :leave, _group, _pids} -> :ok)
      (here_ns - at_ns) / 1_000
    end
  end

  @doc false
  @spec newcomer(pid(), atom()) :: :ok
  def newcomer(asker, name) do
    at_ns = Watch.now_ns()
    :ok = :pg.join(@scope, {:robot, name}, self())
    send(asker, {:joined, self(), at_ns})
    receive do: (:never -> :ok)
  end

  @doc "Records when this agent joins and leaves: `:join`, `:leave`."
  @spec watch(atom(), node()) :: :ok
  def watch(name, _node) do
    Watch.start(
      fn -> :pg.monitor(@scope, {:robot, name}) end,
      fn
        {_ref, :join, _group, _pids} -> :join
        {_ref, :leave, _group, _pids} -> :leave
        _other -> nil
      end
    )
  end

  defp pids(names), do: :lists.append(:lists.map(&:pg.get_members(@scope, {:robot, &1}), names))
end
