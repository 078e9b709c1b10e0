defmodule Lab.Hardware.WheelsTest do
  @moduledoc "Orders and faults in random order, with a VM and an emulated base: wheels turn only when they may."
  use ExUnit.Case, async: true
  alias Lab.{VmRobots, WheelsRun}
  alias Sim.WheelsModel
  @moduletag :realtime
  @moduletag :tmp_dir
  @moduletag :capture_log

  @steps 5

  # Robots that run side by side, each in a VM of its own, with the seeds that fall to it: so many sequences of each kind
  # of arming.
  defp run(folder, lanes, sequences) do
    lanes =
      for arm <- [:manual, :auto], lane <- 1..lanes do
        id = :"wheels_#{arm}_#{lane}"
        File.mkdir_p!(Path.join(folder, "#{id}"))
        robots = VmRobots.start([{id, arm}], Path.join(folder, "#{id}"))
        {robots, id, arm, for(n <- 1..sequences, rem(n, lanes) == lane - 1, do: n)}
      end

    runs =
      for {robots, id, arm, seeds} <- lanes,
          do: Task.async(fn -> {arm, WheelsRun.run(robots, id, seeds, @steps)} end)

    results = Task.await_many(runs, :infinity)
    violations = for {_arm, violation} <- results, elem(violation, 0) != :ok, do: violation

    counts =
      for {arm, {:ok, counts}} <- results, reduce: %{} do
        all -> Map.update(all, arm, counts, &Map.merge(&1, counts, fn _key, a, b -> a + b end))
      end

    assert {violations, counts} == {[], counts}
    counts
  end

  test "a few sequences", %{tmp_dir: folder} do
    assert %{manual: %{sequences: 3}, auto: %{sequences: 3}} = run(folder, 1, 3)
  end

  @tag long: true, realtime: :long, timeout: 1_800_000
  test "300 sequences of each kind of arming", %{tmp_dir: folder} do
    all = run(folder, 6, 300)

    for {arm, counts} <- all do
      IO.puts("arm: #{arm}: #{inspect(counts)}")
      assert counts.sequences == 300
      # Something was there to be lost.
      assert counts.drove > 100
    end
  end

  test "the model: who may turn when" do
    may? = fn arm, steps ->
      steps
      |> Enum.reduce(WheelsModel.new(arm), fn step, model ->
        WheelsModel.step(model, step, :ok)
      end)
      |> WheelsModel.may_turn?()
    end

    for arm <- [:manual, :auto] do
      assert may?.(arm, [:arm, :drive])
      refute may?.(arm, [:arm])

      for fault <- [{:freeze, 300}, {:freeze_program, 300}, {:cut, 300}, :kill_drive] do
        refute may?.(arm, [:arm, :drive, fault])
        refute may?.(arm, [:arm, :drive, fault, :arm])
        assert may?.(arm, [:arm, :drive, fault, :drive]) == (arm == :auto)
        assert may?.(arm, [:arm, :drive, fault, :arm, :drive])
      end

      refute may?.(arm, [:arm, :drive, :estop, :reset])
      refute may?.(arm, [:arm, :drive, :estop, :drive])
      refute may?.(arm, [:arm, :drive, :disarm, :drive])
      refute may?.(arm, [:arm, :drive, :stop])
    end
  end
end
