defmodule Swarm.Discovery.Presence do
  @moduledoc """
  Notifies subscribers when robots join or leave (`Swarm.subscribe/0`).

  A robot joins with the first sign of it, in the directory or through the mesh. It leaves when
  its comms process leaves the directory, which happens at once if its node is killed; or, if it
  was heard through the mesh, when it has been silent for 2 s, even if connections to it seem to
  exist. A robot whose connection ended, but that is still heard, joins again as soon as that is
  certain.
  """
  use GenServer
  alias Hal.Ticker
  alias Mesh.Nonblocking
  alias Swarm.Directory
  alias Swarm.Discovery.RobotInfo

  @look_ms 100
  # A killed robot's last heartbeat counts for 2 s.
  @certain_ms 2_500
  # Comms processes enter a new scope by themselves: those of this node at once, others when they
  # connect.
  @settle_ms 1_000

  @type reason :: :left | :nodedown | :silent

  @doc "Starts the process of this node."
  @spec start_link(term()) :: GenServer.on_start()
  def start_link(_options), do: GenServer.start_link(__MODULE__, [], name: __MODULE__)

  @doc "Notifies the process from now on; returns the robots that are present now."
  @spec subscribe(pid()) :: {:ok, [atom()]} | {:error, line :: String.t()}
  def subscribe(pid) when is_pid(pid), do: call({:subscribe, pid})

  def subscribe(other),
    do:
      {:error,
       "#{inspect(other)} cannot be notified of robots; it must be a process of this node"}

  @doc "Ends the notifications of a process."
  @spec unsubscribe(pid()) :: :ok | {:error, line :: String.t()}
  def unsubscribe(pid), do: call({:unsubscribe, pid})

  defp call(request), do: Nonblocking.call(__MODULE__, request, "the directory of this node")

  @impl GenServer
  def init([]) do
    empty = %{
      ticker: Ticker.start(:look, @look_ms, @look_ms),
      ref: nil,
      scope: nil,
      pids: %{},
      told: %{},
      heard: %{},
      doubt: %{},
      subscribers: %{}
    }

    {:ok, enter(empty)}
  end

  @impl GenServer
  def handle_call({:subscribe, pid}, _from, s) when is_pid(pid) and node(pid) == node() do
    subscribers = Map.put_new_lazy(s.subscribers, pid, fn -> Process.monitor(pid) end)
    {:reply, {:ok, s.told |> Map.keys() |> Enum.sort()}, %{s | subscribers: subscribers}}
  end

  def handle_call({:subscribe, pid}, _from, s),
    do: {:reply, {:error, "#{inspect(pid)} is not of this node: subscribe there"}, s}

  def handle_call({:unsubscribe, pid}, _from, s), do: {:reply, :ok, forget(s, pid)}
  def handle_call(_unknown, _from, s), do: {:noreply, s}

  @impl GenServer
  def handle_cast(_unknown, s), do: {:noreply, s}

  @impl GenServer
  def handle_info({ref, :join, {:robot, robot}, pids}, %{ref: ref} = s) do
    pids = Enum.uniq(pids ++ Map.get(s.pids, robot, []))

    {:noreply,
     s
     |> Map.put(:pids, Map.put(s.pids, robot, pids))
     |> settle_doubt(robot)
     |> judge(robot, :left)}
  end

  def handle_info({ref, :leave, {:robot, robot}, gone}, %{ref: ref} = s) do
    case Map.get(s.pids, robot, []) -- gone do
      [] ->
        doubt =
          if is_map_key(s.heard, robot),
            do: Map.put(s.doubt, robot, Hal.Clock.now_ms()),
            else: s.doubt

        s = %{s | pids: Map.delete(s.pids, robot), doubt: doubt}
        {:noreply, judge(s, robot, reason(gone))}

      pids ->
        {:noreply, %{s | pids: Map.put(s.pids, robot, pids)}}
    end
  end

  def handle_info({ref, _what, _group, _pids}, %{ref: ref} = s), do: {:noreply, s}
  def handle_info(:look, s), do: {:noreply, look(s)}
  def handle_info(:enter, %{scope: nil} = s), do: {:noreply, enter(s)}
  def handle_info(:settled, s), do: {:noreply, all(s, :left)}

  # That the directory is gone does not mean that the robots are.
  def handle_info({:DOWN, scope, :process, _pid, _reason}, %{scope: scope} = s) do
    Process.send_after(self(), :enter, @look_ms)
    {:noreply, %{s | ref: nil, scope: nil}}
  end

  def handle_info({:DOWN, _ref, :process, pid, _reason}, s), do: {:noreply, forget(s, pid)}

  # Such as news of a directory that has ended.
  def handle_info(_unknown, s), do: {:noreply, s}

  defp enter(s) do
    scope = Directory.monitor()
    {ref, groups} = :pg.monitor_scope(Directory)
    pids = for {{:robot, robot}, [_ | _] = pids} <- groups, into: %{}, do: {robot, pids}
    s = %{s | ref: ref, scope: scope, pids: pids}
    joined = Enum.reduce(Map.keys(pids), s, &judge(&2, &1, :left))
    # A robot that is missing may just not have entered again yet.
    Process.send_after(self(), :settled, @settle_ms)
    joined
  catch
    :exit, {_why, {:gen_server, :call, _arguments}} ->
      Process.send_after(self(), :enter, @look_ms)
      s
  end

  defp look(s) do
    s = %{s | ticker: Ticker.next(s.ticker)}
    heard = Mesh.robots()
    certain = Hal.Clock.now_ms() - @certain_ms
    doubt = Map.filter(s.doubt, fn {_robot, since_ms} -> since_ms > certain end)
    # For robots that were heard before, the mesh knows whether they are present.
    known =
      Map.merge(
        Map.new(s.heard, fn {robot, _} -> {robot, false} end),
        Map.new(heard, fn {robot, _} -> {robot, true} end)
      )

    changed = for {robot, there?} <- known, s.heard[robot] != there?, do: robot
    changed = changed ++ (Map.keys(s.doubt) -- Map.keys(doubt))
    Enum.reduce(changed, %{s | heard: known, doubt: doubt}, &judge(&2, &1, :silent)) |> tidy()
  end

  # A robot that is neither in the directory nor heard need not be remembered.
  defp tidy(s) do
    heard = Map.filter(s.heard, fn {robot, there?} -> there? or is_map_key(s.pids, robot) end)
    %{s | heard: heard}
  end

  defp all(%{ref: nil} = s, _reason), do: s
  defp all(s, reason), do: Enum.reduce(Map.keys(s.told), s, &judge(&2, &1, reason))

  defp judge(s, robot, reason) do
    case {there?(s, robot), s.told} do
      {true, %{^robot => _node}} ->
        s

      {true, told} ->
        tell(%{s | told: Map.put(told, robot, true)}, {:join, robot, about(s, robot)})

      {false, %{^robot => _node} = told} ->
        tell(%{s | told: Map.delete(told, robot)}, {:leave, robot, reason})

      {false, _told} ->
        s
    end
  end

  defp there?(s, robot) do
    pids = Map.get(s.pids, robot, [])

    cond do
      Enum.any?(pids, &(node(&1) == node())) -> true
      is_map_key(s.doubt, robot) -> false
      is_map_key(s.heard, robot) -> s.heard[robot]
      true -> pids != []
    end
  end

  defp settle_doubt(s, robot),
    do: %{s | doubt: Map.delete(s.doubt, robot), heard: Map.delete(s.heard, robot)}

  defp about(s, robot) do
    case RobotInfo.of(robot, :infinity) do
      {:ok, about} ->
        about

      :error ->
        %RobotInfo{
          robot: robot,
          node: s.pids |> Map.get(robot, []) |> Enum.map(&node/1) |> List.first()
        }
    end
  end

  defp reason([pid | _]),
    do: if(node(pid) == node() or node(pid) in Node.list(), do: :left, else: :nodedown)

  defp tell(s, news) do
    for {pid, _ref} <- s.subscribers, do: send(pid, {:swarm, news})
    s
  end

  defp forget(s, pid) do
    {ref, subscribers} = Map.pop(s.subscribers, pid)
    if ref, do: Process.demonitor(ref, [:flush])
    %{s | subscribers: subscribers}
  end
end
