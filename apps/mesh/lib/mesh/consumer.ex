defmodule Mesh.Consumer do
  @moduledoc """
  Receives what the mesh hears. `Mesh.Supervisor` is given a module with this behaviour at its start.

  The mesh itself knows neither messages nor services. It asks the consumer whether a term from
  outside is a message, and passes on those that are. All callbacks run in processes of the mesh,
  which must not wait, so they only cast.
  """

  @typedoc """
  What the mesh has to know about a message. `robots` are those that it claims to be from: its
  author first, then those whose message the author forwards. All must belong to the fleet. `beat`
  is the number of a heartbeat, and `nil` for all other messages.
  """
  @type about :: %{
          robots: [atom(), ...],
          beat: {boot :: integer(), sequence :: non_neg_integer()} | nil
        }

  @doc """
  The services (`Mesh.cast/2`) and the functions that receive their terms: `apply(m, f, a ++ [node, term])`. Terms of
  other services are refused. Called once, before anything is heard; from then on all atoms that
  messages and terms may contain must exist, because what arrives creates none.
  """
  @callback services() :: %{atom() => {module(), atom(), list()}}

  @doc """
  The services whose terms are taken however old they are, and from any forwarder: what stops
  robots. All other terms, and all messages, must have been made within the last 2 s.
  """
  @callback late() :: [atom()]

  @doc "Checks a term that claims to be a message. Pure."
  @callback read(term()) :: {:ok, message :: term(), about()} | :error

  @doc "Delivers a message from that node to these robots of this node, or to all of them."
  @callback deliver(:all | [atom()], node(), message :: term()) :: :ok

  @doc """
  Passes a request that arrived through other nodes to a robot of this node. The request contains
  an alias for the answer. `:error` if the robot is not on this node.
  """
  @callback command(robot :: atom(), request :: tuple()) :: :ok | :error
end
