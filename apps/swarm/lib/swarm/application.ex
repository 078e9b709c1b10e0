defmodule Swarm.Application do
  @moduledoc false
  use Application

  @impl Application
  def start(_type, _arguments), do: Swarm.Supervisor.start_link([])
end
