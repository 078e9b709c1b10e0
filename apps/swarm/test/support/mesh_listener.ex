defmodule Swarm.MeshNodes.Listener do
  @moduledoc """
  Hears on a test's node who joins and leaves.
  """
  use GenServer

  @doc "Starts it on this node, subscribed."
  @spec start() :: :ok
  def start do
    {:ok, _} = GenServer.start(__MODULE__, [], name: __MODULE__)
    :ok
  end

  @doc "What it heard so far, newest first."
  @spec news() :: [tuple()]
  def news, do: GenServer.call(__MODULE__, :news)

  @impl GenServer
  def init([]) do
    {:ok, _robots} = Swarm.subscribe()
    {:ok, []}
  end

  @impl GenServer
  def handle_call(:news, _from, news), do: {:reply, news, news}

  @impl GenServer
  def handle_info({:swarm, news}, heard), do: {:noreply, [news | heard]}
end
