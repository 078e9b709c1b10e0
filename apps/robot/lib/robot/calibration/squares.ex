defmodule Robot.Calibration.Squares do
  @moduledoc """
  Estimates wheel errors from driven squares: starts with the formulas of UMBmark, then fits the
  whole model of the wheels by least squares. Pure.

  The unknowns are the factor of the base and the wheel ratio. The residuals are the differences
  between the centres of gravity of the return errors, in both directions, and those predicted by
  `Robot.Calibration.Model.predict/4`.
  """
  alias Robot.Calibration.{Model, Umbmark}

  @typedoc """
  The result of squares: the answer of the formulas (`Robot.Calibration.Umbmark`), the fit, the
  greater mean error of the two directions without correction and with the fit (metres), and the
  standard deviations of `base` and `ratio` by the spread of the runs; `nil` with fewer than two
  runs in a direction.
  """
  @type t :: %{
          formulas: Model.t(),
          fit: Model.t(),
          before_m: float(),
          after_m: float(),
          sd: %{base: float(), ratio: float()} | nil
        }

  @small 1.0e-6

  @doc """
  The estimate from squares with sides of `side` metres (by odometry). Options: `wheel_base`, the
  wheel base with which the base calculates (metres), and `distance`, its known distance factor
  (default 1.0). There must be runs in both directions.
  """
  @spec estimate([Model.run()], float(), keyword()) :: {:ok, t()} | {:error, String.t()}
  def estimate(runs, side, options) do
    options = Keyword.validate!(options, [:wheel_base, distance: 1.0])
    {b, distance} = {options[:wheel_base], options[:distance]}

    with {:ok, cw} <- centre(runs, :cw), {:ok, ccw} <- centre(runs, :ccw) do
      {base, ratio} = Umbmark.estimate(cw, ccw, side * distance, b)
      # The formulas assume that the mean size of the wheels is already right.
      formulas = %Model{distance: distance, base: base * distance, ratio: ratio}
      {fit, design} = fit(formulas, cw, ccw, side, b)

      {:ok,
       %{
         formulas: formulas,
         fit: fit,
         before_m: worst(%Model{distance: distance}, cw, ccw, side, b),
         after_m: worst(fit, cw, ccw, side, b),
         sd: deviations(runs, design)
       }}
    end
  end

  defp centre(runs, direction) do
    case for {^direction, error} <- runs, do: error do
      [] ->
        {:error, "no square was driven #{Model.words(direction)}: both ways round are needed"}

      errors ->
        {xs, ys} = Enum.unzip(errors)
        {:ok, {mean(xs), mean(ys)}}
    end
  end

  # Gauss-Newton: two unknowns, four residuals, and a starting point near the solution.
  defp fit(start, cw, ccw, side, b) do
    Enum.reduce(1..6, {start, nil}, fn _round, {wheels, _design} ->
      rest = residuals(wheels, cw, ccw, side, b)
      columns = for key <- [:base, :ratio], do: column(wheels, key, rest, cw, ccw, side, b)
      [by_base, by_ratio] = columns
      {a, c, d} = {dot(by_base, by_base), dot(by_base, by_ratio), dot(by_ratio, by_ratio)}
      {e, f} = {dot(by_base, rest), dot(by_ratio, rest)}
      det = a * d - c * c

      wheels = %{
        wheels
        | base: bounded(wheels.base - (d * e - c * f) / det),
          ratio: bounded(wheels.ratio - (a * f - c * e) / det)
      }

      {wheels, {a / det, d / det}}
    end)
  end

  # Real bases have smaller errors; the bounds keep a step that is too large from leaving the
  # range in which the model can be computed.
  defp bounded(factor), do: factor |> max(0.5) |> min(2.0)

  defp column(wheels, key, rest, cw, ccw, side, b) do
    moved = Map.update!(wheels, key, &(&1 + @small))
    Enum.zip_with(residuals(moved, cw, ccw, side, b), rest, &((&1 - &2) / @small))
  end

  defp residuals(wheels, {xcw, ycw}, {xccw, yccw}, side, b) do
    {px, py} = Model.predict(wheels, :cw, side, b)
    {qx, qy} = Model.predict(wheels, :ccw, side, b)
    [px - xcw, py - ycw, qx - xccw, qy - yccw]
  end

  defp worst(wheels, cw, ccw, side, b) do
    [a, c, d, e] = residuals(wheels, cw, ccw, side, b)
    max(:math.sqrt(a * a + c * c), :math.sqrt(d * d + e * e))
  end

  # The variance of the mean of n runs is that of one run divided by n; base and ratio are taken
  # to be linear in the means.
  defp deviations(runs, {by_ratio, by_base}) do
    groups = runs |> Enum.group_by(&elem(&1, 0), &elem(&1, 1)) |> Map.values()

    if Enum.all?(groups, &(length(&1) >= 2)) do
      variance = groups |> Enum.map(&mean_variance/1) |> mean()
      %{base: :math.sqrt(variance * by_base), ratio: :math.sqrt(variance * by_ratio)}
    end
  end

  defp mean_variance(errors) do
    n = length(errors)
    {xs, ys} = Enum.unzip(errors)
    (spread(xs) + spread(ys)) / (2 * (n - 1) * n)
  end

  defp spread(values) do
    middle = mean(values)
    values |> Enum.map(&((&1 - middle) * (&1 - middle))) |> Enum.sum()
  end

  defp dot(a, b), do: a |> Enum.zip_with(b, &(&1 * &2)) |> Enum.sum()
  defp mean(values), do: Enum.sum(values) / length(values)
end
