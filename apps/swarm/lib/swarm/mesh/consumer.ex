defmodule Swarm.Mesh.Consumer do
  @moduledoc """
  What those above the mesh give it at its start: who takes what it hears.

  The mesh knows no message and no service by itself. It asks the consumer what a term from outside is
  worth, and hands on what is worth something. All callbacks run in processes of the mesh, which
  must not wait: they cast.
  """

  @typedoc """
  What the mesh has to know of a message: the `robots` that it claims to be of, its author first and then those
  for whom it is passed on, which must all be of the fleet; and of a heartbeat its number.
  """
  @type about :: %{
          robots: [atom(), ...],
          beat: {boot :: integer(), sequence :: non_neg_integer()} | nil
        }

  @doc """
  Called once, before anything is heard: says who hears the terms of which service (`Swarm.Mesh.cast/2`). A term
  goes to `apply(m, f, a ++ [node, term])`. Terms of other services are refused. Words that may come as atoms must be known from here on.
  """
  @callback services() :: %{atom() => {module(), atom(), list()}}

  @doc "Whether a term is a message that robots may act on, and what it is. Pure."
  @callback read(term()) :: {:ok, message :: term(), about()} | :error

  @doc "A message of a robot on that node, for these robots of this node or all of them."
  @callback deliver(:all | [atom()], node(), message :: term()) :: :ok

  @doc """
  A request to a robot of this node that came over other nodes. It bears an alias to answer to. `:error` where
  the robot is not on this node.
  """
  @callback command(robot :: atom(), request :: tuple()) :: :ok | :error
end
