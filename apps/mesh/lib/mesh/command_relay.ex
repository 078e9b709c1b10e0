defmodule Mesh.CommandRelay do
  @moduledoc """
  Carries commands to robots on nodes that this node is not connected to, through nodes that are.

  The first node computes the route from the connections that beacons report; every node on it
  passes the request on, and the last one asks the robot in its own name
  (`c:Mesh.Consumer.command/2`). The answer returns the same way. No process waits: a request that
  cannot be passed on is lost, and the caller gives up by itself.
  """
  use GenServer
  alias Mesh.Nonblocking
  alias Mesh.Protocol.WireTerm
  alias Mesh.Distribution.Topology

  # No caller waits longer than this for an answer.
  @forget_ms 2_000
  @longest 16
  @most 1_000

  @doc "Starts the relay of this node, with the module that takes commands (`Mesh.Consumer`)."
  @spec start_link(module()) :: GenServer.on_start()
  def start_link(consumer), do: GenServer.start_link(__MODULE__, consumer, name: __MODULE__)

  @doc """
  Sends a request to a robot on `node`. `ref` is the alias in it for the answer.
  `{:error, :no_way}` if no connections lead there.
  """
  @spec send(node(), %{node() => [node()]}, atom(), tuple(), reference()) ::
          :ok | {:error, :no_way}
  def send(node, links, robot, request, ref) do
    case Topology.route(node(), node, links) do
      nil -> {:error, :no_way}
      [next | rest] -> forward(next, {:there, rest, [node()], robot, request, ref})
    end
  end

  @impl GenServer
  def init(consumer), do: {:ok, %{consumer: consumer, asked: %{}}}

  # It has a name that other nodes send to, so anything may arrive here.
  @impl GenServer
  def handle_call(_unknown, _from, s), do: {:noreply, s}

  @impl GenServer
  def handle_cast({:there, [], [_ | _] = back, robot, request, ref}, s) when is_tuple(request) do
    if WireTerm.name?(robot) and is_reference(ref) and nodes?(back) and map_size(s.asked) < @most,
      do: {:noreply, ask(s, robot, request, ref, back)},
      else: {:noreply, s}
  end

  def handle_cast({:there, [next | rest], back, robot, request, ref}, s) do
    if nodes?([next | rest]) and nodes?(back) and length(back) < @longest,
      do: forward(next, {:there, rest, [node() | back], robot, request, ref})

    {:noreply, s}
  end

  def handle_cast({:back, [], ref, answer}, s) when is_reference(ref) do
    Nonblocking.answer(ref, answer)
    {:noreply, s}
  end

  def handle_cast({:back, [next | rest], ref, answer}, s) do
    if nodes?([next | rest]), do: forward(next, {:back, rest, ref, answer})
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
    forward(next, {:back, rest, ref, answer})
    {:noreply, %{s | asked: asked}}
  end

  def handle_info(_unknown, s), do: {:noreply, s}

  # The robot answers this process, which knows the way back.
  defp ask(s, robot, request, ref, back) do
    own = :erlang.alias([:reply])
    request = request |> Tuple.to_list() |> Enum.map(&if(&1 == ref, do: own, else: &1))

    case s.consumer.command(robot, List.to_tuple(request)) do
      :ok ->
        timer = Process.send_after(self(), {:forget, own}, @forget_ms)
        put_in(s.asked[own], {back, ref, timer})

      :error ->
        :erlang.unalias(own)
        s
    end
  end

  defp forward(next, message), do: Nonblocking.cast({__MODULE__, next}, message)
  defp nodes?(list), do: WireTerm.list?(list, &is_atom/1)
end
