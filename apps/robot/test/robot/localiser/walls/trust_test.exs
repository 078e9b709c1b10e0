defmodule Robot.Localiser.Walls.TrustTest do
  use ExUnit.Case, async: true
  doctest Robot.Localiser.Walls.Trust
  alias Robot.Localiser.Walls.Trust

  # Rounds of four readings whose ranges are off by `error` metres.
  defp rounds(trust, count, error, s \\ 0.04) do
    Enum.map_reduce(1..count, trust, fn _, trust ->
      Trust.weigh(trust, 4 * Trust.evidence(error, s), 4 * Trust.evidence(0.0, s))
    end)
  end

  test "trusts a plan until its readings disagree, and then only after more of them agree" do
    {verdicts, trust} = rounds(%Trust{}, 10, 0.1)
    assert Enum.uniq(verdicts) == [:right]

    {verdicts, trust} = rounds(trust, 10, 1.0)
    assert [:unfair | _] = verdicts
    assert List.last(verdicts) == :wrong
    assert Enum.find_index(verdicts, &(&1 == :wrong)) < 5

    {[:wrong, :wrong | _] = verdicts, _trust} = rounds(trust, 30, 0.1)
    assert List.last(verdicts) == :right
  end

  test "a single round that disagrees is left out, and changes nothing" do
    {_verdicts, trust} = rounds(%Trust{}, 10, 0.1)
    assert {[:unfair], trust} = rounds(trust, 1, 1.0)
    assert {[verdict], _trust} = rounds(trust, 1, 0.1)
    assert verdict in [:fair, :right]
  end

  test "what a robot that is unsure of its place hears decides little" do
    {verdicts, _trust} = rounds(%Trust{}, 3, 1.0, 1.0)
    refute :wrong in verdicts
  end

  test "rounds without a wall in sight change nothing" do
    assert {:right, %Trust{}} = Trust.weigh(%Trust{}, 0.0, 0.0)
    assert Trust.weigh(%Trust{}, 0.0, 0.0) == {:right, %Trust{}}
  end
end
