defmodule Lab.Trial.EvaluationTest do
  @moduledoc "What a scene and a report say about a robot's own estimates."
  use Lab.LockstepCase, async: true
  alias Lab.Trial
  alias Lab.Trial.Evaluation

  # A trial after some seconds, with what its robots claim.
  defp run(seconds, options \\ %{}) do
    {:ok, trial} = Trial.new(Map.merge(%{seed: 1, blobs: :direct}, options))
    trial = trial |> Stream.iterate(&Trial.step/1) |> Enum.at(seconds * 10)
    {trial, Map.new(Trial.claims(trial))}
  end

  # The same trial with other claims.
  defp score(trial, claims) do
    trial
    |> Map.take([:at_ms, :options, :world, :run_log])
    |> Map.merge(%{claims: claims, messages: %{sent: 0, lost: 0}})
  end

  test "each robot's uncertainty is its own estimate, in the scene and in the report" do
    {trial, claims} = run(3)
    scene = Trial.scene(trial)
    assert Enum.all?(scene.robots, &(is_float(&1.uncertainty) and &1.uncertainty >= 0.0))
    assert Enum.all?(scene.robots, &(&1.uncertainty == claims[&1.id].uncertainty))

    for {robot, row} <- Enum.zip(scene.robots, Trial.result(trial).fleet),
        do: assert({row.name, row.uncertainty_m} == {robot.id, robot.uncertainty})
  end

  test "it has an uncertainty without a mission, but not after its death" do
    {trial, _claims} = run(1)
    {trial, _claims} = {trial |> Trial.command(:mag1, {:move, 0.1, 0.0}) |> Trial.step(), nil}
    trial = trial |> Trial.command(:mag1, :stop) |> Trial.kill(:mag2) |> Trial.step()
    by_name = Map.new(Trial.scene(trial).robots, &{&1.id, &1})
    assert %{state: :idle, uncertainty: metres} = by_name.mag1
    assert is_float(metres)
    assert %{alive: false, uncertainty: nil} = by_name.mag2
  end

  test "a robot in its slot that is not sure of it is unsure; a blocked one is blocked" do
    {trial, claims} = run(1)

    state = fn word ->
      follow = %{phase: :follow, in_place: false, unsure: false, blocked: false}
      claims = Map.update!(claims, :mag2, &Map.merge(&1, Map.merge(follow, word)))
      %{robots: robots} = trial |> score(claims) |> Evaluation.scene()
      %{fleet: rows} = trial |> score(claims) |> Evaluation.result()
      state = Enum.find(robots, &(&1.id == :mag2)).state
      assert Enum.find(rows, &(&1.name == :mag2)).state == state
      state
    end

    assert state.(%{}) == :follow
    assert state.(%{unsure: true}) == :unsure
    assert state.(%{in_place: true}) == :in_place
    assert state.(%{blocked: true}) == :blocked
  end
end
