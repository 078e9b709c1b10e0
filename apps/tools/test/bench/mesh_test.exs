defmodule Bench.MeshTest do
  use ExUnit.Case, async: true
  import ExUnit.CaptureIO
  alias Bench.Mesh
  alias Bench.Mesh.{Figures, Main}
  @moduletag :slow

  doctest Bench.Mesh
  doctest Bench.Mesh.Figures
  doctest Bench.Mesh.Report

  defp row(name, size, ours, bare) do
    {:ok, [case]} = Mesh.choose(name)
    figures = &(&1 && Figures.of([&1]))
    %{case: case, size: size, robots: 100, ours: figures.(ours), bare: figures.(bare)}
  end

  defp cells(row) do
    [_head, _rule, line] = [row] |> Mesh.Report.draw() |> String.split("\n", trim: true)
    line |> String.split("|", trim: true) |> Enum.map(&String.trim/1)
  end

  test "one slow batch does not move the median, but shows in the 99th percentile" do
    batches = [List.duplicate(10, 100), List.duplicate(11, 100), List.duplicate(900, 100)]
    assert %{p50: 11, p99: 900, max: 900, count: 300} = Figures.of(batches)
  end

  test "a line says whether the goal is reached, and how many times as long as bare OTP it takes" do
    assert [
             "command to all" <> _,
             "3",
             "120 us / 120 us",
             "60 us" <> _,
             "2.00",
             _goal,
             "yes",
             "1",
             _
           ] = cells(row("ping", 3, [120], [60]))

    assert "**no**" in cells(row("ping", 3, [160], [60]))
    assert "**no**" in cells(row("ping", 3, List.duplicate(60, 97) ++ [1001, 1001, 1001], [60]))
    assert "**no**" in cells(row("rate", :one, [9.5], nil))
    assert "yes" in cells(row("rate", :one, [9.9], nil))
  end

  test "what was not measured, and what has no goal, is left open" do
    assert ["noticing silence" <> _, "7", "–", "–", "–", "<= 2.00 s", "–", "–", "–"] =
             cells(row("silence", 7, nil, nil))
  end

  test "the rows are JSON" do
    term = Mesh.Report.term([row("ping", 3, [120], [60])], %{load_before: 0.5})
    assert Hal.Json.encode!(term) =~ ~s("case":"ping","nodes":3)
  end

  test "errors about wrong options say what is allowed" do
    assert {:error, [nodes, only]} = Main.run(~w(--nodes 0 --only pong))
    assert nodes =~ "whole numbers from 2 to 100"
    assert only =~ "ping, gather"
  end

  @tag :tmp_dir
  test "three nodes answer", %{tmp_dir: folder} do
    json = Path.join(folder, "figures.json")

    table =
      capture_io(fn ->
        arguments = ~w(--nodes 3 --robots-in-one-node 2 --only gather,round --share 1)
        assert :ok = Main.run(arguments ++ ["--json", json])
      end)

    assert [_head, _rule, gather, round, one, _round, _bare, _load] =
             String.split(table, "\n", trim: true)

    assert gather =~ "envelope to all + all replies | 3 |"
    assert round =~ "everyone to everyone | 3 |"
    assert one =~ "1 (2 robots)"
    assert File.read!(json) =~ ~s("case":"gather")
  end
end
