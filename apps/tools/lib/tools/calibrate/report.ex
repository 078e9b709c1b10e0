defmodule Tools.Calibrate.Report do
  @moduledoc "Formats the result of a calibration of odometry for people. Pure."
  alias Console.Cli.Format
  alias Robot.Calibration
  alias Robot.Calibration.{Model, Squares}

  # The accepted standard deviations of the result: half of the errors that are allowed, 0.5 % and
  # 0.2 %.
  @sure %{base: 0.0025, ratio: 0.001}
  @slip 0.015
  # The error of squares that may remain after the correction.
  @left_m 0.15

  @doc "The result, and the measurements that it is based on, as lines of text."
  @spec lines(Model.t(), Squares.t() | nil, Calibration.measured()) :: [String.t()]
  def lines(%Model{} = wheels, squares, measured) do
    found = found(measured)

    Enum.concat([
      if(:distance in found,
        do: ["distance     #{factor(wheels.distance)} of what odometry says"],
        else: []
      ),
      if(:base in found,
        do: ["wheel base   #{factor(wheels.base)} of the known value"],
        else: []
      ),
      if(:ratio in found, do: ["wheel ratio  #{factor(wheels.ratio)} right to left"], else: []),
      squares(squares),
      remarks(squares, measured)
    ])
  end

  @doc """
  The properties of the wheels that these measurements determine.

      iex> Tools.Calibrate.Report.found(%{distances: [{3.0, 3.1}], angles: [], runs: [], side: 4.0})
      [:distance]
  """
  @spec found(Calibration.measured()) :: [:distance | :base | :ratio]
  def found(measured) do
    squares = measured.runs != []

    [
      distance: measured.distances != [],
      base: squares or measured.angles != [],
      ratio: ratio?(squares, measured)
    ]
    |> Enum.filter(&elem(&1, 1))
    |> Keyword.keys()
  end

  # In squares, slip in turns looks like unequal wheels.
  defp ratio?(squares, measured), do: squares and not slips?(measured)

  defp slips?(measured) do
    slip = Calibration.slip(measured.angles)
    slip != nil and abs(slip) > @slip
  end

  @doc """
  Warnings as lines of text: slip, too few squares, or an error that the wheels do not explain.
  """
  @spec remarks(Squares.t() | nil, Calibration.measured()) :: [String.t()]
  def remarks(squares, measured) do
    slip = Calibration.slip(measured.angles)

    [
      slips?(measured) &&
        "turns to the left go #{percent(slip)} further than turns to the right: its wheels slip. Squares " <>
          "cannot distinguish that from unequal wheels, so the wheel ratio stays as it is",
      unsure(squares, length(measured.runs)),
      squares != nil && squares.after_m > @left_m &&
        "#{Format.decimals(squares.after_m, 2)} m of the error are not explained by base and ratio: was one " <>
          "square measured wrongly, or do the wheels slip?"
    ]
    |> Enum.filter(& &1)
  end

  defp unsure(%{sd: %{} = sd}, runs) do
    worst = Enum.max(for {key, most} <- @sure, do: sd[key] / most)

    if worst > 1,
      do:
        "the squares scatter: the wheel base is certain to #{percent(2 * sd.base)}, the ratio to " <>
          "#{percent(2 * sd.ratio)} only; #{ceil(runs / 2 * worst * worst)} squares in each direction would suffice"
  end

  defp unsure(_squares, _runs), do: false

  defp squares(nil), do: []

  defp squares(%{formulas: formulas} = squares) do
    sure =
      if squares.sd,
        do: " (certain to #{percent(2 * squares.sd.base)} and #{percent(2 * squares.sd.ratio)})",
        else: ""

    [
      "squares      end #{Format.decimals(squares.before_m, 3)} m off; " <>
        "#{Format.decimals(squares.after_m, 3)} m with these wheels#{sure}",
      "             UMBmark's formulas alone: base #{factor(formulas.base)}, ratio #{factor(formulas.ratio)}"
    ]
  end

  @doc """
  A factor and its distance from one.

      iex> Tools.Calibrate.Report.factor(1.0123)
      "1.0123 (+1.23 %)"
  """
  @spec factor(float()) :: String.t()
  def factor(value) do
    sign = if value >= 1, do: "+", else: ""
    "#{Format.decimals(value, 4)} (#{sign}#{percent(value - 1)})"
  end

  defp percent(share), do: "#{Format.decimals(100 * share, 2)} %"
end
