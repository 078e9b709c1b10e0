defmodule Lab.Node.World do
  @moduledoc """
  Runs the world as the part of a node: `Sim.World.Server`, found by its name on all connected nodes
  (`Sim.World.Directory`), and on others over `Sim.World.Line`. It reports snapshots, from which it can be started again.

  Options: `name`, `world`; `line`, the path of its lines; `beside`, more children.
  """
  @behaviour Lab.Node
  alias Sim.World
  alias Sim.World.Snapshot

  @impl Lab.Node
  def start(%{name: name, world: world} = options) do
    children =
      [World.Directory, {World.Server, name: name, world: world}] ++
        if(options[:line], do: [World.Line.world(options.line, name)], else: []) ++
        Map.get(options, :beside, [])

    {:ok, _supervisor} = Supervisor.start_link(children, strategy: :one_for_all, max_restarts: 0)
    server = World.Directory.find(name)
    {:ok, server, {__MODULE__, :report, [server]}}
  end

  @doc "The current world without the parts that never change."
  @spec report(pid()) :: Snapshot.t()
  def report(server), do: server |> World.Server.world() |> Snapshot.of()

  @doc "Changes the world of this name, if it is there."
  @spec change(term(), World.Server.change()) :: :ok
  def change(name, change) do
    with server when is_pid(server) <- World.Directory.find(name),
         do: World.Server.change(server, change),
         else: (nil -> :ok)
  end
end
