defmodule Robot.HallTest do
  use ExUnit.Case, async: true
  alias Robot.Hall
  @moduletag :slow

  # Small samples of what was measured over many seeds: everybody arrives, nobody touches anybody.
  for {n, shape, assign, seeds, limit_s} <- [
        {2, :column, :cost, 1..3, 40},
        {3, :wedge, :chain, 1..3, 40},
        {6, :column, :chain, 1..2, 60},
        {6, :circle, :chain, 1..2, 60},
        {6, :line, :cost, 1..2, 40},
        {12, :wedge, :cost, 1..1, 60},
        {20, :column, :chain, 1..1, 120}
      ] do
    @tag seeds: seeds
    test "#{n} robots form a #{shape} by #{assign}", %{seeds: seeds} do
      for seed <- seeds do
        form = Hall.form(unquote(n), seed, shape: unquote(shape), assign: unquote(assign))

        assert form.formed_s && form.formed_s < unquote(limit_s),
               "seed #{seed}: #{inspect(form.off)}"

        assert {form.contacts, form.min_gap > 0} == {0, true},
               "seed #{seed} #{inspect(form.events)}"

        assert form.error < 0.05
      end
    end
  end

  test "wrecks in the way are gone round" do
    form = Hall.form(6, 5, shape: :line, assign: :cost, dead: 4)
    assert form.formed_s < 60
    assert form.contacts == 0
  end

  test "a column keeps its shape behind a leader that drives" do
    {mean, worst, stood_s, report} = Hall.travel(6, 1, 12, Hal.Twist.new(0.3, 0.05))
    assert mean < 0.05
    assert worst < 0.15
    assert stood_s < 5
    assert report.contacts == 0
  end
end
