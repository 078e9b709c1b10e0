defmodule Mesh.Sockets do
  @moduledoc """
  A node's two UDP sockets: one for sending and for its own address, and one that listens to the
  multicast group, which all nodes of a machine share.

  They belong to the process that opens them, and close with it. Both deliver a limited number of
  datagrams before they must be asked again, so that a flood waits, and is lost, in the kernel and
  not in a process's mailbox.
  """
  alias Mesh.Options

  @burst 100
  @memory 1_048_576

  @enforce_keys [:own, :port]
  defstruct @enforce_keys ++ [group: nil, membership: nil]

  @type t :: %__MODULE__{
          own: :gen_udp.socket(),
          port: :inet.port_number(),
          group: :gen_udp.socket() | nil,
          membership: {:inet.ip4_address(), :inet.ip4_address()} | nil
        }

  @doc """
  Opens both sockets. `{:error, reason}` with reasons of `:inet`, such as `:eaddrinuse`,
  `:eaddrnotavail`.
  """
  @spec open(Options.t()) :: {:ok, t()} | {:error, term()}
  def open(%Options{} = options) do
    with {:ok, own} <- :gen_udp.open(options.port, [{:ip, options.interface} | sending(options)]),
         {:ok, port} <- :inet.port(own) do
      {:ok, listen(%__MODULE__{own: own, port: port}, options)}
    end
  end

  @doc """
  The addresses that others hear this node from: that of the interface that it sends from, or all
  that the machine has now, those of the loopback last; before them those of the option
  `addresses`. `{:error, reason}` if the system does not tell.
  """
  @spec addresses(t(), Options.t()) :: {:ok, [Mesh.Strategy.address()]} | {:error, term()}
  def addresses(%__MODULE__{port: port}, %{interface: {0, 0, 0, 0}, addresses: further}) do
    with {:ok, interfaces} <- :inet.getifaddrs() do
      {loopback, others} =
        Enum.split_with(interfaces, fn {_name, about} -> :loopback in about[:flags] end)

      own =
        for {_name, about} <- others ++ loopback,
            {:addr, ip} <- about,
            tuple_size(ip) == 4,
            do: {ip, port}

      {:ok, further ++ own}
    end
  end

  def addresses(%__MODULE__{port: port}, %{interface: ip, addresses: further}),
    do: {:ok, further ++ [{ip, port}]}

  @doc "Sends a datagram; errors are ignored, because they are those of the network."
  @spec send(t(), Mesh.Strategy.address(), binary()) :: :ok | {:error, term()}
  def send(%__MODULE__{own: own}, address, datagram), do: :gen_udp.send(own, address, datagram)

  @doc "Asks for the next datagrams of a socket."
  @spec again(:gen_udp.socket()) :: :ok | {:error, term()}
  def again(socket), do: :inet.setopts(socket, active: @burst)

  @doc "Joins the group again, because an interface that was down has forgotten it."
  @spec rejoin(t()) :: t()
  def rejoin(%__MODULE__{group: nil} = sockets), do: sockets

  def rejoin(%__MODULE__{group: socket, membership: membership} = sockets) do
    _ = :inet.setopts(socket, drop_membership: membership)
    _ = :inet.setopts(socket, add_membership: membership)
    sockets
  end

  defp sending(options) do
    [:binary, active: @burst, recbuf: @memory, multicast_ttl: 1, multicast_loop: true] ++
      if(options.interface == {0, 0, 0, 0}, do: [], else: [multicast_if: options.interface])
  end

  # Without multicast the node still has its list of peers, so this never fails the start.
  defp listen(sockets, %{multicast: false}), do: sockets

  defp listen(sockets, %{multicast: {group, port}} = options) do
    membership = {group, options.interface}

    shared = [
      :binary,
      {:active, @burst},
      {:reuseaddr, true},
      {:raw, 1, 15, <<1::native-32>>},
      {:ip, group},
      {:recbuf, @memory}
    ]

    with {:ok, socket} <- :gen_udp.open(port, shared) do
      _ = :inet.setopts(socket, add_membership: membership)
      %{sockets | group: socket, membership: membership}
    else
      {:error, _reason} -> sockets
    end
  end
end
