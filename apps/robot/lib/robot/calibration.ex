defmodule Robot.Calibration do
  @moduledoc """
  From what a robot's wheels said and what a person measured to what is wrong with its odometry. Pure.

  Three numbers, each 1.0 for wheels that are what the robot takes them for:

  | number | meaning | found by |
  |---|---|---|
  | `distance` | metres truly driven for each metre of odometry | driving straight, `distance/1` |
  | `base` | the true wheel base for each metre of the one that odometry reckons with, all else right | turning, `angle/2`; finer by squares |
  | `ratio` | way of the right wheel for each metre of the left one | squares |

  Squares are those of UMBmark (Borenstein and Feng 1996, `Robot.Calibration.Umbmark`): their
  formulas first; then, since these are of first order (for a base that is off by 2 % they err by up to
  1 %, unless the robot drives all squares again with what they say), least squares with the whole model of
  the wheels (`squares/3`), which begins at the formulas' answer.

  A **run** is what a square gave: the way round, and by how much its true end was off the end that
  odometry told, in the frame of its start (x forward, y left, metres).
  """
  alias Hal.{Pose, Wheels}
  alias Robot.Calibration.Umbmark

  @type direction :: :cw | :ccw
  @type run :: {direction(), {x :: float(), y :: float()}}
  @type t :: %__MODULE__{distance: float(), base: float(), ratio: float()}

  @typedoc """
  Of squares: what `Umbmark` says, the fit, the greatest mean error before and what is left of it with the
  fit (metres), and the standard deviations of `base` and `ratio` as the spread of the runs has it.
  """
  @type squares :: %{
          formulas: t(),
          fit: t(),
          before_m: float(),
          after_m: float(),
          sd: %{base: float(), ratio: float()} | nil
        }

  @typedoc """
  What was driven and measured: `distances` and `angles` as `{by odometry, measured}`, metres (in a straight
  line from start to end) and radians; `runs` are squares with sides of `side` metres by odometry.
  """
  @type measured :: %{
          distances: [{float(), float()}],
          angles: [{float(), float()}],
          runs: [run()],
          side: float()
        }

  defstruct distance: 1.0, base: 1.0, ratio: 1.0

  @steps 12
  @small 1.0e-6

  @doc """
  All of it. What was not measured stays 1.0; squares are more exact than angles, where there are both.
  The second value is what the squares say besides, or `nil`.

  Unequal wheels bend the straight way, so that its ends are nearer to each other than it is long: a
  second round, with the ratio that the first one found, makes up for that.

      iex> measured = %{distances: [{3.0, 3.03}], angles: [], runs: [], side: 4.0}
      iex> {:ok, wheels, nil} = Robot.Calibration.estimate(measured, 0.36)
      iex> {Float.round(wheels.distance, 6), wheels.base, wheels.ratio}
      {1.01, 1.0, 1.0}
  """
  @spec estimate(measured(), wheel_base :: float()) ::
          {:ok, t(), squares() | nil} | {:error, String.t()}
  def estimate(measured, b) do
    with {:ok, first, _squares} <- round(measured, %__MODULE__{}, b),
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
        {:ok, %__MODULE__{distance: distance, base: base}, nil}

      runs ->
        with {:ok, squares} <- squares(runs, measured.side, wheel_base: b, distance: distance),
             do: {:ok, squares.fit, squares}
    end
  end

  # An arc of length s that turns by t has the chord s sin(t / 2) / (t / 2).
  defp unbent(distances, known, b) do
    for {told, chord} <- distances do
      {_way, turn} = true_step({told, 0.0}, known, b)

      if abs(turn) < @small,
        do: {told, chord},
        else: {told, chord * turn / 2 / :math.sin(turn / 2)}
    end
  end

  @doc """
  The distance factor from straight runs, `{by odometry, measured}` in metres, weighed by their
  length.

      iex> Robot.Calibration.distance([{3.0, 3.06}, {3.0, 3.04}]) |> Float.round(4)
      1.0167
  """
  @spec distance([{float(), float()}, ...]) :: float()
  def distance(runs), do: factor(runs)

  @doc """
  The base factor from turns on the spot, `{by odometry, measured}` in radians, with the distance factor:
  a base turns by as much more as its wheels go further, and by as much less as they stand further apart.

      iex> Robot.Calibration.angle([{6.283, 6.283 / 1.02}, {-6.283, -6.283 / 1.02}], 1.0) |> Float.round(4)
      1.02
  """
  @spec angle([{float(), float()}, ...], float()) :: float()
  def angle(turns, distance), do: distance / factor(turns)

  @doc """
  By how much turns to the left go further than turns to the right, each as measured for what odometry told;
  `nil` without both. Wrong wheels turn both ways alike: what differs is slip, as skid-steered
  bases have it, and then squares cannot tell the ratio of the wheels from it.

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

  @doc """
  What squares with sides of `side` metres (by odometry) say, for a base whose wheels stand `wheel_base`
  metres apart in its own arithmetic, and whose distance factor is known. There must be runs of both
  directions.
  """
  @spec squares([run(), ...], float(), keyword()) :: {:ok, squares()} | {:error, String.t()}
  def squares(runs, side, options) do
    options = Keyword.validate!(options, [:wheel_base, distance: 1.0])
    {b, distance} = {options[:wheel_base], options[:distance]}

    with {:ok, cw} <- centre(runs, :cw), {:ok, ccw} <- centre(runs, :ccw) do
      {base, ratio} = Umbmark.estimate(cw, ccw, side * distance, b)
      # Theirs is the base of wheels whose common size is right already.
      formulas = %__MODULE__{distance: distance, base: base * distance, ratio: ratio}
      {fit, design} = fit(formulas, cw, ccw, side, b)

      {:ok,
       %{
         formulas: formulas,
         fit: fit,
         before_m: worst(%__MODULE__{distance: distance}, cw, ccw, side, b),
         after_m: worst(fit, cw, ccw, side, b),
         sd: deviations(runs, design)
       }}
    end
  end

  defp centre(runs, direction) do
    case for {^direction, error} <- runs, do: error do
      [] ->
        {:error, "no square was driven #{words(direction)}: both ways round are needed"}

      errors ->
        {xs, ys} = Enum.unzip(errors)
        {:ok, {mean(xs), mean(ys)}}
    end
  end

  @doc "The way round in words."
  @spec words(direction()) :: String.t()
  def words(:cw), do: "clockwise"
  def words(:ccw), do: "counter-clockwise"

  @doc """
  By how much the true end of a square would be off the one that odometry tells, with these wheels.

      iex> Robot.Calibration.predict(%Robot.Calibration{}, :cw, 4.0, 0.4)
      {0.0, 0.0}
  """
  @spec predict(t(), direction(), float(), float()) :: {float(), float()}
  def predict(%__MODULE__{} = wheels, direction, side, b) do
    quarter = if direction == :cw, do: -:math.pi() / 2, else: :math.pi() / 2
    legs = List.duplicate([{:go, side}, {:turn, quarter}], 4) |> List.flatten()
    {tx, ty} = legs |> follow(wheels, b) |> Pose.point()
    {ox, oy} = legs |> follow(%__MODULE__{}, b) |> Pose.point()
    {tx - ox, ty - oy}
  end

  # In short pieces: the way of unequal wheels is an arc.
  defp follow(legs, wheels, b) do
    for leg <- legs, _piece <- 1..@steps, reduce: Pose.new(0, 0) do
      pose -> drive(pose, true_step(piece(leg), wheels, b))
    end
  end

  defp piece({:go, way}), do: {way / @steps, 0.0}
  defp piece({:turn, turn}), do: {0.0, turn / @steps}

  @doc "What a base with these wheels truly did that says it did `step`."
  @spec true_step(Wheels.step(), t(), float()) :: Wheels.step()
  def true_step(step, %__MODULE__{} = wheels, b) do
    {way, turn} = Wheels.correct(step, b, wheels.ratio)
    {way * wheels.distance, turn * wheels.distance / wheels.base}
  end

  defp drive(pose, {way, turn}) do
    middle = pose.heading + turn / 2

    Pose.new(
      pose.x + way * :math.cos(middle),
      pose.y + way * :math.sin(middle),
      pose.heading + turn
    )
  end

  # Gauss and Newton: two unknowns, four numbers, and a start that is near.
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

  # No base is off by more; a step too far must not lead to where nothing can be reckoned.
  defp bounded(factor), do: factor |> max(0.5) |> min(2.0)

  defp column(wheels, key, rest, cw, ccw, side, b) do
    moved = Map.update!(wheels, key, &(&1 + @small))
    Enum.zip_with(residuals(moved, cw, ccw, side, b), rest, &((&1 - &2) / @small))
  end

  defp residuals(wheels, {xcw, ycw}, {xccw, yccw}, side, b) do
    {px, py} = predict(wheels, :cw, side, b)
    {qx, qy} = predict(wheels, :ccw, side, b)
    [px - xcw, py - ycw, qx - xccw, qy - yccw]
  end

  defp worst(wheels, cw, ccw, side, b) do
    [a, c, d, e] = residuals(wheels, cw, ccw, side, b)
    max(:math.sqrt(a * a + c * c), :math.sqrt(d * d + e * e))
  end

  # The variance of a mean of n runs is that of one by n; base and ratio are linear in the means.
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
