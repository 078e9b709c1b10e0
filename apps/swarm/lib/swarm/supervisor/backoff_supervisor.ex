defmodule Swarm.Supervisor.BackoffSupervisor do
  @moduledoc """
  Keeps one part of a node running, for ever: it restarts the part at once when it crashes, and
  with back-off when it crashes repeatedly. So a message that crashes a part each time costs the
  node that part for a while, but not its robots, which can do without it.

  Each crash is an event, `[:swarm, :part, :fell]`, with the part's `id` and the `reason`. If a
  part cannot be started with the node, the start of the node fails, as under any supervisor.
  """
  use GenServer
  alias Hal.Event
  alias Mesh.Backoff

  # Up to this many crashes within this time, restarts are immediate.
  @falls 5
  @within_ms 5_000
  @patience_ms 5_000

  @doc "The child spec of a part under such a process."
  @spec child_spec(Supervisor.child_spec() | {module(), term()} | module()) ::
          Supervisor.child_spec()
  def child_spec(part) do
    %{id: id} = spec = Supervisor.child_spec(part, [])
    %{id: id, start: {__MODULE__, :start_link, [spec]}, shutdown: 2 * @patience_ms}
  end

  @doc "Starts the part, and keeps it running."
  @spec start_link(Supervisor.child_spec()) :: GenServer.on_start()
  def start_link(spec), do: GenServer.start_link(__MODULE__, spec)

  @impl GenServer
  def init(%{id: id, start: start}) do
    Process.flag(:trap_exit, true)
    s = %{id: id, start: start, pid: nil, falls: [], backoff: Backoff.new(Hal.Clock.now_ms())}

    case begin(start) do
      {:ok, pid} -> {:ok, %{s | pid: pid}}
      {:error, reason} -> {:stop, reason}
    end
  end

  @impl GenServer
  def handle_info({:EXIT, pid, reason}, %{pid: pid} = s) do
    Event.execute([:swarm, :part, :fell], %{at_ms: Hal.Clock.now_ms()}, %{
      id: s.id,
      reason: reason
    })

    falls = [Hal.Clock.now_ms() | Enum.filter(s.falls, &(Hal.Clock.now_ms() - &1 < @within_ms))]
    {:noreply, again(%{s | pid: nil, falls: falls})}
  end

  def handle_info(:again, %{pid: nil} = s) do
    case begin(s.start) do
      {:ok, pid} -> {:noreply, %{s | pid: pid}}
      {:error, _reason} -> {:noreply, later(s)}
    end
  end

  # Of a part that did not start.
  def handle_info({:EXIT, _pid, _reason}, s), do: {:noreply, s}

  @impl GenServer
  def terminate(_reason, %{pid: nil}), do: :ok

  def terminate(_reason, %{pid: pid}) do
    ref = Process.monitor(pid)
    Process.exit(pid, :shutdown)

    receive do
      {:DOWN, ^ref, :process, _pid, _reason} -> :ok
    after
      @patience_ms -> Process.exit(pid, :kill)
    end
  end

  # A part that a previous instance of this process started may be about to end with it.
  defp begin({m, f, a} = start) do
    case apply(m, f, a) do
      {:error, {:already_started, former}} ->
        ref = Process.monitor(former)

        receive do
          {:DOWN, ^ref, :process, _pid, _reason} -> begin(start)
        after
          @patience_ms -> {:error, {:already_started, former}}
        end

      started ->
        started
    end
  end

  defp again(%{falls: falls} = s) when length(falls) > @falls, do: later(s)

  defp again(s) do
    send(self(), :again)
    %{s | backoff: Backoff.new(Hal.Clock.now_ms())}
  end

  defp later(s) do
    backoff = Backoff.tried(s.backoff, Hal.Clock.now_ms(), 0.5)
    Process.send_after(self(), :again, backoff.due_ms, abs: true)
    %{s | backoff: backoff}
  end
end
