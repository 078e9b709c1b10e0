defmodule Hal.Application do
  @moduledoc false
  use Application

  # A supervisor without children does not crash, so it owns the table of handlers.
  defmodule Root do
    @moduledoc false
    use Supervisor

    @impl Supervisor
    def init(_) do
      Hal.Event.create_table()
      Supervisor.init([], strategy: :one_for_one)
    end
  end

  @impl Application
  def start(_type, _arguments), do: Supervisor.start_link(Root, [])
end
