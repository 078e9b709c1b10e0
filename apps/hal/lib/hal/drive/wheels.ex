defmodule Hal.Drive.Wheels do
  @moduledoc """
  Corrects a distance and a turn for the errors of the two wheels. Pure.

  A base that reports its distance and its turn has computed both from its wheels:
  `way = (right + left) / 2`, `turn = (right - left) / base` (Siegwart and Nourbakhsh 2004,
  section 5.2.4). `ratio` is the distance of the right wheel divided by that of the left one when
  the base takes both for equal, the `E_d` of Borenstein and Feng 1996; each wheel is corrected by
  their factors `2 / (E_d + 1)` (left) and `2 / (1 / E_d + 1)` (right), whose mean is 1.
  """

  @typedoc "The distance in metres and the turn in radians of one step."
  @type step :: {way :: float(), turn :: float()}

  @doc """
  Corrects a `step` that the base reports; in the base's own arithmetic its wheels are `base`
  metres apart, and `ratio` is as above.

      iex> Hal.Drive.Wheels.correct({1.0, 0.5}, 0.4, 1.0)
      {1.0, 0.5}
      iex> {way, turn} = Hal.Drive.Wheels.correct({1.0, 0.0}, 0.4, 1.01)
      iex> {Float.round(way, 6), Float.round(turn, 4)}
      {1.0, 0.0249}
  """
  @spec correct(step(), float(), float()) :: step()
  def correct({way, turn}, _base, ratio) when ratio == 1.0, do: {way, turn}

  def correct({way, turn}, base, ratio) do
    {left, right} = factors(ratio)
    left = left * (way - turn * base / 2)
    right = right * (way + turn * base / 2)
    {(left + right) / 2, (right - left) / base}
  end

  @doc """
  The factors of the left and the right wheel.

      iex> Hal.Drive.Wheels.factors(1.0)
      {1.0, 1.0}
  """
  @spec factors(float()) :: {left :: float(), right :: float()}
  def factors(ratio), do: {2 / (ratio + 1), 2 * ratio / (ratio + 1)}
end
