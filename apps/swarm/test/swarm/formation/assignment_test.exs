defmodule Swarm.Formation.AssignmentTest do
  use ExUnit.Case, async: true
  alias Swarm.Formation.{Assignment, Chain}

  defp permutations([]), do: [[]]
  defp permutations(list), do: for(x <- list, rest <- permutations(list -- [x]), do: [x | rest])

  defp cost(rows, columns),
    do: rows |> Enum.zip(columns) |> Enum.map(fn {row, j} -> Enum.at(row, j) end) |> Enum.sum()

  test "the matching is as cheap as the best of all matchings" do
    for _ <- 1..150 do
      n = :rand.uniform(6)
      rows = for _ <- 1..n, do: for(_ <- 1..n, do: :rand.uniform(50) - 10)
      match = Assignment.match(rows)
      assert Enum.sort(match) == Enum.to_list(0..(n - 1))

      best =
        0..(n - 1) |> Enum.to_list() |> permutations() |> Enum.map(&cost(rows, &1)) |> Enum.min()

      assert cost(rows, match) == best
    end
  end

  test "with squared costs no pair would rather swap" do
    for _ <- 1..50 do
      n = 2 + :rand.uniform(10)
      place = fn -> {:rand.uniform(12_000), :rand.uniform(12_000)} end
      robots = for i <- 1..n, do: {:"mag#{i}", place.()}
      slots = for _ <- 1..n, do: place.()
      order = Assignment.order(:cost, Enum.shuffle(robots), {0, 0}, slots)
      pairs = Enum.zip(order, slots) |> Enum.map(fn {id, slot} -> {robots[id], slot} end)

      for {{ax, ay}, {gx, gy}} <- pairs, {{bx, by}, {hx, hy}} <- pairs do
        assert (ax - bx) * (gx - hx) + (ay - by) * (gy - hy) >= 0
      end
    end
  end

  test "the chain is a single path for any poses, even equal ones" do
    for _ <- 1..200 do
      n = :rand.uniform(12)
      robots = for i <- 1..n, do: {:"min#{i}", {:rand.uniform(4), :rand.uniform(4)}}
      order = Chain.order(Enum.shuffle(robots), {0, 0})
      assert order == Chain.order(robots, {0, 0})
      assert Enum.sort(order) == robots |> Enum.map(&elem(&1, 0)) |> Enum.sort()
      chain = [:mag1 | order]
      assert walk(chain, :mag1) == chain
    end
  end

  defp walk(chain, robot) do
    case Chain.child(chain, robot) do
      nil -> [robot]
      child -> [robot | walk(chain, child)]
    end
  end
end
