defmodule Swarm.Application do
  @moduledoc false
  use Application

  @impl Application
  def start(_type, _arguments) do
    case Application.get_env(:swarm, :mesh, false) do
      false ->
        Swarm.Supervisor.start_link([])

      options ->
        with {:ok, mesh} <- Swarm.Mesh.Options.prepare(options) do
          :ok = Swarm.Mesh.Log.attach()
          :ok = Swarm.Mesh.Refusals.install()
          Swarm.Supervisor.start_link(mesh: mesh)
        end
    end
  end
end
