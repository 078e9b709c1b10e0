defmodule Swarm.Mesh.CommandRelay do
  @moduledoc """
  Carries commands to robots whose node this one is not connected to, over nodes that are.

  The way is computed where it begins, from what beacons tell of connections; every node on it hands
  on, and the last one asks the robot's link in its own name. The answer comes back the same way. Nobody
  waits for anything: what finds no way on is lost, and whoever asked gives up by itself.
  """
  use GenServer
  alias Robot.Names
  alias Swarm.Mesh.Distribution.Topology
  alias Swarm.Nonblocking
  alias Swarm.Message.WireTypes

  # Answers later than this are asked for by nobody.
  @forget_ms 2_000
  @longest 16
  @most 1_000

  @doc "Starts the relay of this node."
  @spec start_link(term()) :: GenServer.on_start()
  def start_link(_options), do: GenServer.start_link(__MODULE__, [], name: __MODULE__)

  @doc """
  Sends a link's request to a robot on `node`. `ref` is the alias in it that the answer goes to.
  `{:error, :no_way}` where no connections lead there.
  """
  @spec send(node(), %{node() => [node()]}, atom(), tuple(), reference()) ::
          :ok | {:error, :no_way}
  def send(node, links, robot, request, ref) do
    names =
      Map.new(links, fn {from, to} -> {Atom.to_string(from), Enum.map(to, &Atom.to_string/1)} end)

    case Topology.route(Atom.to_string(node()), Atom.to_string(node), names) do
      nil ->
        {:error, :no_way}

      way ->
        nodes =
          Map.new(Map.keys(links) ++ List.flatten(Map.values(links)), &{Atom.to_string(&1), &1})

        way = Enum.map(way, &Map.fetch!(nodes, &1))
        forward(way, {:there, tl(way), [node()], robot, request, ref})
    end
  end

  @impl GenServer
  def init([]), do: {:ok, %{asked: %{}}}

  # It has a name that connected nodes can send to, so anything may come here.
  @impl GenServer
  def handle_call(_unknown, _from, s), do: {:noreply, s}

  @impl GenServer
  def handle_cast({:there, [], [_ | _] = back, robot, request, ref}, s) when is_tuple(request) do
    with true <- WireTypes.name?(robot) and is_reference(ref) and nodes?(back),
         true <- map_size(s.asked) < @most,
         link when link != nil <- Names.whereis(robot, :link) do
      own = :erlang.alias([:reply])
      request = request |> Tuple.to_list() |> Enum.map(&if(&1 == ref, do: own, else: &1))
      GenServer.cast(link, List.to_tuple(request))
      timer = Process.send_after(self(), {:forget, own}, @forget_ms)
      {:noreply, put_in(s.asked[own], {back, ref, timer})}
    else
      _not_here -> {:noreply, s}
    end
  end

  def handle_cast({:there, [next | rest], back, robot, request, ref}, s) do
    if nodes?([next | rest]) and nodes?(back) and length(back) < @longest,
      do: forward([next], {:there, rest, [node() | back], robot, request, ref})

    {:noreply, s}
  end

  def handle_cast({:back, [], ref, answer}, s) when is_reference(ref) do
    Nonblocking.answer(ref, answer)
    {:noreply, s}
  end

  def handle_cast({:back, [next | rest], ref, answer}, s) do
    if nodes?([next | rest]), do: forward([next], {:back, rest, ref, answer})
    {:noreply, s}
  end

  def handle_cast(_unknown, s), do: {:noreply, s}

  @impl GenServer
  def handle_info({:forget, own}, s) when is_map_key(s.asked, own) do
    :erlang.unalias(own)
    {:noreply, %{s | asked: Map.delete(s.asked, own)}}
  end

  def handle_info({own, answer}, s) when is_map_key(s.asked, own) do
    {{[next | rest], ref, timer}, asked} = Map.pop!(s.asked, own)
    Process.cancel_timer(timer)
    forward([next], {:back, rest, ref, answer})
    {:noreply, %{s | asked: asked}}
  end

  def handle_info(_other, s), do: {:noreply, s}

  defp forward([next | _], message) do
    :erlang.send({__MODULE__, next}, {:"$gen_cast", message}, [:nosuspend, :noconnect])
    :ok
  end

  defp nodes?(list), do: WireTypes.list?(list, &is_atom/1)
end
