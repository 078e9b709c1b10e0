defmodule Mesh.PeerCase do
  @moduledoc """
  The mesh of this VM on real sockets, which hears one other node, `b`: the protocol on a socket of
  the test's (`Mesh.SocketPeer`). The mesh has names, so such tests run one after the other.

  The context has the other node as `peer`, once each of the two has heard the other.
  """
  use ExUnit.CaseTemplate
  alias Mesh.{Air, FakeConsumer, Options, SocketPeer}

  using do
    quote do
      import Mesh.PeerCase
      import Mesh.SocketPeer, only: [until: 2, act: 2, keep_back: 2, now: 0]
      alias Mesh.SocketPeer
    end
  end

  setup do
    Process.register(self(), FakeConsumer)
    {_socket, address} = place = SocketPeer.open()

    {:ok, options} =
      Options.new(
        secret: Air.secret(),
        fleet: fleet(),
        interface: {127, 0, 0, 1},
        port: 0,
        multicast: false,
        peers: [address],
        dist_port: 0
      )

    start_supervised!({Mesh.Supervisor, {options, FakeConsumer}})
    peer = SocketPeer.new(other(), fleet(), place)
    heard? = &(Mesh.alive() == [other()] and &1.protocol.node_table.nodes["#{node()}"] != nil)
    %{peer: SocketPeer.until(peer, heard?)}
  end

  # This node is of the fleet by whatever name it has.
  defp fleet, do: [own(0), :a, :b]

  @doc "The name of the other node."
  def other, do: :"b@#{own(1)}"

  defp own(part), do: "#{node()}" |> String.split("@") |> Enum.at(part) |> String.to_atom()
end
