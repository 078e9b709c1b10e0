defmodule Mesh.SocketsTest do
  use ExUnit.Case, async: true
  alias Mesh.{Air, Options, Sockets}

  defp open(options) do
    {:ok, options} = Options.new([secret: Air.secret(), port: 0, multicast: false] ++ options)
    {:ok, machine} = Mesh.Interface.machine()
    {:ok, sockets} = Sockets.open(options, options.interface)
    {Sockets.addresses(sockets, options, machine), sockets.port}
  end

  test "a node that listens on all interfaces has all addresses of the machine, the loopback's last" do
    {addresses, port} = open([])
    {:ok, interfaces} = :inet.getifaddrs()
    ips = for {_name, about} <- interfaces, {:addr, ip} <- about, tuple_size(ip) == 4, do: ip
    assert Enum.sort(addresses) == Enum.sort(for ip <- ips, do: {ip, port})
    assert List.last(addresses) == {{127, 0, 0, 1}, port}
  end

  test "one that listens on one has that, and those by which others see it" do
    {addresses, port} = open(interface: {127, 0, 0, 1}, addresses: ["203.0.113.5:4370"])
    assert addresses == [{{203, 0, 113, 5}, 4370}, {{127, 0, 0, 1}, port}]
  end
end
