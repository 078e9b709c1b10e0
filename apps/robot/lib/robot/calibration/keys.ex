defmodule Robot.Calibration.Keys do
  @moduledoc """
  Applies a calibration to the conversions of a robot file. Pure.

  With units per metre and radian, a base that goes further than it tells has fewer units a metre, and
  one whose wheels stand wider apart has more of them a radian:
  `distance / d`, `angle * base / d`. The ratio is put behind both (`Hal.Drive.Wheels`), and so for the wheel
  base that odometry reckons with.
  """
  alias Hal.RFlex.Conversions
  alias Robot.Calibration.Model

  @doc """
  The published conversions of a kind, to begin with.

      iex> Robot.Calibration.Keys.published(:magellan)
      [distance: 31387.0, angle: 4654.2]
  """
  @spec published(:magellan | :atrv_mini) :: [distance: float(), angle: float()]
  def published(kind), do: Conversions.published(kind)

  @doc """
  The conversions that a base is to have which was calibrated with these. What was not measured (`found`)
  is left out.

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

  # The drift of unequal wheels is (c_right - c_left) / b: for a b that is not corrected they are corrected by
  # as much less.
  defp effective(%Model{ratio: ratio, base: base}) do
    part = (ratio - 1) / ((ratio + 1) * base)
    (1 + part) / (1 - part)
  end
end
