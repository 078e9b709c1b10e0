defmodule Robot.Calibration do
  @moduledoc """
  Estimates the errors of a robot's odometry from what odometry reported and what a person
  measured. Pure.

  The errors are the three numbers of `Robot.Calibration.Model`: the distance follows from driving
  straight (`distance/1`), the base from turning (`angle/2`) and more exactly from squares, the
  ratio of the wheels from squares.

  Squares are those of UMBmark (Borenstein and Feng 1996, `Robot.Calibration.Umbmark`). Its
  formulas come first. They are of first order: for a base that is off by 2 % they err by up to
  1 %, unless the robot drives all squares again with the corrected values. So a least-squares fit
  of the whole model of the wheels follows (`Robot.Calibration.Squares`), which begins at the
  result of the formulas.
  """
  alias Robot.Calibration.{Model, Squares}

  @typedoc """
  What was driven and measured: `distances` and `angles` as `{by odometry, measured}`, in metres
  (in a straight line from start to end) and radians; `runs` are squares with sides of `side`
  metres by odometry.
  """
  @type measured :: %{
          distances: [{float(), float()}],
          angles: [{float(), float()}],
          runs: [Model.run()],
          side: float()
        }

  @small 1.0e-6

  @doc """
  Estimates the whole model. A number that was not measured stays 1.0; if there are squares, they
  determine the base instead of the angles. The last value is the result of the squares, or `nil`.

  Unequal wheels bend a straight leg, so that its ends are nearer to each other than it is long: a
  second round, with the ratio from the first one, corrects that.

      iex> measured = %{distances: [{3.0, 3.03}], angles: [], runs: [], side: 4.0}
      iex> {:ok, wheels, nil} = Robot.Calibration.estimate(measured, 0.36)
      iex> {Float.round(wheels.distance, 6), wheels.base, wheels.ratio}
      {1.01, 1.0, 1.0}
  """
  @spec estimate(measured(), wheel_base :: float()) ::
          {:ok, Model.t(), Squares.t() | nil} | {:error, String.t()}
  def estimate(measured, b) do
    with {:ok, first, _squares} <- round(measured, %Model{}, b),
         do: round(measured, first, b)
  end

  defp round(measured, known, b) do
    distance =
      with [_ | _] = runs <- unbent(measured.distances, known, b),
           do: distance(runs),
           else: ([] -> 1.0)

    base = with [_ | _] = turns <- measured.angles, do: angle(turns, distance), else: ([] -> 1.0)

    case measured.runs do
      [] ->
        {:ok, %Model{distance: distance, base: base}, nil}

      runs ->
        with {:ok, squares} <-
               Squares.estimate(runs, measured.side, wheel_base: b, distance: distance),
             do: {:ok, squares.fit, squares}
    end
  end

  # An arc of length s that turns by t has the chord s sin(t / 2) / (t / 2).
  defp unbent(distances, known, b) do
    for {told, chord} <- distances do
      {_way, turn} = Model.true_step({told, 0.0}, known, b)

      if abs(turn) < @small,
        do: {told, chord},
        else: {told, chord * turn / 2 / :math.sin(turn / 2)}
    end
  end

  @doc """
  The distance factor from straight runs, `{by odometry, measured}` in metres, weighted by their
  length.

      iex> Robot.Calibration.distance([{3.0, 3.06}, {3.0, 3.04}]) |> Float.round(4)
      1.0167
  """
  @spec distance([{float(), float()}, ...]) :: float()
  def distance(runs), do: factor(runs)

  @doc """
  The base factor from turns on the spot, `{by odometry, measured}` in radians, and the distance
  factor: the true turn grows in proportion to the way of the wheels, and shrinks in proportion to
  their distance from each other.

      iex> Robot.Calibration.angle([{6.283, 6.283 / 1.02}, {-6.283, -6.283 / 1.02}], 1.0) |> Float.round(4)
      1.02
  """
  @spec angle([{float(), float()}, ...], float()) :: float()
  def angle(turns, distance), do: distance / factor(turns)

  @doc """
  By which share turns to the left are larger than turns to the right, each measured relative to
  odometry; `nil` unless there are both. Wheel errors affect both directions alike: a difference
  means slip, as skid-steered bases have it, and then squares cannot distinguish the ratio of the
  wheels from it.

      iex> Robot.Calibration.slip([{6.0, 6.3}, {-6.0, -6.0}]) |> Float.round(3)
      0.05
  """
  @spec slip([{float(), float()}]) :: float() | nil
  def slip(turns) do
    {left, right} = Enum.split_with(turns, fn {told, _measured} -> told > 0 end)
    if left != [] and right != [], do: factor(left) / factor(right) - 1
  end

  defp factor(runs) do
    {told, measured} =
      Enum.reduce(runs, {0.0, 0.0}, fn {told, measured}, {t, m} ->
        {t + abs(told), m + abs(measured)}
      end)

    measured / told
  end
end
