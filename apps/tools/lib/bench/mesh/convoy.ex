defmodule Bench.Mesh.Convoy do
  @moduledoc false
  # Describes what runs in the measured nodes: complete robots on stationary wheels, with the real mesh; and
  # the measurement, in the node that asks. Called over standard input.
  alias Bench.Mesh.{IdleDrive, Watch}
  alias Agents.{Conversation, Envelope}
  alias Swarm.{Commands, Directory}

  @patience_ms 2_000
  @look_ms 5

  @doc "Makes this the node of one robot, of several, or of none."
  @spec main(keyword() | false, [atom()]) :: :ok
  def main(mesh, robots) do
    Application.put_env(:logger, :level, :error)
    Application.put_env(:swarm, :mesh, mesh)
    {:ok, _apps} = Application.ensure_all_started(:swarm)
    counters = :counters.new(max(length(robots), 1), [])
    :persistent_term.put(__MODULE__, counters)
    for {id, index} <- Enum.with_index(robots, 1), do: robot(id, [counters, index])
    :ok
  end

  defp robot(id, counted) do
    config =
      Robot.Config.new!(
        id: id,
        profile: Hal.Profile.magellan(),
        drive: {IdleDrive, []},
        trace: {__MODULE__, :trace, counted},
        companions: [
          {Agents.Responder, service: Bench.Mesh.Agent.service(), module: Bench.Mesh.Agent}
        ]
      )

    {:ok, _robot} = Robot.Fleet.start_robot(Robot.Fleet, Swarm.Comms.join(config))
  end

  @doc """
  Waits until this node sees and is connected to all nodes, and knows all robots; returns when
  that was.
  """
  @spec full(nodes :: pos_integer(), robots :: [atom()]) :: at_ns :: integer()
  def full(nodes, robots) do
    if length(Node.list()) >= nodes - 1 and alive() >= nodes - 1 and
         robots -- Directory.robots() == [] do
      Watch.now_ns()
    else
      receive do
      after
        @look_ms -> full(nodes, robots)
      end
    end
  end

  defp alive, do: Enum.count(Mesh.view().nodes, fn {_node, about} -> about.status == :alive end)

  @doc "Commands: asks all robots through the public interface, `count` times; microseconds each."
  @spec pings([atom()], pos_integer()) :: [float()]
  def pings(robots, count) do
    all = length(robots)
    Watch.repeat(count, fn -> ^all = map_size(Commands.Client.ask(robots, :ping)) end)
  end

  @doc "Envelopes: asks all agents and gathers their answers; microseconds each."
  @spec gathers([atom()], pos_integer()) :: [float()]
  def gathers(robots, count), do: asks(robots, :ping, count)

  @doc "Lets everybody write to everybody until all have heard all; microseconds each."
  @spec rounds([atom()], pos_integer()) :: [float()]
  def rounds(robots, count), do: asks(robots, {:round, robots}, count)

  defp asks(robots, content, count) do
    peers = for id <- robots, do: {id, Bench.Mesh.Agent.service()}

    Watch.repeat(count, fn ->
      question = Envelope.new(:query, :base, content)
      {:complete, _answers, []} = Conversation.gather(peers, question, @patience_ms)
    end)
  end

  @doc """
  How long it takes until a robot that joins on that node is reported here; microseconds each.
  """
  @spec joins(node(), atom(), pos_integer()) :: [float()]
  def joins(node, robot, count) do
    {:ok, _there} = Swarm.subscribe()

    for _ <- 1..count do
      pid = Node.spawn(node, __MODULE__, :newcomer, [self(), robot])
      receive do: ({:swarm, {:join, ^robot, _about}} -> :ok)
      here_ns = Watch.now_ns()
      at_ns = receive do: ({:joined, ^pid, at_ns} -> at_ns)
      Process.exit(pid, :kill)
      receive do: ({:swarm, {:leave, ^robot, _reason}} -> :ok)
      (here_ns - at_ns) / 1_000
    end
  end

  @doc false
  @spec newcomer(pid(), atom()) :: :ok
  def newcomer(asker, robot) do
    at_ns = Watch.now_ns()
    :ok = Directory.enter(self(), [{:robot, robot}])
    send(asker, {:joined, self(), at_ns})
    receive do: (:never -> :ok)
  end

  @doc """
  Records when this robot comes and goes: `:join` and `:leave` as subscribers are notified,
  `:suspect` and `:gone` of its node as the datagrams show.
  """
  @spec watch(atom(), node()) :: :ok
  def watch(robot, node) do
    Watch.start(
      fn ->
        {:ok, _there} = Swarm.subscribe()
        for change <- [:up, :suspect, :gone], do: attach(change)
      end,
      fn
        {:swarm, {:join, ^robot, _about}} -> :join
        {:swarm, {:leave, ^robot, _reason}} -> :leave
        {:mesh, change, ^node} -> change
        _other -> nil
      end
    )
  end

  defp attach(change) do
    Hal.Event.detach({__MODULE__, change})

    :ok = Hal.Event.attach({__MODULE__, change}, [:mesh, change], &__MODULE__.note/4, self())
  end

  @doc false
  @spec note(Hal.Event.name(), map(), map(), pid()) :: term()
  def note([:mesh, change], _measurements, %{node: node}, pid),
    do: send(pid, {:mesh, change, node})

  @doc "Stops this node from sending datagrams, or lets it send again; returns when that was."
  @spec silence(boolean()) :: at_ns :: integer()
  def silence(true), do: apply_then_now(:suspend)
  def silence(false), do: apply_then_now(:resume)

  defp apply_then_now(what) do
    :ok = apply(:sys, what, [Mesh.Server])
    Watch.now_ns()
  end

  @doc "The ticks per second of each robot of this node, measured over so many seconds."
  @spec rates([atom()], pos_integer()) :: [float()]
  def rates(robots, seconds) do
    before = ticks(robots)
    began_ns = Watch.now_ns()

    receive do
    after
      seconds * 1_000 -> :ok
    end

    took_s = (Watch.now_ns() - began_ns) / 1.0e9
    for {now, then} <- Enum.zip(ticks(robots), before), do: (now - then) / took_s
  end

  defp ticks(robots) do
    counters = :persistent_term.get(__MODULE__)
    for {_id, index} <- Enum.with_index(robots, 1), do: :counters.get(counters, index)
  end

  @doc false
  @spec trace(:counters.counters_ref(), pos_integer(), Robot.Trace.entry()) :: :ok
  def trace(counters, index, {:executive, :effect, {:cast, :pilot, {:tick, _percept}}, _at_ms}),
    do: :counters.add(counters, index, 1)

  def trace(_counters, _index, _entry), do: :ok
end
