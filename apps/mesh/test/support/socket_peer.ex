defmodule Mesh.SocketPeer do
  @moduledoc """
  Another node for tests of `Mesh.Server`: the protocol on a socket of the test's. It lives only while the test lets
  it, and what it makes can be kept back, as by a jammed radio, and sent later, by whomever.
  """
  import ExUnit.Assertions, only: [flunk: 1]
  alias Mesh.{Air, FakeConsumer}
  alias Mesh.Protocol.Roster

  defstruct [:socket, :address, :protocol, told: []]

  @doc "Opens a socket of the test's at this address of the loopback."
  def open(ip \\ {127, 0, 0, 1}) do
    {:ok, socket} = :gen_udp.open(0, [:binary, active: true, ip: ip])
    {:ok, port} = :inet.port(socket)
    {socket, {ip, port}}
  end

  @doc "A node of that name on a socket."
  def new(name, fleet, {socket, address}) do
    protocol =
      Mesh.Protocol.new(
        secret: Air.secret(),
        roster: Roster.new(name, fleet),
        session: :rand.uniform(1_000_000_000),
        strategies: [],
        port: 0,
        addresses: [address],
        consumer: FakeConsumer,
        services: [:rows, :stop]
      )

    %__MODULE__{socket: socket, address: address, protocol: protocol}
  end

  @doc "The same node at another address, which it signs from then on."
  def move(peer, {socket, address}) do
    :gen_udp.close(peer.socket)

    %{
      peer
      | socket: socket,
        address: address,
        protocol: Mesh.Protocol.locate(peer.protocol, [address])
    }
  end

  @doc "Lets the node live until it is so."
  def until(peer, done?, turns \\ 400) do
    cond do
      done?.(peer) ->
        peer

      turns == 0 ->
        flunk("it did not come to pass; it was told #{inspect(peer.told)}")

      true ->
        peer
        |> act(Mesh.Protocol.tick(peer.protocol, [], now(), 0.5))
        |> listen()
        |> until(done?, turns - 1)
    end
  end

  defp listen(%{socket: socket} = peer) do
    receive do
      {:udp, ^socket, ip, port, datagram} ->
        peer |> act(Mesh.Protocol.hear(peer.protocol, datagram, {ip, port}, now())) |> listen()
    after
      50 -> peer
    end
  end

  @doc "Carries out what the protocol has returned."
  def act(peer, {protocol, effects}) do
    for {:send, address, datagram} <- effects, do: :gen_udp.send(peer.socket, address, datagram)
    told = for effect <- effects, elem(effect, 0) in [:deliver, :serve], do: effect
    %{peer | protocol: protocol, told: told ++ peer.told}
  end

  @doc "What the protocol has returned is not sent: returns the datagrams, with who should have got them."
  def keep_back(peer, {protocol, effects}) do
    tape = for {:send, address, datagram} <- effects, do: {address, datagram}
    {tape, %{peer | protocol: protocol}}
  end

  @doc "This node's time."
  def now, do: System.monotonic_time(:millisecond)
end
