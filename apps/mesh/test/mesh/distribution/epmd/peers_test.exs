defmodule Mesh.Distribution.Epmd.PeersTest do
  use ExUnit.Case, async: true
  alias Mesh.Distribution.Epmd.Peers
  doctest Peers

  test "the usual names never share a port" do
    names = for(kind <- ~w(mag min), n <- 1..100, do: "#{kind}#{n}") ++ ~w(world base demo)
    ports = Enum.map(names, &Peers.default_port/1)
    assert Enum.uniq(ports) == ports

    for name <- ~w(mag0 mag101 mag1x magellan zoë),
        do: assert(Peers.default_port(name) in 9400..9999)
  end

  test "what cannot be read of a list is left out" do
    assert Peers.parse("") == []

    for word <- ["a", "a=1.2.3.4", "a@b=", "a@b=1.2.3", "a@b=1.2.3.4:0", "a@b=1.2.3.4:70000"] do
      assert Peers.parse(word) == []
      assert [{"mag1@c", {1, 2, 3, 4}, 9101}] = Peers.parse(word <> ",mag1@c=1.2.3.4")
    end

    assert [{"a@b", {0, 0, 0, 0, 0, 0, 0, 1}, 5}] = Peers.parse("a@b=[::1]:5")
  end

  test "a shell beside a robot does not take the robot's port" do
    robot = %{"CONVOY_DIST_PORT" => "9400", "ROBOT" => "mag1"}
    assert Peers.own_port("rpc-77-mag1", robot) == 0
    assert Peers.own_port("mag1", %{"ROBOT" => "mag1"}) == 9101
    assert Peers.own_port("mag1", %{}) == 9101
    assert Peers.own_port("rem-1", %{}) == 0
    assert Peers.own_port("mag1", %{"CONVOY_DIST_PORT" => "rubbish"}) == 9101
  end

  test "only own hosts and addresses are guessed" do
    assert Peers.guess("mag2", "convoy", "convoy") == {{127, 0, 0, 1}, 9102}
    assert Peers.guess("mag2", "10.0.0.2", "convoy") == {{10, 0, 0, 2}, 9102}
    assert Peers.guess("mag2", "elsewhere", "convoy") == nil
  end
end
