defmodule Swarm.Host.Resolver do
  @moduledoc """
  Lets a node ask name servers once it is up. Erlang asks for the name of its machine when it starts, and would wait for
  a name server that does not answer; so the scripts start it with `RES_OPTIONS=attempts:0`, by which the C library asks
  none, and keep in `CONVOY_RES_OPTIONS` what was there before. Programs that the node starts, such as one that reads a
  camera by its name, inherit its environment.
  """

  @kept "CONVOY_RES_OPTIONS"
  @options "RES_OPTIONS"

  @doc "Name servers are asked from now on, by this node and by what it starts."
  @spec open() :: :ok
  def open do
    case System.get_env(@kept) do
      nil -> :ok
      "" -> again(System.delete_env(@options))
      options -> again(System.put_env(@options, options))
    end
  end

  # The program that asks for Erlang still has the old environment.
  defp again(:ok) do
    _answer = :inet_gethost_native.control(:soft_restart)
    :ok
  end

  @doc "As before the start, for a restart within the same process of the operating system."
  @spec close() :: :ok
  def close, do: if(System.get_env(@kept), do: System.put_env(@options, "attempts:0"), else: :ok)
end
