defmodule Mesh.Distribution.Preload do
  @moduledoc false
  # Loads what Erlang's distribution runs of this project. It listens before any application starts, and while Mix starts it
  # goes from folder to folder, takes code paths away and puts others there: a node that was dialled meanwhile missed its
  # own modules, and lost its accept loop by that. What is loaded needs no path. Elixir's own modules are always found.

  @modules [
    Hal.Event,
    Mesh.Distribution.Access,
    Mesh.Distribution.Access.Bucket,
    Mesh.Distribution.Access.Networks,
    Mesh.Distribution.Access.Refusals,
    Mesh.Distribution.CallingAddress,
    Mesh.Distribution.ConnectionLog,
    Mesh.Distribution.ConnectionLog.Address,
    Mesh.Distribution.ConnectionLog.Peer,
    Mesh.Distribution.ConnectionLog.Reasons,
    Mesh.Distribution.Epmd.Peers,
    Mesh.Interface,
    Mesh.SafeTable
  ]

  @doc """
  Those modules: what the carriers, `Mesh.Distribution.Epmd` and the filter of the log call, and what that calls, besides
  `Epmd` and `Listener`, which run when they ask for it.
  """
  @spec modules() :: [module(), ...]
  def modules, do: @modules

  @doc "Loads them; one that is not there is missed only by what calls it."
  @spec load() :: :ok
  def load do
    for module <- @modules, do: :code.ensure_loaded(module)
    :ok
  end
end
