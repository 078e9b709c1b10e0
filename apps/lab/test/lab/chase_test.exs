defmodule Lab.ChaseTest do
  @moduledoc "The chase as a fleet carries it out, judged by true poses, which no robot sees."
  use ExUnit.Case, async: true
  @moduletag :slow
  alias Hal.Pose
  alias Lab.Trial
  alias Missions.Chase.Driver
  alias Sim.World.{Bodies, Object, Pushing}

  @fleet [:mag1, :mag2, :min1, :min2]
  @goal {3.0, 0.0}

  defp trial(options) do
    all = %{robots: @fleet, landmark: :none, blobs: :direct, plan: :known, balls: [{-1, 1}]}
    all = Map.merge(all, %{duration_s: 200, mission: {:chase, goal: @goal}})
    {:ok, trial} = Trial.new(Map.merge(all, Map.new(options)))
    trial
  end

  defp ball(trial), do: hd(trial.world.objects)
  defp mission(trial, id), do: Swarm.Member.runner(Trial.robot(trial, id)).mission
  defp missions(trial), do: for(id <- Trial.living(trial), do: {id, mission(trial, id)})
  defp phases(trial), do: for({_id, mission} <- missions(trial), do: mission.phase)

  defp touching(trial) do
    Enum.count(Bodies.all(trial.world), fn body ->
      elem(Object.gap(ball(trial), Bodies.disc(body)), 0) < 0.01
    end)
  end

  # Until it is so, or the seconds are over; what must hold at every tick is asked at each.
  defp until(trial, seconds, done?) do
    Enum.reduce_while(1..(seconds * 10), trial, fn _tick, trial ->
      trial = Trial.step(trial)
      assert touching(trial) <= 1
      assert Enum.count(phases(trial), &(&1 == :push)) <= 1
      if done?.(trial), do: {:halt, trial}, else: {:cont, trial}
    end)
  end

  defp scored?(trial), do: Trial.formed?(trial)

  for {seed, blobs, loss} <- [{1, :direct, 0.0}, {2, :painted, 0.0}, {3, :direct, 0.2}] do
    test "four robots bring the ball to the goal, one at a time at it: seed #{seed}, #{blobs}, loss #{loss}" do
      trial = trial(seed: unquote(seed), blobs: unquote(blobs), loss: unquote(loss))
      trial = until(trial, 200, &scored?/1)
      assert scored?(trial)
      # What they claim is true, but for what they see it by.
      assert Pose.distance(ball(trial).pose, @goal) < 0.6
      assert trial.world.collisions == 0
    end
  end

  test "when the driver dies, another brings the ball to the goal" do
    trial = until(trial(seed: 4), 60, &(:push in phases(&1)))
    [driver] = for {id, %{phase: :push}} <- missions(trial), do: id
    trial = Trial.kill(trial, driver)

    trial =
      until(trial, 10, fn trial ->
        Enum.any?(missions(trial), fn {_id, m} -> Driver.drives?(m.driver) end)
      end)

    assert [next] = for({id, m} <- missions(trial), Driver.drives?(m.driver), do: id)
    assert next != driver
    trial = until(trial, 150, &scored?/1)
    assert scored?(trial)
    assert trial.world.collisions == 0
  end

  test "a ball that a person carries away is lost, looked for, found, and brought to the goal" do
    trial = until(trial(seed: 5), 60, &(:push in phases(&1)))
    {:ok, world} = Pushing.place(trial.world, "ball1", Pose.new(-5.5, -5.5))
    trial = until(%{trial | world: world}, 200, &scored?/1)
    assert scored?(trial)
    assert Pose.distance(ball(trial).pose, @goal) < 0.6
  end

  test "without a ball they look for it all over, and claim nothing" do
    trial = trial(seed: 6, balls: [])
    trial = Enum.reduce(1..600, trial, fn _tick, trial -> Trial.step(trial) end)
    assert phases(trial) == [:search, :search, :search, :search]
    refute scored?(trial)
    for {_id, claim} <- Trial.claims(trial), do: assert(claim.says == "looks for the ball")
    assert trial.world.collisions == 0
  end

  test "what holds for every mission holds" do
    assert Lab.MissionCase.problems({:chase, goal: {2, 0}},
             trial: [balls: [{0.5, 1}], landmark: :none]
           ) == []
  end
end
