defmodule Hal.HardenedServerTest do
  use ExUnit.Case, async: true
  import ExUnit.CaptureLog
  alias Hal.{HardenedServer, HardenedSupervisor}
  doctest HardenedServer
  @moduletag :capture_log

  defmodule Counter do
    use HardenedServer

    @impl GenServer
    def init({:stop, why}), do: {:stop, why}
    def init(:ignore), do: :ignore
    def init({:raise, line}), do: raise(line)

    def init(test) do
      Process.flag(:trap_exit, true)
      {:ok, {test, 0}, {:continue, :one}}
    end

    @impl GenServer
    def handle_continue(:one, {test, n}), do: {:noreply, {test, n + 1}}

    @impl GenServer
    def handle_call(:count, _from, {_test, n} = s), do: {:reply, n, s}
    def handle_call(:dropped, _from, s), do: {:reply, HardenedServer.dropped(), s}
    def handle_call(:last, _from, s), do: {:stop, :normal, :bye, s}
    def handle_call(:wait, _from, s), do: {:reply, :ok, s, 1}
    def handle_call(:raise, _from, _s), do: raise("on purpose")

    @impl GenServer
    def handle_cast(:more, {test, n}), do: {:noreply, {test, n + 1}}

    @impl GenServer
    def handle_info(:timeout, {test, _n} = s) do
      send(test, :timeout)
      {:noreply, s}
    end

    @impl GenServer
    def terminate(reason, {test, _n}), do: send(test, {:terminated, reason})
  end

  defmodule Tree do
    use Supervisor
    @impl Supervisor
    def init(children), do: Supervisor.init(children, strategy: :one_for_one, max_restarts: 0)
  end

  defmodule Grove do
    use DynamicSupervisor
    @impl DynamicSupervisor
    def init([]), do: DynamicSupervisor.init(strategy: :one_for_one, max_restarts: 0)
  end

  defp odd do
    [
      :junk,
      [1 | 2],
      nil,
      {},
      {:system, :odd, :get_state},
      {:system, {:odd, 1}, :get_state},
      {:system, {self(), 1}, :unknown},
      {:system, {self(), 1}, {:replace_state, :odd}},
      {:"$gen_call", :odd, :count},
      {:"$gen_call", {:odd, 1}, :count},
      {:"$gen_call", {self(), [:alias | :odd]}, :unknown},
      {:"$gen_call", {self(), 1}, :unknown},
      {:"$gen_call", {self(), 1}, {:start_child, :odd}},
      {:"$gen_call", {self(), 1}, {:terminate_child, [1 | 2]}},
      {:"$gen_cast", :unknown},
      {:"$gen_cast", {:try_again_restart, :odd}},
      {:"$gen_restart", :odd},
      {:EXIT, :odd, :shutdown},
      {:EXIT, self(), :shutdown},
      {:DOWN, make_ref(), :process, self(), :normal}
    ]
  end

  # The test itself would be the parent.
  defp start(start) do
    test = self()

    keeper =
      start_supervised!(
        {Task,
         fn ->
           send(test, {:started, start.()})
           receive(do: (:never -> :ok))
         end},
        id: make_ref()
      )

    assert_receive {:started, {:ok, pid}}, 10_000
    {pid, keeper}
  end

  test "it does what a GenServer does" do
    test = self()
    {pid, keeper} = start(fn -> HardenedServer.start_link(Counter, test) end)
    assert GenServer.call(pid, :count) == 1
    GenServer.cast(pid, :more)
    assert GenServer.call(pid, :count) == 2
    assert {_test, 2} = :sys.get_state(pid)
    assert {_test, 5} = :sys.replace_state(pid, fn {test, _n} -> {test, 5} end)

    :ok = :sys.suspend(pid)
    GenServer.cast(pid, :more)
    assert {_test, 5} = :sys.get_state(pid)
    :ok = :sys.resume(pid)
    assert GenServer.call(pid, :count) == 6

    :ok = :sys.statistics(pid, true)
    assert GenServer.call(pid, :count) == 6
    assert {:ok, [_ | _]} = :sys.statistics(pid, :get)

    ref = Process.monitor(pid)
    Process.exit(keeper, :kill)
    assert_receive {:DOWN, ^ref, :process, ^pid, :killed}, 10_000
  end

  test "it ends as a GenServer does" do
    Process.flag(:trap_exit, true)
    assert HardenedServer.start_link(Counter, {:stop, :why}) == {:error, :why}
    assert HardenedServer.start_link(Counter, :ignore, name: __MODULE__) == :ignore
    assert Process.whereis(__MODULE__) == nil

    capture_log(fn ->
      assert {:error, {%RuntimeError{}, [_ | _]}} =
               HardenedServer.start_link(Counter, {:raise, "no"})
    end)

    {:ok, pid} = HardenedServer.start_link(Counter, self(), name: __MODULE__)

    assert HardenedServer.start_link(Counter, self(), name: __MODULE__) ==
             {:error, {:already_started, pid}}

    assert GenServer.call(pid, :wait) == :ok
    assert_receive :timeout, 10_000
    assert GenServer.call(pid, :last) == :bye
    assert_receive {:terminated, :normal}, 10_000
    assert_receive {:EXIT, ^pid, :normal}, 10_000

    {:ok, pid} = HardenedServer.start_link(Counter, self())

    log =
      capture_log(fn ->
        assert {{%RuntimeError{}, _}, _call} = catch_exit(GenServer.call(pid, :raise))
      end)

    assert log =~ "on purpose"
    assert_receive {:terminated, {%RuntimeError{}, [_ | _]}}, 10_000

    {:ok, pid} = HardenedServer.start_link(Counter, self())
    Process.exit(pid, :shutdown)
    assert_receive {:terminated, :shutdown}, 10_000
    assert_receive {:EXIT, ^pid, :shutdown}, 10_000
  end

  test "it drops and counts what would end a GenServer, also while it is suspended" do
    {pid, _keeper} = start(fn -> HardenedServer.start_link(Counter, self()) end)
    for term <- odd(), do: send(pid, term)
    assert GenServer.call(pid, :count) == 1
    assert GenServer.call(pid, :dropped) == length(odd())

    :ok = :sys.suspend(pid)
    for term <- odd(), do: send(pid, term)
    :ok = :sys.resume(pid)
    assert GenServer.call(pid, :dropped) == 2 * length(odd())
  end

  test "it reports what it drops, once a minute" do
    {pid, _keeper} = start(fn -> HardenedServer.start_link(Counter, self()) end)
    test = self()

    report = fn _event, %{count: count}, %{name: name, server: Counter}, ^pid ->
      if name == pid, do: send(test, {:dropped, count})
    end

    :ok = Hal.Event.attach({__MODULE__, pid}, [:hal, :server, :dropped], report, pid)
    for _ <- 1..100, term <- odd(), do: send(pid, term)
    assert GenServer.call(pid, :dropped) == 100 * length(odd())
    assert_received {:dropped, 1}
    refute_received {:dropped, _count}
    Hal.Event.detach({__MODULE__, pid})
  end

  test "supervisors survive it, and supervise" do
    agent = Supervisor.child_spec({Agent, fn -> 7 end}, id: :agent, restart: :temporary)
    {tree, _keeper} = start(fn -> HardenedSupervisor.start_link(Tree, [agent]) end)
    {grove, _keeper} = start(fn -> HardenedSupervisor.start_dynamic(Grove, [], name: Grove) end)
    {:ok, child} = DynamicSupervisor.start_child(grove, agent)
    assert [{:agent, grown, :worker, _}] = Supervisor.which_children(tree)

    for supervisor <- [tree, grove] do
      for term <- odd(), do: send(supervisor, term)
      # Forged: the children are alive.
      for pid <- [child, grown], do: send(supervisor, {:EXIT, pid, :kill})
      assert %{active: 1} = Supervisor.count_children(supervisor)
    end

    assert Agent.get(grown, & &1) == 7
    assert :ok = DynamicSupervisor.terminate_child(grove, child)
    assert :ok = Supervisor.terminate_child(tree, :agent)
    assert {:error, :not_found} = Supervisor.restart_child(tree, :agent)
    assert {:ok, _pid} = Supervisor.start_child(tree, agent)
  end

  test "a supervisor whose child ends too often ends" do
    agent = Supervisor.child_spec({Agent, fn -> 7 end}, id: :agent)
    {tree, _keeper} = start(fn -> HardenedSupervisor.start_link(Tree, [agent]) end)
    [{:agent, pid, :worker, _}] = Supervisor.which_children(tree)
    ref = Process.monitor(tree)
    Process.exit(pid, :kill)
    assert_receive {:DOWN, ^ref, :process, ^tree, :shutdown}, 10_000
  end
end
