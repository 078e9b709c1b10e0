defmodule Robot.CalibrationTest do
  use ExUnit.Case, async: true
  alias Robot.Calibration
  alias Robot.Calibration.{Drive, Model, Squares, Umbmark}

  doctest Robot.Calibration
  doctest Robot.Calibration.Model
  doctest Robot.Calibration.Umbmark
  doctest Robot.Calibration.Drive

  @b 0.36

  defp squares(wheels, count \\ 1) do
    for direction <- [:cw, :ccw],
        _n <- 1..count,
        do: {direction, Model.predict(wheels, direction, 4.0, @b)}
  end

  test "whatever is wrong with the wheels is found again without noise" do
    for distance <- [0.93, 1.0, 1.07],
        base <- [0.92, 0.98, 1.0, 1.05, 1.1],
        ratio <- [0.97, 1.0, 1.02] do
      wheels = %Model{distance: distance, base: base, ratio: ratio}
      {:ok, found} = Squares.estimate(squares(wheels), 4.0, wheel_base: @b, distance: distance)
      assert_in_delta found.fit.base, base, 1.0e-6
      assert_in_delta found.fit.ratio, ratio, 1.0e-6
      assert found.after_m < 1.0e-6
    end
  end

  test "the formulas alone come near, from errors that are small" do
    for base <- [0.995, 1.005], ratio <- [0.998, 1.002], distance <- [0.99, 1.01] do
      wheels = %Model{distance: distance, base: base * distance, ratio: ratio}
      {:ok, found} = Squares.estimate(squares(wheels), 4.0, wheel_base: @b, distance: distance)
      assert_in_delta found.formulas.base, base * distance, 6.0e-4
      assert_in_delta found.formulas.ratio, ratio, 5.0e-5
    end
  end

  # By hand, to first order, the corners being turned short by e: the legs of a clockwise square head 0,
  # e - pi/2, 2 e - pi, 3 e - 3 pi/2, so that it ends at L (e - 3 e, -2 e) = -2 L e (1, 1).
  test "a base that is wider turns short, to the side and by the amount that the paper has" do
    e = :math.pi() / 2 * (1 - 1 / 1.002)
    {x, y} = Model.predict(%Model{base: 1.002}, :cw, 4.0, @b)
    assert_in_delta x, -8 * e, 3.0e-4
    assert_in_delta y, -8 * e, 3.0e-4
    {mx, my} = Model.predict(%Model{base: 1.002}, :ccw, 4.0, @b)
    assert_in_delta mx, x, 1.0e-9
    assert_in_delta my, -y, 1.0e-9
    {base, ratio} = Umbmark.estimate({x, y}, {mx, my}, 4.0, @b)
    assert_in_delta base, 1.002, 5.0e-5
    assert_in_delta ratio, 1.0, 5.0e-5
  end

  test "both ways round are needed" do
    assert {:error, line} = Squares.estimate([{:cw, {0.1, 0.1}}], 4.0, wheel_base: @b)
    assert line == "no square was driven counter-clockwise: both ways round are needed"
  end

  test "the spread of the runs tells how sure it is" do
    runs = for {d, {x, y}} <- squares(%Model{}, 4), k <- [-1, 1], do: {d, {x + 0.02 * k, y}}
    {:ok, found} = Squares.estimate(runs, 4.0, wheel_base: @b)
    assert found.sd.base > 1.0e-4 and found.sd.base < 2.0e-3
    {:ok, found} = Squares.estimate(squares(%Model{}), 4.0, wheel_base: @b)
    assert found.sd == nil
  end

  test "a way that unequal wheels bend is longer than from end to end" do
    wheels = %Model{distance: 1.02, base: 1.0, ratio: 1.02}
    {_way, turn} = Model.true_step({5.0, 0.0}, wheels, @b)
    chord = 5.0 * 1.02 * :math.sin(turn / 2) / (turn / 2)
    measured = %{distances: [{5.0, chord}], angles: [], runs: squares(wheels), side: 4.0}
    {:ok, found, _squares} = Calibration.estimate(measured, @b)
    assert_in_delta found.distance, 1.02, 1.0e-4
  end

  test "the mission drives its course and stands" do
    assert {:driving, state, effects} = Drive.init(:mag1, legs: [go: 1.0])
    assert {:goal, :course, {Robot.Calibration.DriveCourse, legs: [go: 1.0]}} in effects

    assert {:done, _state, [{:goal, :idle, nil} | _]} =
             Drive.handle({:outcome, :course, 1}, state)

    assert {:blocked, _state, _} = Drive.handle({:outcome, :course, 2}, state)
    assert {:driving, ^state, []} = Drive.handle({:command, :anything}, state)
  end
end
