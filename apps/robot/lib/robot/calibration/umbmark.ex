defmodule Robot.Calibration.Umbmark do
  @moduledoc """
  Computes the formulas of UMBmark. Pure.

  Source: J. Borenstein, L. Feng, "Measurement and Correction of Systematic Odometry Errors in
  Mobile Robots", IEEE Transactions on Robotics and Automation 12(6), 1996. A robot drives a
  square with sides of L metres several times clockwise and as often counter-clockwise, from the
  same mark. The return error of each run is its true end minus its end by odometry; the formulas
  use the centre of gravity of these errors for each direction.

      alpha = (x_cw + x_ccw) / (-4 L)  or  (y_cw - y_ccw) / (-4 L)     radians; the wheel base
      beta  = (x_cw - x_ccw) / (-4 L)  or  (y_cw + y_ccw) / (-4 L)     radians; unequal wheels
      b_new = b (pi / 2) / (pi / 2 - alpha)
      R = (L / 2) / sin(beta / 2),   E_d = (R + b / 2) / (R - b / 2)

  The two formulas of each angle are averaged: each alone has an error of the order of the square
  of the other angle, and the two errors have opposite signs.
  """

  @type centre :: {x :: float(), y :: float()}

  @doc """
  The factor of the wheel base and the wheel ratio E_d, from the centres of gravity of both
  directions.

      iex> Robot.Calibration.Umbmark.estimate({0.0, 0.0}, {0.0, 0.0}, 4.0, 0.4)
      {1.0, 1.0}
      iex> {base, ratio} = Robot.Calibration.Umbmark.estimate({-0.2, -0.2}, {-0.2, 0.2}, 4.0, 0.4)
      iex> {Float.round(base, 4), ratio}
      {1.0162, 1.0}
  """
  @spec estimate(centre(), centre(), side :: float(), wheel_base :: float()) ::
          {base :: float(), ratio :: float()}
  def estimate({xcw, ycw}, {xccw, yccw}, side, b) do
    alpha = (xcw + xccw + ycw - yccw) / (-8 * side)
    beta = (xcw - xccw + ycw + yccw) / (-8 * side)
    quarter = :math.pi() / 2
    {quarter / (quarter - alpha), ratio(beta, side, b)}
  end

  # E_d with numerator and denominator multiplied by 2 sin(beta / 2), which may be zero.
  defp ratio(beta, side, b) do
    bend = b * :math.sin(beta / 2)
    (side + bend) / (side - bend)
  end
end
