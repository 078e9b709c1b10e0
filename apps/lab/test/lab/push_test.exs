defmodule Lab.PushTest do
  @moduledoc "A box that a fleet pushes to a place, judged by true poses, which no robot sees."
  use ExUnit.Case, async: true
  @moduletag :slow
  alias Hal.Pose
  alias Lab.Trial
  alias Sim.World.{Object, Pushing}

  @fleet [:mag1, :mag2, :min1]
  @goal {2.5, 0.0}

  defp trial(options) do
    all = %{robots: @fleet, landmark: :none, blobs: :direct, plan: :known}

    all =
      Map.merge(all, %{boxes: [{-1.5, 0.5, 70}], duration_s: 400, mission: {:push, goal: @goal}})

    {:ok, trial} = Trial.new(Map.merge(all, Map.new(options)))
    trial
  end

  defp box(trial), do: hd(trial.world.objects)
  defp mission(trial, id), do: Swarm.Member.runner(Trial.robot(trial, id)).mission
  defp missions(trial), do: for(id <- Trial.living(trial), do: {id, mission(trial, id)})
  defp pushers(trial), do: for({id, %{phase: :push}} <- missions(trial), do: id)

  # Until it is so, or the seconds are over; what must hold at every tick is asked at each.
  defp until(trial, seconds, done?) do
    Enum.reduce_while(1..(seconds * 10), trial, fn _tick, trial ->
      trial = Trial.step(trial)
      assert length(pushers(trial)) <= 2
      if done?.(trial), do: {:halt, trial}, else: {:cont, trial}
    end)
  end

  for {seed, blobs} <- [{1, :direct}, {3, :painted}] do
    test "two of three robots bring the box to its goal, and the third watches: seed #{seed}, #{blobs}" do
      trial = trial(seed: unquote(seed), blobs: unquote(blobs))
      trial = until(trial, 200, &Trial.formed?/1)
      assert Trial.formed?(trial)
      assert Pose.distance(box(trial).pose, @goal) < 0.6
      assert trial.world.collisions == 0
    end
  end

  test "when one of those that push dies at the box, another takes over" do
    trial = until(trial(seed: 6), 100, &(pushers(&1) != []))
    trial = Enum.reduce(1..80, trial, fn _tick, trial -> Trial.step(trial) end)
    [first | _] = pushers(trial)
    trial = trial |> Trial.kill(first) |> until(300, &Trial.formed?/1)
    assert Trial.formed?(trial)
    assert Pose.distance(box(trial).pose, @goal) < 0.6
    assert trial.world.collisions == 0
  end

  test "a box that a person carries away is found, and brought to its goal" do
    trial = until(trial(seed: 5), 100, &(pushers(&1) != []))
    {:ok, world} = Pushing.place(trial.world, "box1", Pose.new(-3.5, -3.0, 0.0))
    trial = until(%{trial | world: world}, 300, &Trial.formed?/1)
    assert Trial.formed?(trial)
    assert Pose.distance(box(trial).pose, @goal) < 0.6
  end

  test "one robot alone claims nothing, and says that two are needed; without a box they look for it" do
    trial = Enum.reduce(1..600, trial(seed: 2, robots: [:mag1]), fn _, t -> Trial.step(t) end)
    refute Trial.formed?(trial)
    assert elem(Object.gap(box(trial), {-1.5, 0.5, 0.0}), 0) < 0.0
    trial = Enum.reduce(1..300, trial(seed: 2, boxes: []), fn _, t -> Trial.step(t) end)
    refute Trial.formed?(trial)
    for {_id, claim} <- Trial.claims(trial), do: assert(claim.says == "looks for the box")
    assert trial.world.collisions == 0
  end

  test "what holds for every mission holds" do
    assert Lab.MissionCase.problems({:push, goal: {2, 0}},
             trial: [boxes: [{0.5, 1, 45}], landmark: :none]
           ) == []
  end
end
