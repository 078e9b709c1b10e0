defmodule Bench.MarksTest do
  use ExUnit.Case, async: true
  alias Bench.Marks.Runner
  alias Vision.Marks

  doctest Runner
  @moduletag skip: with({:error, line} <- Marks.available(), do: line, else: (:ok -> false))
  @maps ["hall", "hospital"]

  # By other detectors' makers and by ours: all AprilTags in all conditions, at 20 pixels and more. Self-similar marks need 30.
  defp found(pictures) do
    for family <- Marks.families(),
        {width, shares} <- Runner.found(family, pictures, 5, fn _note -> :ok end),
        width in if(family == :similar, do: [30, 40], else: [20, 24]),
        do: assert({family, width, Enum.min(shares) >= 0.85} == {family, width, true})
  end

  defp no_wrong(empty, tagged) do
    for family <- Marks.families() do
      assert Runner.empty(family, empty, @maps, 5) == 0
      counts = family |> Runner.tagged(tagged, @maps, 5) |> Enum.frequencies_by(& &1.what)
      assert counts[:wrong] == nil

      # Walls hide some. Self-similar marks are twice as wide, and two of five hang too far away for 24 pixels.
      assert counts.right > tagged / if(family == :similar, do: 3, else: 2)
    end
  end

  test "marks that are wide enough are found in each condition, and no others" do
    found(8)
    no_wrong(40, 40)
  end

  @tag :long
  @tag timeout: :infinity
  test "no wrong number in 10,000 pictures without marks and 1,000 with one" do
    found(100)
    no_wrong(10_000, 1_000)
  end

  test "what is seen is told with its errors, by how wide it is" do
    rows = :tag36h11 |> Runner.tagged(60, ["hall"], 7) |> Runner.errors()
    assert [["0 to 20", _, _, range | _] | _] = rows
    assert range =~ ~r"^\d\.\d\d % / \d\.\d\d %$"
    assert Runner.errors([%{what: :none, width: 30.0, errors: nil}]) |> hd() |> Enum.at(3) == "-"
  end
end
