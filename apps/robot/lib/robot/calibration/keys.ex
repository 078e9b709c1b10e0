defmodule Robot.Calibration.Keys do
  @moduledoc """
  Applies a calibration to the conversions of a robot file. Pure.

  The conversions are units per metre and per radian. A base that drives farther than it reports
  has fewer units per metre, and one whose wheels are farther apart has more units per radian:
  `distance / d`, `angle * base / d`. The wheel ratio is applied after both (`Hal.Drive.Wheels`),
  and therefore refers to the wheel base with which odometry calculates.
  """
  alias Hal.RFlex.Conversions
  alias Robot.Calibration.Model

  @doc """
  The published conversions of a body with such an rFLEX controller (`rflex` of `Hal.Profile`), as a starting point.

      iex> Robot.Calibration.Keys.published(:magellan)
      [distance: 31387.0, angle: 4654.2]
  """
  @spec published(:magellan | :atrv_mini | nil) :: [{:distance | :angle, float()}]
  def published(rflex), do: Conversions.published(rflex)

  @doc """
  The new conversions of a base that was calibrated with these. `found` lists what was measured;
  keys that do not depend on it are left out.

      iex> wheels = %Robot.Calibration.Model{distance: 0.5, base: 1.02, ratio: 1.01}
      iex> Robot.Calibration.Keys.new([distance: 1000.0, angle: 500.0], wheels, [:distance, :base])
      [distance: 2000.0, angle: 1020.0]
  """
  @spec new(keyword(), Model.t(), [:distance | :base | :ratio]) :: keyword(float())
  def new(conversions, %Model{} = wheels, found) do
    distance = conversions[:distance] / wheels.distance
    angle = conversions[:angle] * wheels.base / wheels.distance
    ratio = (conversions[:wheel_ratio] || 1.0) * effective(wheels)

    if(:distance in found, do: [distance: Float.round(distance, 2)], else: []) ++
      if(:distance in found or :base in found, do: [angle: Float.round(angle, 3)], else: []) ++
      if(:ratio in found, do: [wheel_ratio: Float.round(ratio, 5)], else: [])
  end

  # The drift of unequal wheels is (c_right - c_left) / b. Because b is not corrected here, the
  # difference of the wheels is reduced by the same factor.
  defp effective(%Model{ratio: ratio, base: base}) do
    part = (ratio - 1) / ((ratio + 1) * base)
    (1 + part) / (1 - part)
  end
end
