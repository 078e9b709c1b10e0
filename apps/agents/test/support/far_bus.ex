defmodule Agents.FarBus do
  @moduledoc "A bus, listeners and a feed of the fleet's status on a node of a test; they go with the node."
  use GenServer

  @doc "Starts a bus."
  @spec start(Agents.PubSub.bus()) :: :ok
  def start({module, name}) do
    {:ok, supervisor} = Supervisor.start_link([{module, name: name}], strategy: :one_for_one)
    true = Process.unlink(supervisor)
    :ok
  end

  @doc "A process that subscribes, and keeps what it hears for `heard/1`."
  @spec listen(Agents.PubSub.bus(), Agents.PubSub.topic()) :: pid()
  def listen(bus, topic) do
    {:ok, listener} = GenServer.start(__MODULE__, {:listen, bus, topic})
    listener
  end

  @doc "Tells the status of the fleet on the topic `fleet`, as in `docs/packages.md`."
  @spec feed(atom()) :: :ok
  def feed(name) do
    {:ok, _feed} = GenServer.start(__MODULE__, {:feed, name})
    :ok
  end

  @doc "All that a listener has heard, oldest first."
  @spec heard(pid()) :: [term()]
  def heard(listener), do: GenServer.call(listener, :heard)

  @impl GenServer
  def init({:listen, bus, topic}) do
    :ok = Agents.PubSub.subscribe(bus, topic)
    {:ok, []}
  end

  def init({:feed, name}), do: {:ok, name, {:continue, :tell}}

  @impl GenServer
  def handle_continue(:tell, name), do: handle_info(:tell, name)

  @impl GenServer
  def handle_info(:tell, name) do
    _ = apply(Phoenix.PubSub, :broadcast, [name, "fleet", {:fleet, Swarm.status()}])
    Process.send_after(self(), :tell, 500)
    {:noreply, name}
  end

  def handle_info(message, heard), do: {:noreply, [message | heard]}

  @impl GenServer
  def handle_call(:heard, _from, heard), do: {:reply, Enum.reverse(heard), heard}
end
