defmodule Mesh.Distribution.Libcluster do
  @moduledoc false
  # Runs libcluster's topologies if libcluster is installed: any of its strategies then connects
  # nodes, and connected nodes introduce themselves to each other's mesh. If it crashes, the mesh
  # goes on, and it is started again with back-off.
  use GenServer
  alias Hal.Event
  alias Mesh.Backoff

  @doc "Starts libcluster; `topologies` are in its format."
  @spec start_link(keyword()) :: GenServer.on_start()
  def start_link(topologies), do: GenServer.start_link(__MODULE__, topologies)

  @impl GenServer
  def init(topologies) do
    Process.flag(:trap_exit, true)

    {:ok, %{topologies: topologies, backoff: Backoff.new(Hal.Clock.now_ms())},
     {:continue, :start}}
  end

  @impl GenServer
  def handle_continue(:start, s), do: {:noreply, start(s)}

  @impl GenServer
  def handle_info(:start, s), do: {:noreply, start(s)}
  def handle_info({:EXIT, _supervisor, reason}, s), do: {:noreply, later(s, reason)}

  # Not a dependency: `Mesh.Options` has found out whether the module exists. A failed start also
  # sends an `:EXIT`.
  defp start(s) do
    arguments = [s.topologies, [name: Mesh.Distribution.Libcluster.Topologies]]
    _ = apply(Cluster.Supervisor, :start_link, [arguments])
    s
  end

  defp later(s, reason) do
    Event.execute([:mesh, :libcluster], %{at_ms: Hal.Clock.now_ms()}, %{reason: reason})
    backoff = Backoff.tried(s.backoff, Hal.Clock.now_ms(), 0.5)
    Process.send_after(self(), :start, backoff.due_ms, abs: true)
    %{s | backoff: backoff}
  end
end
