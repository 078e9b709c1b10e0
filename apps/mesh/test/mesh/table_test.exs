defmodule Mesh.TableTest do
  # The table has a name: there is one a VM.
  use ExUnit.Case, async: false

  alias Mesh.Table
  alias Mesh.Protocol.{Beacon, NodeTable, Roster}

  @address {{10, 0, 0, 7}, 4370}

  defp now, do: System.monotonic_time(:millisecond)

  # What "a" knows: "b" speaks now and hears "c", which was heard here three seconds ago.
  defp torn(now_ms) do
    {table, _up} = NodeTable.hear(NodeTable.new("a@lab"), "c@lab", @address, now_ms - 3_000)
    table = NodeTable.robot(table, "c@lab", :c, {1, 1}, now_ms - 3_000)
    {table, _up} = NodeTable.hear(table, "b@lab", @address, now_ms)
    hears = for name <- ["a@lab", "c@lab"], do: {name, @address}
    beacon = %Beacon{hears: hears, links: ["c@lab", "d@lab"], port: 0}
    NodeTable.beacon(table, "b@lab", beacon, now_ms)
  end

  test "without a mesh it is as an empty one" do
    refute Mesh.running?()
    assert {Mesh.robots(), Mesh.beyond(), Mesh.alive(), Mesh.rejected()} == {%{}, [], [], %{}}
    assert Mesh.view() == %{number: 0, nodes: %{}}
    assert Mesh.beat(:c) == nil
    refute Mesh.heard?(:c) or Mesh.silent?(:c@lab)
    assert Mesh.relay(:c, {:x}, make_ref()) == {:error, :unknown}
    assert Mesh.speak(:all, :x) == :ok and Mesh.cast(:rows, :x) == :ok
  end

  test "who is there, and who is not, each by a row of its own" do
    now_ms = now()
    roster = Roster.new(:a@lab, [:a, :b, :c, :d])
    written = Table.write(Table.new(), torn(now_ms), roster, %{unsigned: 2}, nil, now_ms)
    Table.beat(:b, :b@lab, {5, 9}, now_ms)
    Table.beat(:c, :c@lab, {1, 1}, now_ms - 3_000)

    assert Mesh.running?()
    assert Mesh.robots() == %{b: :b@lab}
    assert {Mesh.heard?(:b), Mesh.heard?(:c), Mesh.heard?(:d)} == {true, false, false}
    assert {5, 9, age_ms} = Mesh.beat(:b)
    assert age_ms in 0..1_000
    assert Mesh.beyond() == [:c]
    assert Mesh.alive() == [:b@lab]
    assert for(node <- [:b@lab, :c@lab, :d@lab], do: Mesh.silent?(node)) == [false, true, false]
    assert Mesh.rejected() == %{unsigned: 2}
    # To `d` there is a connection, but nothing is heard of it.
    assert Table.onward(now_ms) == %{b@lab: [:c@lab]}

    assert %{number: 2, nodes: %{b@lab: b, c@lab: c}} = Mesh.view()
    assert %{status: :alive, hears: [:a@lab, :c@lab], robots: [:b], connected: false} = b
    assert %{status: :gone, hears: [], robots: []} = c
    assert Mesh.relay(:c, {:x}, make_ref()) == {:error, :no_way}

    # `c` speaks again: it is not beyond any more.
    {table, _up} = NodeTable.hear(torn(now_ms), "c@lab", @address, now_ms)
    assert Table.write(written, table, roster, %{}, nil, now_ms) == written
    assert {Mesh.beyond(), Mesh.silent?(:c@lab)} == {[], false}
  end

  test "what is copied for one robot does not grow with the fleet" do
    sizes =
      for count <- [4, 40] do
        names = for n <- 1..count, do: :"r#{n}"
        roster = Roster.new(:a@lab, names)
        texts = for name <- names, do: "#{name}@lab"
        hears = for text <- texts, do: {text, @address}
        beacon = %Beacon{hears: hears, links: [], port: 0}

        node_table =
          Enum.reduce(texts, NodeTable.new("a@lab"), fn text, node_table ->
            {node_table, _up} = NodeTable.hear(node_table, text, @address, now())
            NodeTable.beacon(node_table, text, beacon, now())
          end)

        Table.write(Table.new(), node_table, roster, %{}, nil, now())
        Table.beat(:r1, :r1@lab, {1, 1}, now())
        looked_up = [Table.robot(:r1), Table.heard_ms(:r1@lab), Table.value(:beyond, [])]
        :ets.delete(Table)
        :erts_debug.flat_size(looked_up)
      end

    assert [size, size] = sizes
  end
end
