defmodule Sim.World.Directory do
  @moduledoc """
  Keeps the directory of worlds: a `:pg` scope of its own, beside the robots' directory, so that simulated devices find
  their world by name on any connected node, and a robot need not know its simulation.
  """

  @doc "The scope as a child."
  @spec child_spec(term()) :: Supervisor.child_spec()
  def child_spec(_options), do: %{id: __MODULE__, start: {:pg, :start_link, [__MODULE__]}}

  @doc "Whether the scope runs on this node."
  @spec running?() :: boolean()
  def running?, do: Process.whereis(__MODULE__) != nil

  @doc "Registers a world under its name."
  @spec enter(name :: term(), pid()) :: :ok
  def enter(name, server), do: :pg.join(__MODULE__, name, server)

  @doc "The server of a world, or `nil`; always `nil` if the scope is down."
  @spec find(name :: term()) :: pid() | nil
  def find(name), do: __MODULE__ |> :pg.get_members(name) |> List.first()
end
