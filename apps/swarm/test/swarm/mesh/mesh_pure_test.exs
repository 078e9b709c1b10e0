defmodule Swarm.Mesh.PureTest do
  use ExUnit.Case, async: true
  alias Swarm.Mesh.{Book, Options, Plan}

  doctest Swarm.Mesh.Backoff
  doctest Swarm.Mesh.Beacon
  doctest Swarm.Mesh.Certs
  doctest Swarm.Mesh.Guard
  doctest Swarm.Mesh.Log
  doctest Swarm.Mesh.Packet
  doctest Swarm.Mesh.Plan
  doctest Swarm.Mesh.Roster
  doctest Swarm.Mesh.Strategy.Static

  test "up to 30 nodes everybody is connected to everybody, above that to few, and all hang together" do
    for count <- [2, 30, 31, 60, 100] do
      names = for n <- 1..count, do: "mag#{100 + n}@lab"
      links = Map.new(names, &{&1, Plan.peers(&1, names, 30, 8)})

      if count <= 30,
        do: assert(Enum.all?(links, fn {me, peers} -> peers == names -- [me] end)),
        else: assert(Enum.all?(links, fn {_me, peers} -> length(peers) in 6..8 end))

      # What one plans the other plans too.
      for {me, peers} <- links, peer <- peers, do: assert(me in links[peer])

      for other <- tl(names) do
        route = Plan.route(hd(names), other, links)
        assert List.last(route) == other and length(route) <= 7
      end
    end
  end

  test "the number of the view grows with a node that goes and comes, not with one that is late" do
    place = {{10, 0, 0, 7}, 4370}
    {book, [up: "b"]} = Book.hear(Book.new("a"), "b", place, 0)
    {late, [suspect: "b"]} = Book.age(book, 1_500)
    {back, [up: "b"]} = Book.hear(late, "b", place, 1_600)
    assert {book.number, late.number, back.number} == {1, 1, 1}
    {gone, [gone: "b"]} = Book.age(back, 3_600)
    {again, [up: "b"]} = Book.hear(gone, "b", place, 9_000)
    assert {gone.number, again.number} == {2, 3}
  end

  test "there is no way to where no connection leads" do
    assert Plan.route("a", "z", %{"a" => ["b"], "b" => ["a"], "z" => []}) == nil
  end

  test "options are checked by name" do
    secret = Swarm.Air.secret()

    for {options, word} <- [
          {[prot: 1], "no option :prot"},
          {[port: -1], "mesh port is a whole number from 0 to 65535, not -1"},
          {[multicast: {{10, 0, 0, 1}, 1}], "mesh multicast"},
          {[multicast: {{239, 999, 0, 1}, 1}], "mesh multicast"},
          {[multicast: "239.0.0.1:1"], "mesh multicast"},
          {[peers: ["10.0.0.1"]], ~s(not "10.0.0.1")},
          {[peers: :all], "peers are addresses"},
          {[interface: "eth0"], "mesh interface"},
          {[multicast: nil], "mesh multicast"},
          {[fleet: [:"mag1\n"]], "fleet names robots by atoms"},
          {[fleet: ["mag1"]], "fleet names robots by atoms"},
          {[strategies: [String]], "strategies are {Module, options}"},
          {[strategies: [{String, 1}]], "strategy String is no Swarm.Mesh.Strategy"},
          {[secret: "cookie"], "mesh secret_file"},
          {[full_mesh: 1], "mesh full_mesh"},
          {[topologies: [lab: [strategy: Nowhere]]], "mesh topologies need libcluster"},
          {[topologies: :lab], "mesh topologies are libcluster's"}
        ] do
      assert {:error, line} = Options.new(Keyword.merge([secret: secret], options))
      assert line =~ word
      refute line =~ "\n"
    end

    assert {:ok, %Options{port: 4370}} = Options.new(secret: secret)
  end
end
