defmodule Lab.Node.World do
  @moduledoc false
  # Runs the world as the part of a node: `Sim.World.Server`, found by its name on all nodes (`Sim.World.Directory`). It
  # reports snapshots, from which it can be started again. Options: `name`, `world`.
  @behaviour Lab.Node
  alias Sim.World
  alias Sim.World.Snapshot

  @impl Lab.Node
  def start(options) do
    server = [name: options.name, world: options.world]

    children = [
      World.Directory,
      %{id: World.Server, start: {World.Server, :start_link, [server]}}
    ]

    {:ok, supervisor} = Supervisor.start_link(children, strategy: :one_for_all, max_restarts: 0)

    {World.Server, pid, _type, _modules} =
      supervisor |> Supervisor.which_children() |> List.keyfind(World.Server, 0)

    {:ok, supervisor, %{server: pid}, {__MODULE__, :report, [pid]}}
  end

  @impl Lab.Node
  def begin(_options), do: :ok

  @doc "The current world without the parts that never change."
  @spec report(pid()) :: Snapshot.t()
  def report(server), do: server |> World.Server.world() |> Snapshot.of()
end
