defmodule Lab.NodesTest do
  @moduledoc "The pure parts of fleets whose robots are processes of their own."
  use ExUnit.Case, async: true
  alias Lab.Fleet.Nodes
  alias Lab.Fleet.Nodes.{Child, Command}
  doctest Lab.Fleet.Nodes.Command
  doctest Lab.Fleet.Nodes.Config

  test "a node listens on loopback only, dials nobody by itself, and has no secret on its command line" do
    arguments = Command.arguments([])
    line = Enum.join(arguments, " ")
    assert line =~ "inet_dist_use_interface {127,0,0,1}"
    assert line =~ "prevent_overlapping_partitions false"
    assert line =~ "dist_auto_connect never"
    refute line =~ "cookie"
  end

  test "people are told about each process, and about those that are gone" do
    nodes = [{:mag1, :"mag1@127.0.0.1", nil}, {:min1, :"min1@127.0.0.1", 12}]
    [gone, there, attach, kill] = Command.lines(nodes, "/tmp/x")
    assert gone =~ "mag1"
    assert gone =~ "gone"
    assert there == "min1 pid 12 node min1@127.0.0.1"
    assert attach =~ "--remsh min1@127.0.0.1"
    assert kill =~ "kill -9 12"
    assert kill =~ "kill -STOP 12"
    assert kill =~ "kill -CONT 12"
    assert [gone, _no_command] = Command.lines([hd(nodes)], "/tmp/x")
    assert gone =~ "gone"
  end

  test "a config is one line, whatever is in it, and nothing else is accepted as one" do
    {:ok, setup} = Lab.Trial.Setup.new(robots: [:mag1], map: "hall")
    part = {Lab.Node.World, %{name: :w, world: setup.world}}
    config = %Nodes.Config{node: :"world@127.0.0.1", launcher: self(), mesh: [], part: part}
    line = Nodes.Config.line(config)
    assert [_one, ""] = String.split(line, "\n")
    assert Nodes.Config.read(line) == {:ok, config}

    for junk <- ["", "\n", "AAAA\n", Base.encode64("x"), :eof, ~c"list"] do
      assert {:error, told} = Nodes.Config.read(junk)
      assert told =~ "fleet of nodes"
    end
  end

  test "a world that ends for the sixth time ends the run, which can still be asked" do
    {:ok, setup} = Lab.Trial.Setup.new(robots: [:mag1], map: "hall")
    [port | _] = Port.list()
    world = Child.said(%Child{node: :"world@127.0.0.1", port: port, pid: 1}, "Killed\n")

    backend = %Nodes{
      setup: setup,
      host: nil,
      name: :w,
      world: setup.world,
      children: %{world: world},
      world_starts: 5
    }

    assert {:ended, line, backend} = Nodes.hear(backend, {port, {:exit_status, 137}})
    assert line == "world@127.0.0.1 has ended 6 times, last: Killed"
    assert backend.children[:world] == nil
    assert Nodes.world(backend) == setup.world
  end

  test "the end of a node's output is kept, and its last line reported" do
    child = %Child{node: :n, port: nil, pid: 1}
    assert Child.last_line(child) == "it printed nothing"

    child =
      child |> Child.said(String.duplicate("x", 9_000) <> "\n") |> Child.said("the reason\n")

    assert byte_size(child.said) <= 4_000
    assert Child.last_line(child) == "the reason"
    assert Child.last_line(Child.said(child, <<255>>)) =~ "255"
  end
end
