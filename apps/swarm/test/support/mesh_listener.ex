defmodule Swarm.MeshNodes.Listener do
  @moduledoc """
  Records on a test's node which robots join and leave.
  """
  use GenServer

  @doc "Starts a subscribed listener on this node."
  @spec start() :: :ok
  def start do
    {:ok, _} = GenServer.start(__MODULE__, [], name: __MODULE__)
    :ok
  end

  @doc "What the listener heard so far, newest first."
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
