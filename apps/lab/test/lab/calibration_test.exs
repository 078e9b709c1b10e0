defmodule Lab.CalibrationTest do
  @moduledoc """
  Errors that are put into simulated wheels are found again by what a person would do and measure.
  """
  use Lab.LockstepCase, async: true
  alias Robot.Calibration
  alias Lab.Calibration, as: Simulated
  @moduletag :slow

  @errors [distance: 1.01, base: 1.02, ratio: 1.01]

  defp run(options, count) do
    sim = Simulated.new(options)
    truth = Simulated.truth(sim)
    {:ok, straight, sim} = Simulated.drive(sim, {:distance, 5.0})
    {:ok, left, sim} = Simulated.drive(sim, {:angle, 4 * :math.pi()})
    {:ok, right, sim} = Simulated.drive(sim, {:angle, -4 * :math.pi()})

    {runs, _sim} =
      for(_n <- 1..count, direction <- [:cw, :ccw], do: direction)
      |> Enum.map_reduce(sim, fn direction, sim ->
        {:ok, square, sim} = Simulated.drive(sim, {:square, direction, 4.0})
        %{measured: measured, told: told} = square
        {{direction, {measured.x - told.x, measured.y - told.y}}, sim}
      end)

    measured = %{
      distances: [
        {straight.told.x, :math.sqrt(straight.measured.x ** 2 + straight.measured.y ** 2)}
      ],
      angles: for(turn <- [left, right], do: {turn.told_turn, turn.turn}),
      runs: runs,
      side: 4.0
    }

    {:ok, found, squares} = Calibration.estimate(measured, sim.profile.wheel_base)
    {truth, found, squares, measured}
  end

  defp off(found, truth), do: abs(found / truth - 1)

  for {profile, seeds, tags} <- [
        {:magellan, 1..4, []},
        {:atrv_mini, 21..21, []},
        {:magellan, 5..20, [long: true]},
        {:atrv_mini, 22..24, [long: true]}
      ] do
    @tag tags
    test "5 squares in each direction find base and wheel ratio of the #{profile} for seeds #{inspect(seeds)}" do
      for seed <- unquote(Macro.escape(seeds)) do
        {truth, found, squares, _measured} =
          run([seed: seed, wheels: @errors, profile: apply(Hal.Profile, unquote(profile), [])], 5)

        assert off(found.base, truth.base) < 0.005
        assert off(found.ratio, truth.ratio) < 0.002
        assert off(found.distance, truth.distance) < 0.003
        # UMBmark's own measure of success is a factor of ten or more.
        assert squares.before_m > 5 * squares.after_m
      end
    end
  end

  test "wheels without errors are left alone" do
    {_truth, found, _squares, _measured} = run([noise: :off, tape_m: 0.0, tape_rad: 0.0], 1)
    assert_in_delta found.base, 1.0, 3.0e-4
    assert_in_delta found.ratio, 1.0, 3.0e-5
    assert_in_delta found.distance, 1.0, 3.0e-5
  end

  test "slip in turns is distinguished from wrong wheels" do
    {_truth, _found, _squares, measured} =
      run([noise: :slip, profile: Hal.Profile.atrv_mini(), seed: 3], 1)

    assert Calibration.slip(measured.angles) > 0.05
    {_truth, _found, _squares, measured} = run([wheels: @errors, seed: 3], 1)
    assert abs(Calibration.slip(measured.angles)) < 0.01
  end
end
