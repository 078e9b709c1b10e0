defmodule Swarm.EStop.Broadcaster do
  @moduledoc """
  Broadcasts the emergency stop; one process on each node, also on a node without a robot.

  `sound/1` sends a call to stop to every robot's e-stop process in the directory and, by signed
  datagrams, to every node. That happens at once, in the caller; this process then repeats it, ten
  times in all, every 100 ms, even if the caller has ended. Every call has an identity
  (`t:Swarm.EStop.Calls.call/0`), so that a robot obeys it once, and an age, which each holder
  counts: a call older than a person's reset does not stop the robot again. A node that hears a
  call for the first time passes it on, so that it also reaches those that hear this node but not
  the sender. A reset ends the repeats, so that they do not stop a robot that is switched on
  afterwards.
  """
  use GenServer
  alias Mesh.Nonblocking
  alias Robot.Names
  alias Swarm.Directory
  alias Swarm.EStop.Calls

  @times 10
  @passed_on 3
  @every_ms 100
  # More calls than this at a time are not distinguished any more, and not passed on.
  @most 16

  @doc "Starts the process, as a node's supervisor does."
  @spec start_link(term()) :: GenServer.on_start()
  def start_link(_options), do: GenServer.start_link(__MODULE__, [], name: __MODULE__)

  @doc "The identity of a new call."
  @spec call() :: Calls.call()
  def call, do: {node(), boot(), System.unique_integer([:positive, :monotonic])}

  @doc "Calls all robots to stop."
  @spec sound(Calls.call()) :: :ok
  def sound(call) do
    send_out(call, 0)
    GenServer.cast(__MODULE__, {:repeat, call, @times - 1})
  end

  @doc "Passes on a call that was heard, unless it comes from this node, where it is repeated anyway."
  @spec pass_on(Calls.call(), age_ms :: non_neg_integer()) :: :ok
  def pass_on({node, _boot, _counter}, _age_ms) when node == node(), do: :ok
  def pass_on(call, age_ms), do: GenServer.cast(__MODULE__, {:pass_on, call, age_ms})

  @doc "Ends the repeats of these calls, because a person has reset what they stopped."
  @spec quiet(:all | Calls.t()) :: :ok
  def quiet(calls), do: GenServer.cast(__MODULE__, {:quiet, calls})

  @impl GenServer
  def init([]) do
    Process.flag(:priority, :high)
    {:ok, %{left: %{}, heard: []}}
  end

  # It has a name that connected nodes can send to, so anything may arrive here.
  @impl GenServer
  def handle_call(_unknown, _from, s), do: {:noreply, s}

  @impl GenServer
  def handle_cast({:repeat, call, times}, s) when times in 1..@times do
    if Calls.call?(call) do
      # Robots of this node need not pass it on.
      {_new?, heard} = Calls.hear(s.heard, call)
      {:noreply, repeat(%{s | heard: heard}, call, times, Hal.Clock.now_ms())}
    else
      {:noreply, s}
    end
  end

  def handle_cast({:pass_on, call, age_ms}, s) do
    whole? = Calls.call?(call) and Calls.age?(age_ms)
    {:noreply, if(whole?, do: pass_on(s, call, age_ms), else: s)}
  end

  def handle_cast({:quiet, :all}, s), do: {:noreply, %{s | left: %{}}}

  def handle_cast({:quiet, calls}, s) do
    calls = if Calls.heard?(calls), do: calls, else: []
    over = for {call, _times} <- s.left, match?({false, _same}, Calls.hear(calls, call)), do: call
    {:noreply, %{s | left: Map.drop(s.left, over)}}
  end

  def handle_cast(_unknown, s), do: {:noreply, s}

  @impl GenServer
  def handle_info({:again, call}, s) do
    case s.left do
      %{^call => {left, since_ms}} ->
        send_out(call, Hal.Clock.now_ms() - since_ms)
        {:noreply, repeat(%{s | left: Map.delete(s.left, call)}, call, left - 1, since_ms)}

      _none ->
        {:noreply, s}
    end
  end

  def handle_info(_unknown, s), do: {:noreply, s}

  defp pass_on(%{left: left} = s, _call, _age_ms) when map_size(left) >= @most, do: s

  # Many robots of this node may have heard it.
  defp pass_on(s, call, age_ms) do
    case Calls.hear(s.heard, call) do
      {false, _heard} ->
        s

      {true, heard} ->
        send_out(call, age_ms)
        repeat(%{s | heard: heard}, call, @passed_on - 1, Hal.Clock.now_ms() - age_ms)
    end
  end

  defp repeat(s, _call, 0, _since_ms), do: s
  defp repeat(%{left: left} = s, _call, _times, _since_ms) when map_size(left) >= @most, do: s

  defp repeat(s, call, times, since_ms) do
    Process.send_after(self(), {:again, call}, @every_ms)
    %{s | left: Map.put(s.left, call, {times, since_ms})}
  end

  defp send_out(call, age_ms) do
    # Those of this node, too, while the directory is gone, or has just been started again.
    pids = Enum.uniq(Names.all(:estop) ++ Directory.members(:estops))
    for pid <- pids, do: Nonblocking.cast(pid, {:estop, call, age_ms})
    Mesh.broadcast(:stop, {:estop, call, age_ms})
  end

  # The time of day at which this VM was started.
  defp boot do
    started = :erlang.system_info(:start_time) + :erlang.time_offset()
    System.convert_time_unit(started, :native, :millisecond)
  end
end
