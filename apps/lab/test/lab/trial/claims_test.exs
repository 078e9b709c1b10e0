defmodule Lab.Trial.ClaimsTest do
  use Lab.LockstepCase, async: true
  @moduletag :slow
  import Lab.TrialRuns
  alias Lab.Trial
  alias Lab.Trial.Claims

  doctest Claims

  # Ticks `{at_ms, leaders that claim formed, worst true error}`.
  defp play(ticks) do
    Enum.reduce(ticks, %Claims{}, fn {at_ms, leaders, worst}, claims ->
      Claims.note(claims, at_ms, leaders, fn _leader -> worst end)
    end)
  end

  defp report(claims, at_ms, worst), do: Claims.report(claims, at_ms, fn _leader -> worst end)

  test "a claim is judged when it is made and 5 s later, whatever was in between" do
    claims = play([{0, [], 3.0}, {100, [:a], 0.1}, {3000, [:a], 9.0}, {5100, [:a], 0.7}])
    expected = [%{at_s: 0.1, robot: :a, worst_m: 0.1, worst_5s_m: 0.7}]
    assert report(claims, 9000, 4.0) == expected
    assert report(Claims.note(claims, 9000, [], fn _ -> 4.0 end), 9100, 4.0) == expected
  end

  test "a claim that is withdrawn earlier is judged by its beginning, and the next is another claim" do
    claims = play([{0, [:a], 0.1}, {4900, [], 2.0}, {5200, [:a], 0.6}, {5300, [:a, :b], 0.2}])

    assert [{0.1, nil}, {0.6, nil}, {0.2, nil}] =
             for(c <- report(claims, 6000, 1.0), do: {c.worst_m, c.worst_5s_m})
  end

  test "a run that ends 5 s after a claim judges it at its end" do
    claims = play([{0, [:a], 0.1}, {4900, [:a], 0.2}])
    assert [%{worst_5s_m: 0.3}] = report(claims, 5000, 0.3)
  end

  test "a leader without followers has no error to judge" do
    assert [claim] = report(play([{0, [:a], nil}]), 6000, nil)
    assert Claims.right?(claim) == nil
  end

  test "each formed of a run is in its result, with true errors" do
    trial = run(%{seed: 1, kills: [{:leader, 45}]})
    result = Trial.result(trial)
    formed = for %{stage: :formed} = stage <- result.stages, do: {stage.at_s, stage.robot}
    # One before the leader dies, and one after it, at least.
    assert {[_ | _], [_ | _]} = Enum.split_with(formed, fn {at_s, _robot} -> at_s < 45 end)
    assert Enum.map(result.claims, &{&1.at_s, &1.robot}) == formed

    assert Enum.all?(result.claims, &(&1.worst_m < 0.5 and &1.worst_5s_m < 0.5))
    assert List.last(result.claims).worst_5s_m == result.formation.error_max_m
  end
end
