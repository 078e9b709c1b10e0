defmodule Mesh.Distribution.Tls_dist do
  @moduledoc """
  Carries Erlang's distribution by TLS, for the addresses of the fleet only (`Mesh.Distribution.Access`): others are
  refused before the handshake of TLS begins.

      -proto_dist Elixir.Mesh.Distribution.Tls -ssl_dist_optfile …

  On the wire it is OTP's own. All is done by `:inet_tls_dist`, which accepts with the socket module
  `Mesh.Distribution.Listener`. Erlang adds the ending `_dist` to the name of a carrier.
  """
  alias Mesh.Distribution.{CallingAddress, Listener}

  # The callbacks that Erlang expects of a carrier.

  @doc false
  @spec childspecs() :: {:ok, [:supervisor.child_spec()]}
  def childspecs, do: otp(:childspecs, [])

  @doc false
  @spec listen(charlist(), charlist()) :: {:ok, tuple()} | {:error, term()}
  def listen(name, host) do
    :ok = Listener.open()
    otp(:listen, [name, host])
  end

  # Up to OTP 25 the socket module is an argument, later it is the one that the listening socket is registered with.
  @doc false
  @spec accept(port()) :: pid()
  def accept(listening) do
    if function_exported?(:inet_tls_dist, :gen_accept, 2) do
      otp(:gen_accept, [Listener, listening])
    else
      :erlang.port_set_data(listening, Listener)
      otp(:accept, [listening])
    end
  end

  @doc false
  @spec accept_connection(pid(), term(), node(), list(), timeout()) :: pid()
  def accept_connection(from, socket, me, allowed, ms),
    do: otp(:accept_connection, [from, socket, me, allowed, ms])

  @doc false
  @spec select(node()) :: boolean()
  def select(node), do: Listener.reachable?(node)

  @doc false
  @spec setup(node(), term(), node(), :longnames | :shortnames, timeout()) :: pid()
  def setup(node, type, me, names, ms) do
    :ok = CallingAddress.set()
    otp(:setup, [node, type, me, names, ms])
  end

  @doc false
  @spec close(port()) :: :ok
  def close(socket), do: otp(:close, [socket])

  @doc false
  @spec address() :: tuple()
  def address, do: otp(:address, [])

  @doc false
  @spec is_node_name(term()) :: boolean()
  def is_node_name(name), do: otp(:is_node_name, [name])

  # Of an application that only nodes with TLS need.
  defp otp(function, arguments), do: apply(:inet_tls_dist, function, arguments)
end
