defmodule Mesh.Distribution.Listener do
  @moduledoc false
  # Accepts connections of OTP's distribution in the carriers `Mesh.Distribution.Tcp_dist` and `.Tls_dist`: `:inet_tcp`,
  # but that `accept/1` returns only connections that `Mesh.Distribution.Access` lets in. It closes all others at once and
  # accepts the next. Nothing is read from refused connections, and no other process hears of them. Without TLS,
  # `recv/3` then asks whether the name that opens OTP's handshake may become an atom.
  #
  # OTP accepts with the priority `max`, so that on a robot with one processor a flood would leave none to the others.
  # From the first refusal until it lets one in, it therefore accepts with the priority `normal`.
  alias Mesh.Distribution
  alias Mesh.Distribution.{Epmd, Preload}
  alias Mesh.Distribution.Access.{Networks, Refusals}
  alias Mesh.Interface

  @doc """
  Creates the tables of permitted callers, from `CONVOY_INTERFACE`, `CONVOY_ALLOW` and `CONVOY_PEERS`. The calling
  process, `:net_kernel`, owns them. A node with an interface listens on all addresses, because that of its interface
  may come later and change, and refuses calls to any other (`Mesh.Distribution.Access`).
  """
  @spec open() :: :ok
  def open do
    :ok = Preload.load()
    :ok = Refusals.open()
    peers = for {_node, ip, _port} <- Epmd.Peers.parse(environment(~c"CONVOY_PEERS")), do: ip
    allowed = String.split(environment(~c"CONVOY_ALLOW"), [",", " "], trim: true)

    Distribution.Access.open(
      Interface.of_environment(),
      for(text <- peers ++ allowed, {:ok, network} <- [Networks.read(text)], do: network)
    )
  end

  @doc """
  Whether this node may connect to that one, judged by the address that it would be called at. One that does not
  listen, such as a shell with `-dist_listen false`, may connect to all.
  """
  @spec reachable?(node()) :: boolean()
  def reachable?(node) do
    with [name, host] <- :string.split(Atom.to_charlist(node), ~c"@"),
         answer when elem(answer, 0) == :ok <-
           :net_kernel.epmd_module().address_please(name, host, :inet) do
      not Distribution.Access.there?() or Distribution.Access.reachable?(elem(answer, 1), now())
    else
      _unknown -> false
    end
  end

  @doc "The next connection that is let in; errors are those of `:inet_tcp.accept/1`."
  @spec accept(port()) :: {:ok, port()} | {:error, term()}
  def accept(listening), do: accept_next(listening, nil)

  @doc "As of `:inet_tcp`."
  @spec family() :: :inet
  def family, do: :inet

  @doc "As of `:inet_tcp`."
  @spec controlling_process(port(), pid()) :: :ok | {:error, term()}
  def controlling_process(socket, pid), do: :inet_tcp.controlling_process(socket, pid)

  @doc "As of `:inet_tcp`."
  @spec mask(:inet.ip4_address(), :inet.ip4_address()) :: :inet.ip4_address()
  def mask(mask, ip), do: :inet_tcp.mask(mask, ip)

  @doc "As of `:inet_tcp`."
  @spec send(port(), iodata()) :: :ok | {:error, term()}
  def send(socket, data), do: :inet_tcp.send(socket, data)

  @doc "As of `:inet_tcp`."
  @spec send(port(), iodata(), list()) :: :ok | {:error, term()}
  def send(socket, data, options), do: :inet_tcp.send(socket, data, options)

  @doc """
  As of `:inet_tcp`, for the messages of the handshake; the connection is as closed to a caller whose name is refused.
  """
  @spec recv(port(), non_neg_integer(), timeout()) :: {:ok, charlist()} | {:error, term()}
  def recv(socket, length, ms) do
    with {:ok, message} <- :inet_tcp.recv(socket, length, ms) do
      name = name(message)

      if name == nil or ok?(socket, &Distribution.Access.name(name, &1, &2, &3)),
        do: {:ok, message},
        else: {:error, :closed}
    end
  end

  # Of the messages that a caller sends, only that with its name begins so: in the handshake of today, and in the one
  # before OTP 23.
  defp name([?N, _, _, _, _, _, _, _, _, _, _, _, _, high, low | rest]),
    do: Enum.take(rest, 256 * high + low)

  defp name([?n, _, _, _, _, _, _ | name]), do: name
  defp name(_other), do: nil

  # `before` is the priority before the first refusal.
  defp accept_next(listening, before) do
    case :inet_tcp.accept(listening) do
      {:ok, socket} ->
        if ok?(socket, &Distribution.Access.check/3) do
          _ = before && Process.flag(:priority, before)
          {:ok, socket}
        else
          refuse(socket)
          accept_next(listening, before || Process.flag(:priority, :normal))
        end

      # It has gone before it was accepted.
      {:error, :econnaborted} ->
        accept_next(listening, before)

      {:error, reason} ->
        {:error, reason}
    end
  end

  # Asks by both addresses of a connection; one that has gone has none.
  defp ok?(socket, ask) do
    now = now()

    with {:ok, {ip, _port} = from} <- :inet.peername(socket),
         {:ok, {called, _port}} <- :inet.sockname(socket),
         {:error, why} <- ask.(from, called, now) do
      Refusals.note(ip, why, now)
      false
    else
      :ok -> true
      {:error, _gone} -> false
    end
  end

  # By a reset: the kernel, too, keeps nothing of the connection.
  defp refuse(socket) do
    _ = :inet.setopts(socket, linger: {true, 0})
    :inet_tcp.close(socket)
  end

  defp environment(name), do: to_string(:os.getenv(name, ~c""))
  defp now, do: System.monotonic_time(:millisecond)
end
