defmodule Mesh.Sockets do
  @moduledoc """
  Opens a node's two UDP sockets: one for sending and for its own address, and one that listens to the multicast group,
  which all nodes of a machine share.

  The group is joined, and spoken to, by each address in `on`, whatever the routes of the machine say: the kernel by
  itself would choose one card for a group, or none where no default route is.

  They belong to the process that opens them, and close with it. Both deliver a limited number of
  datagrams before they must be asked again, so that a flood waits, and is lost, in the kernel and
  not in a process's mailbox.
  """
  alias Mesh.{Interface, Options}

  @burst 100
  @memory 1_048_576
  # Linux's IP_MULTICAST_IF, at the level of IP.
  @multicast_if {0, 32}

  @enforce_keys [:own, :ip, :port]
  defstruct @enforce_keys ++ [multicast: nil, group: nil, deaf: nil, on: []]

  @typedoc """
  `ip` is the address that `own` is bound to; `on` are those that the group at `multicast` is joined and spoken to by;
  `deaf` is why there is no socket `group`.
  """
  @type t :: %__MODULE__{
          own: :gen_udp.socket(),
          ip: :inet.ip4_address(),
          port: :inet.port_number(),
          multicast: Mesh.Strategy.address() | nil,
          group: :gen_udp.socket() | nil,
          deaf: :inet.posix() | nil,
          on: [:inet.ip4_address()]
        }

  @doc """
  Opens both sockets, the first bound to this address. `{:error, reason}` with reasons of `:inet`, such as
  `:eaddrinuse`. Without the group's socket the node still has its list of peers, so that it lacks is no error.
  """
  @spec open(Options.t(), :inet.ip4_address()) :: {:ok, t()} | {:error, term()}
  def open(%Options{} = options, ip) do
    sending = [
      :binary,
      ip: ip,
      active: @burst,
      recbuf: @memory,
      multicast_ttl: 1,
      multicast_loop: true
    ]

    with {:ok, own} <- :gen_udp.open(options.port, sending),
         {:ok, port} <- :inet.port(own) do
      group = if options.multicast, do: options.multicast
      {:ok, listen(%__MODULE__{own: own, ip: ip, port: port, multicast: group})}
    end
  end

  @doc "Closes both."
  @spec close(t()) :: :ok
  def close(%__MODULE__{own: own, group: group}),
    do: Enum.each([own | List.wrap(group)], &:gen_udp.close/1)

  @doc """
  The addresses that others hear this node from: the one that it is bound to, or all
  that the machine has now, those of the loopback last; before them those of the option
  `addresses`.
  """
  @spec addresses(t(), Options.t(), Interface.machine()) :: [Mesh.Strategy.address()]
  def addresses(%__MODULE__{ip: ip, port: port}, %{addresses: further}, machine) do
    own = if ip == {0, 0, 0, 0}, do: Interface.all(machine), else: [ip]
    further ++ for ip <- own, do: {ip, port}
  end

  @doc """
  Sends a datagram: to the group by each of its addresses, else as the machine's routes say. An error is one of the
  network; for the group it means that none of the addresses could send.
  """
  @spec send(t(), Mesh.Strategy.address(), binary()) :: :ok | {:error, term()}
  def send(%__MODULE__{multicast: group, on: []}, group, _datagram), do: {:error, :enetunreach}

  def send(%__MODULE__{own: own, multicast: group, on: on}, group, datagram) do
    sent = for ip <- on, do: with(:ok <- by(own, ip), do: :gen_udp.send(own, group, datagram))
    if :ok in sent, do: :ok, else: hd(sent)
  end

  def send(%__MODULE__{own: own}, address, datagram), do: :gen_udp.send(own, address, datagram)

  # The emulator does not tell that the kernel refused, and would send by the last one.
  defp by(socket, {a, b, c, d}) do
    {level, option} = @multicast_if
    ip = <<a, b, c, d>>
    _untold = :inet.setopts(socket, [{:raw, level, option, ip}])

    case :inet.getopts(socket, [{:raw, level, option, 4}]) do
      {:ok, [{:raw, _level, _option, ^ip}]} -> :ok
      _other -> {:error, :eaddrnotavail}
    end
  end

  @doc "Asks for the next datagrams of a socket."
  @spec again(:gen_udp.socket()) :: :ok | {:error, term()}
  def again(socket), do: :inet.setopts(socket, active: @burst)

  @doc "Is in the group by these addresses from now on."
  @spec follow(t(), [:inet.ip4_address()]) :: t()
  def follow(%__MODULE__{on: on} = sockets, on), do: sockets

  def follow(%__MODULE__{} = sockets, on) do
    for ip <- sockets.on -- on, do: membership(sockets, :drop_membership, ip)
    # All: a card that two addresses share was joined by one of them only.
    for ip <- on, do: membership(sockets, :add_membership, ip)
    %{sockets | on: on}
  end

  @doc "Joins the group again, because a card that was taken away and put back has forgotten it."
  @spec rejoin(t()) :: t()
  def rejoin(%__MODULE__{multicast: nil} = sockets), do: sockets

  def rejoin(%__MODULE__{on: on} = sockets) do
    sockets = if sockets.group, do: sockets, else: listen(sockets)
    for ip <- on, do: membership(sockets, :drop_membership, ip)
    for ip <- on, do: membership(sockets, :add_membership, ip)
    sockets
  end

  # What the kernel says to it, the emulator does not tell.
  defp membership(%{group: nil}, _change, _ip), do: :ok

  defp membership(%{group: socket, multicast: {group, _port}}, change, ip),
    do: :inet.setopts(socket, [{change, {group, ip}}])

  defp listen(%{multicast: nil} = sockets), do: sockets

  defp listen(%{multicast: {group, port}} = sockets) do
    shared = [
      :binary,
      {:active, @burst},
      {:reuseaddr, true},
      {:raw, 1, 15, <<1::native-32>>},
      # Not what other programs of this machine have joined it by (IP_MULTICAST_ALL).
      {:raw, 0, 49, <<0::native-32>>},
      {:ip, group},
      {:recbuf, @memory}
    ]

    case :gen_udp.open(port, shared) do
      {:ok, socket} -> %{sockets | group: socket, deaf: nil}
      {:error, reason} -> %{sockets | deaf: reason}
    end
  end
end
