defmodule Mesh.Distribution.Tcp_dist do
  @moduledoc """
  Carries Erlang's distribution by TCP, for the addresses of the fleet only (`Mesh.Distribution.Access`):

      -proto_dist Elixir.Mesh.Distribution.Tcp

  On the wire it is OTP's own: a node with this carrier and one without connect. All is done by `:inet_tcp_dist`, which
  accepts with the socket module `Mesh.Distribution.Listener`. Erlang adds the ending `_dist` to the name of a carrier.
  """
  alias Mesh.Distribution.{CallingAddress, Listener}

  # The callbacks that Erlang expects of a carrier.

  @doc false
  @spec listen(charlist(), charlist()) :: {:ok, tuple()} | {:error, term()}
  def listen(name, host) do
    :ok = Listener.open()
    :inet_tcp_dist.listen(name, host)
  end

  @doc false
  @spec accept(port()) :: pid()
  def accept(listening), do: :inet_tcp_dist.gen_accept(Listener, listening)

  @doc false
  @spec accept_connection(pid(), port(), node(), list(), timeout()) :: pid()
  def accept_connection(from, socket, me, allowed, ms),
    do: :inet_tcp_dist.gen_accept_connection(Listener, from, socket, me, allowed, ms)

  @doc false
  @spec select(node()) :: boolean()
  def select(node), do: Listener.reachable?(node)

  @doc false
  @spec setup(node(), term(), node(), :longnames | :shortnames, timeout()) :: pid()
  def setup(node, type, me, names, ms) do
    :ok = CallingAddress.set()
    :inet_tcp_dist.setup(node, type, me, names, ms)
  end

  @doc false
  @spec close(port()) :: :ok
  def close(socket), do: :inet_tcp_dist.close(socket)

  @doc false
  @spec address() :: tuple()
  def address, do: :inet_tcp_dist.address()

  @doc false
  @spec is_node_name(term()) :: boolean()
  def is_node_name(name), do: :inet_tcp_dist.is_node_name(name)

  @doc false
  @spec setopts(port(), list()) :: :ok | {:error, term()}
  def setopts(socket, options), do: :inet_tcp_dist.setopts(socket, options)

  @doc false
  @spec getopts(port(), list()) :: {:ok, list()} | {:error, term()}
  def getopts(socket, options), do: :inet_tcp_dist.getopts(socket, options)
end
