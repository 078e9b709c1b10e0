defmodule Mesh.Distribution.EpmdTest do
  use ExUnit.Case, async: false
  alias Mesh.Distribution.Epmd
  @moduletag :realtime
  doctest Epmd

  # Ports that no robot has by default; node names whose host does not exist.
  @host "no-such-host"

  defp start(name, port, variables \\ []) do
    variables = [{"CONVOY_DIST_PORT", "#{port}"}, {"ROBOT", name} | variables]

    flags =
      ~w(-start_epmd false -epmd_module Elixir.Mesh.Distribution.Epmd -kernel dist_auto_connect never) ++
        ~w(-setcookie epmdless -sname #{name}@#{@host})

    Vm.start_one(flags: flags, env: variables)
  end

  test "two nodes connect without epmd, by what was learnt and by the list" do
    list = "green1@#{@host}=127.0.0.1:9751"
    green = start("green1", 9751)
    blue = start("blue1", 9752, [{"CONVOY_PEERS", list}])

    # Nobody has told green about blue: the port of its name is not where blue is.
    refute Vm.call(green, Node, :connect, [:"blue1@no-such-host"])
    :ok = Vm.call(green, Epmd, :learn, ["blue1@no-such-host", {127, 0, 0, 1}, 9752])
    assert Vm.call(green, Node, :connect, [:"blue1@no-such-host"])
    assert Vm.call(blue, Node, :list, []) == [:"green1@no-such-host"]

    assert Vm.call(blue, Node, :disconnect, [:"green1@no-such-host"])
    assert Vm.call(blue, Node, :connect, [:"green1@no-such-host"])

    assert {:ok, [{~c"blue1", 9752}, {~c"green1", 9751}]} =
             Vm.call(blue, :net_adm, :names, [~c"no-such-host"])
  end

  test "without its process it does nothing, and fells nobody" do
    assert Epmd.learn("mag1@convoy", {127, 0, 0, 1}, 9101) == :ok
    assert Epmd.forget("mag1@convoy") == :ok
    assert Epmd.address_please(~c"mag1", ~c"elsewhere", :inet) == {:error, :address}
    assert Epmd.address_please(~c"mag1", ~c"10.0.0.1", :inet) == {:ok, {10, 0, 0, 1}, 9101, 5}
    assert Epmd.address_please(~c"mag1", ~c"10.0.0.1", :inet6) == {:error, :address}
    assert Epmd.port_please(~c"mag1", {10, 0, 0, 1}) == {:port, 9101, 5}
    assert {:ok, creation} = Epmd.register_node(~c"mag1", 9101, :inet)
    assert creation in 4..0xFFFFFFFF
    assert {:ok, []} = Epmd.names(~c"elsewhere")
  end

  test "the table is bounded, and those who are in it may move" do
    start_supervised!(%{id: Epmd, start: {Epmd, :start_link, []}})
    for n <- 1..1_024, do: :ok = Epmd.learn("n#{n}@convoy", {10, 0, 0, 1}, n)
    assert Epmd.learn("one@convoy", {10, 0, 0, 1}, 1) == {:error, :full}
    assert Epmd.learn("n1@convoy", {10, 0, 0, 9}, 77) == :ok
    assert Epmd.address_please(~c"n1", ~c"convoy", :inet) == {:ok, {10, 0, 0, 9}, 77, 5}
    assert Epmd.forget("n2@convoy") == :ok
    assert Epmd.learn("one@convoy", {10, 0, 0, 1}, 1) == :ok
  end
end
