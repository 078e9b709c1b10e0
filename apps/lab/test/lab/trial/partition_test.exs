defmodule Lab.Trial.PartitionTest do
  @moduledoc "Whole missions in lockstep while the radio is cut and mended."
  use Lab.LockstepCase, async: true
  import Lab.TrialRuns
  alias Lab.Trial
  alias Lab.Trial.{AgreementMetrics, Cuts, RunLog}
  @moduletag :slow

  @left [:mag1, :min2, :mag3]
  @right [:mag2, :min1, :min3]

  defp elections(result), do: Enum.count(result.stages, &(&1.stage == :elected))

  test "cut into two and mended, there is one leader a part, then one for all, and a short stand" do
    for {seed, loss} <- [{1, 0.0}, {3, 0.1}] do
      result = run(%{seed: seed, loss: loss, cuts: [{40, 55, [@left, @right]}]}) |> Trial.result()
      assert %{rivals_max_s: rivals, heals: [heal]} = result.agreement
      assert rivals <= 1.5
      assert heal.leaders == 2
      assert heal.one_leader_s <= 2.0 and heal.formed_s <= 10.0 and heal.stood_s <= 1.0
      assert result.leaders_at_once_max <= 2 and result.collisions == 0
    end
  end

  test "with the link from the leader to its child cut for good, formation and leader stay" do
    {:ok, trial} = Trial.new(%{seed: 1, blobs: :direct})
    trial = until(trial, &Trial.formed?/1)
    {leader, %{anchor: anchor}} = Enum.find(Trial.claims(trial), &(elem(&1, 1).phase == :lead))
    from_s = trial.at_ms / 1000 + 1
    cuts = [{from_s, :end, {:link, leader, hd(anchor.order)}}]
    move = {{2.0, 2.0}, from_s + 5}
    result = run(%{seed: 1, cuts: cuts, moves: [move]}) |> Trial.result()
    assert elections(result) == 1
    assert result.leader == leader
    assert result.agreement.rivals_max_s == 0.0
    assert List.last(result.stages).stage == :formed
    assert result.formation.error_max_m < 0.35
  end

  test "by majority neither half of six leads, and all go on when it is mended" do
    {:ok, trial} =
      Trial.new(%{
        seed: 1,
        blobs: :direct,
        policy: :majority,
        cuts: [{40, 55, [@left, @right]}]
      })

    trial = until(trial, &(&1.at_ms >= 45_000))
    assert Enum.uniq(for {_id, claim} <- Trial.claims(trial), do: claim.phase) == [:wait]
    result = trial |> to_the_end() |> Trial.result()
    assert [%{leaders: 0, one_leader_s: one_s}] = result.agreement.heals
    assert one_s <= 3.0
    assert result.leaders_at_once_max == 1
    assert List.last(result.stages).stage == :formed
  end

  test "a robot that is cut off alone stands, and takes its place again later" do
    {:ok, trial} =
      Trial.new(%{
        seed: 1,
        blobs: :direct,
        cuts: [{40, 50, [[:mag1, :mag2, :min1, :min2, :min3]]}]
      })

    trial = until(trial, &(&1.at_ms >= 44_000))
    assert Map.new(Trial.claims(trial)).mag3.phase == :halt
    before = Sim.World.truth(trial.world, :mag3)
    trial = until(trial, &(&1.at_ms >= 49_000))
    assert Sim.World.truth(trial.world, :mag3) == before
    result = trial |> to_the_end() |> Trial.result()
    assert elections(result) == 1
    assert [%{one_leader_s: one_s, formed_s: formed_s}] = result.agreement.heals
    assert one_s <= 2.0 and formed_s <= 10.0
  end

  test "an invalid cut is refused in one line" do
    for cuts <- [
          :all,
          [{1, 2}],
          [{2, 1, [[:mag1]]}],
          [{1, 2, {:link, :mag1, :mag1}}],
          [{1, 2, {:link, :mag1, :mag9}}],
          [{1, 2, [[:mag1, :mag9]]}],
          [{1, 2, []}],
          [{1, 2, [:mag1 | :mag2]}]
        ] do
      assert {:error, line} = Trial.new(%{cuts: cuts})
      assert line =~ "cuts: expected" and not (line =~ "\n")
    end
  end

  test "cuts that overlap add up, and one direction stays one direction" do
    cuts = [{0, 4, {:link, :a, :b}}, {2, :end, {:way, :c, :a}}]
    assert Cuts.ways(cuts, [:a, :b, :c], 1_000) == [a: :b, b: :a]
    assert Cuts.ways(cuts, [:a, :b, :c], 3_000) == [a: :b, b: :a, c: :a]
    assert Cuts.ways(cuts, [:a, :b, :c], 9_000) == [c: :a]
    assert Cuts.healed_ms(cuts) == [4_000]
  end

  test "two that lead in one part are counted for as long as they do, and only there" do
    lead = fn ids ->
      for id <- [:a, :b], do: {id, %{role: if(id in ids, do: :leads, else: :follows)}}
    end

    agreement =
      [
        {[:a, :b], [[:a], [:b]]},
        {[:a, :b], [[:a, :b]]},
        {[:a, :b], [[:a, :b]]},
        {[:a], [[:a, :b]]}
      ]
      |> Enum.with_index()
      |> Enum.reduce(%AgreementMetrics{}, fn {{leaders, parts}, n}, agreement ->
        claims = lead.(leaders)
        AgreementMetrics.note(agreement, n * 100, claims, RunLog.leaders(claims, parts), [])
      end)

    assert AgreementMetrics.report(agreement).rivals_max_s == 0.2
  end
end
