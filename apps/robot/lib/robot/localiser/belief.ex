defmodule Robot.Localiser.Belief do
  @moduledoc """
  Estimates a pose and its uncertainty: an extended Kalman filter, moved by odometry and corrected by one
  scalar measurement after another. Pure.

  Its states are x, y and heading, and the systematic errors behind them:

  | state | meaning |
  |---|---|
  | slip | the share by which it turns farther left, and less far right, than by odometry |
  | two scales | the shares by which distances are measured too long: to the landmark, to robots |
  | slip of the leader | the same for the leader of the frame, as far as unknown to the leader |
  | common error | the error shared by the places of all robots ahead (sd 1), never estimated |
  | x, y of each mark | the offset of an object from its reported place |

  `drift` is the uncertainty that dead reckoning alone has added, which matters to robots whose
  poses derive from this one: the variances of its way and of its turns (m2, rad2), and the sum of
  all angles turned so far (radians), because the slip is the same in each of them.

  Because the offsets of marks are states, even a thousand sightings of a mark do not make the
  pose more certain than the place of the mark (Smith, Self and Cheeseman 1990). Robots ahead that
  found their places by each other are not independent: their common error is a state that no
  measurement corrects and whose variance never shrinks (consider filter: Schmidt 1966, Jazwinski
  1970), so that however many of them are seen as blobs, the pose stays at least as uncertain as
  their common error. A pose that was found by their silhouettes counts as independent of it.
  Odometry model: Siegwart and Nourbakhsh 2004. A gate rejects measurements whose innovation is
  larger than three standard deviations (Bar-Shalom, Li and Kirubarajan 2001).
  """
  alias Hal.Pose
  alias Robot.Localiser.{Anchors, Consistency, Covariance}

  # Initial standard deviations of x, y, heading, slip, the scales of the landmark and of robots,
  # the leader's slip, and the common error.
  @slip_sd 0.055
  @start_sd [0.03, 0.03, 0.02, @slip_sd, 0.06, 0.08, 0.0, 1.0]
  @common length(@start_sd) - 1
  # Variances of odometry: per metre driven, of the position (m2, in x and in y) and of the
  # heading (rad2), and per radian turned, of the heading. The sum does not depend on the number
  # of steps in which a way is reported.
  @way_variance 1.0e-5
  @bend_variance 1.0e-5
  @turn_variance 2.5e-4
  # The standard deviation of the change of slip in a radian turned.
  @slip_change 0.005
  @gate 9.0
  # If measurements keep contradicting the estimate, the estimate is doubted: a rejected
  # measurement adds two to a counter, an accepted one subtracts one.
  @doubt 16
  @doubt_sd 0.3
  # The pose is doubted when a counter reaches this: a picture that contradicts the pose as a
  # whole adds one, a consistent one subtracts one.
  @contradictions 6
  # Prevents division by zero for a measurement that does not depend on the position.
  @no_way 1.0e-9

  @enforce_keys [:pose, :covariance]
  defstruct @enforce_keys ++
              [
                slip: 0.0,
                scales: {0.0, 0.0},
                leader_slip: 0.0,
                marks: [],
                uses: 0,
                refused: 0,
                contradicted: 0,
                drift: {0.0, 0.0, 0.0}
              ]

  @typedoc """
  `told` is the reported place, `sd` its standard deviation averaged over all directions, `off`
  the estimated offset of the object from it, `used` the number of its last use.
  """
  @type mark :: %{
          key: term(),
          told: Pose.point(),
          sd: float(),
          off: {float(), float()},
          used: non_neg_integer()
        }
  @type t :: %__MODULE__{
          pose: Pose.t(),
          covariance: Covariance.t(),
          slip: float(),
          scales: {landmark :: float(), robot :: float()},
          leader_slip: float(),
          marks: [mark()],
          uses: non_neg_integer(),
          refused: non_neg_integer(),
          contradicted: non_neg_integer(),
          drift: {way :: float(), turn :: float(), turned :: float()}
        }
  @typedoc "The derivatives of a measurement with respect to x, y and heading, and to the scales."
  @type slope :: {{float(), float(), float()}, {float(), float()}}

  @doc "The belief of a robot that was put down at a pose by hand."
  @spec new(Pose.t()) :: t()
  def new(%Pose{} = pose),
    do: %__MODULE__{pose: pose, covariance: Covariance.diagonal(@start_sd)}

  @doc """
  Standard deviations: of the position, along the direction of its greatest uncertainty and across
  it, in metres; of the heading, in radians.

      iex> Robot.Localiser.Belief.sd(Robot.Localiser.Belief.new(Hal.Pose.new(1, 0)))
      {0.03, 0.03, 0.02}
  """
  @spec sd(t()) :: {worst :: float(), least :: float(), heading :: float()}
  def sd(%__MODULE__{covariance: [_x, _y, [_, _, hh | _] | _]} = belief) do
    {worst, least, _direction} = spread(belief)
    {worst, least, root(hh)}
  end

  @doc """
  Standard deviations of the position, along the direction of its greatest uncertainty and across
  it, in metres, and that direction (radians, in the frame).
  """
  @spec spread(t()) :: Anchors.spread()
  def spread(%__MODULE__{covariance: [[xx, xy | _], [_, yy | _] | _]}),
    do: Anchors.spread({xx, xy, yy})

  defp root(square), do: :math.sqrt(max(square, 0.0))

  @doc """
  The standard deviation of the slip.

      iex> Robot.Localiser.Belief.slip_sd(Robot.Localiser.Belief.new(Hal.Pose.new(1, 0)))
      0.055
  """
  @spec slip_sd(t()) :: float()
  def slip_sd(%__MODULE__{covariance: [_x, _y, _heading, [_, _, _, variance | _] | _]}),
    do: root(variance)

  @doc """
  The belief moved by a step of odometry, given in the robot's own frame.

      iex> belief = Robot.Localiser.Belief.new(Hal.Pose.new(1, 0))
      iex> Robot.Localiser.Belief.move(belief, Hal.Pose.new(0.5, 0)).pose
      Hal.Pose.new(1.5, 0)
  """
  @spec move(t(), step :: Pose.t()) :: t()
  def move(belief, %Pose{x: x, y: y, heading: turn})
      when x == 0.0 and y == 0.0 and turn == 0.0,
      do: belief

  def move(belief, step) do
    angle = abs(step.heading)
    more = belief.slip * angle
    {c, s} = {:math.cos(more / 2), :math.sin(more / 2)}

    slipped = Pose.new(c * step.x - s * step.y, s * step.x + c * step.y, step.heading + more)

    pose = Pose.compose(belief.pose, slipped)
    way = :math.sqrt(step.x * step.x + step.y * step.y)
    along = @way_variance * way
    turned = @turn_variance * angle + @bend_variance * way
    slips = @slip_change * @slip_change * angle

    covariance =
      belief.covariance
      |> Covariance.carry(&motion(&1, belief.pose.y - pose.y, pose.x - belief.pose.x, angle))
      |> Covariance.add([along, along, turned, slips])

    {drift, turn, all} = belief.drift
    drift = {drift + along, turn + turned, all + angle}
    %{belief | pose: pose, covariance: covariance, drift: drift}
  end

  # F = [1 0 a au/2; 0 1 b bu/2; 0 0 1 u; 0 0 0 1]: the way turns with the heading and with half
  # of the slip.
  defp motion([x, y, heading, slip | rest], a, b, u) do
    [
      mix(x, a, heading, a * u / 2, slip),
      mix(y, b, heading, b * u / 2, slip),
      mix(heading, u, slip, 0.0, slip),
      slip | rest
    ]
  end

  defp mix([], _p, [], _q, []), do: []
  defp mix([a | as], p, [b | bs], q, [c | cs]), do: [a + p * b + q * c | mix(as, p, bs, q, cs)]

  @doc """
  The expected error of the heading (radians) for each metre of error of the position in the
  direction of a unit vector, by their covariance.
  """
  @spec turn_along(t(), {float(), float()}) :: float()
  def turn_along(belief, {x, y}) do
    {[_x, _y, turn | _], variance} = Covariance.project(belief.covariance, [x, y])
    if variance > 0.0, do: turn / variance, else: 0.0
  end

  @doc """
  The belief after a measurement, with this standard deviation, that the position is `way` metres
  farther in the direction of a unit vector, relative to robots whose places are off in that
  direction by `common` metres for one standard deviation of the common error.
  """
  @spec shifted(t(), {float(), float()}, way :: float(), sd :: float(), common :: float()) :: t()
  def shifted(belief, {x, y}, way, sd, common) do
    slope = List.replace_at([x, y, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], @common, -common)
    {v, variance} = Covariance.project(belief.covariance, slope)
    s = variance + sd * sd
    believe(belief, v, way / s, reduce(belief.covariance, v, s))
  end

  @doc "The variance of a quantity of the pose with these derivatives by x, y and heading."
  @spec variance(t(), {float(), float(), float()}) :: float()
  def variance(belief, {a, b, c}), do: Covariance.variance(belief.covariance, [a, b, c])

  @doc """
  The variance of a quantity between the pose and the reported place of a mark, without the error
  that both share. It has these derivatives by x, y and heading, and the negative ones of x and y
  by the mark's place.
  """
  @spec variance(t(), {float(), float(), float()}, Anchors.mark()) :: float()
  def variance(belief, {a, b, c}, %{sd: spread, common: {x, y}}) do
    own = Covariance.variance(belief.covariance, [a, b, c])
    shared = Covariance.project_state(belief.covariance, @common, [a, b, c])
    way = max(:math.sqrt(a * a + b * b), @no_way)
    told = way * way * Anchors.variance(spread, {a / way, b / way})
    max(own + told - 2 * (a * x + b * y) * shared, 0.0)
  end

  @doc """
  The belief corrected by one measurement of a mark (`Robot.Localiser.Belief.Marks`): the
  innovation `error` (measured minus expected value), the derivatives of the expected value, and
  the variance of the noise.
  K = P H' / S, x + K e, P - K S K'.
  """
  @spec correct(t(), key :: term(), float(), slope(), noise :: float()) :: t()
  def correct(belief, key, error, {{a, b, c}, {k, l}}, noise) do
    index = Enum.find_index(belief.marks, &(&1.key == key))
    slope = [a, b, c, 0.0, k, l, 0.0, 0.0] ++ List.duplicate(0.0, 2 * index) ++ [-a, -b]
    {v, variance} = Covariance.project(belief.covariance, slope)
    s = variance + noise

    if s <= 0.0 or error * error > @gate * s,
      do: refuse(belief),
      else: believe(belief, v, error / s, reduce(belief.covariance, v, s))
  end

  @doc """
  The belief after a measurement, of this variance, that in turns of a sum of `turned` radians the
  heading has changed by `more` than by odometry.
  """
  @spec turned(t(), more :: float(), turned :: float(), noise :: float()) :: t()
  def turned(belief, more, turned, noise) do
    {v, variance} = Covariance.project(belief.covariance, [0.0, 0.0, 0.0, turned])
    error = more - belief.slip * turned
    s = variance + noise + @turn_variance * turned

    if error * error > @gate * s,
      do: belief,
      else: believe(belief, v, error / s, reduce(belief.covariance, v, s))
  end

  @doc """
  The belief corrected by a measurement of this variance, which has passed a gate: its innovation `error` (measured minus expected
  value), and the derivatives of the expected value by x, y and heading.
  """
  @spec measured(t(), float(), {float(), float(), float()}, noise :: float()) :: t()
  def measured(belief, error, {a, b, c}, noise) do
    {v, variance} = Covariance.project(belief.covariance, [a, b, c])
    s = variance + noise
    believe(belief, v, error / s, reduce(belief.covariance, v, s))
  end

  @doc """
  The belief after it was told that it stands at a place, with this standard deviation, unless that contradicts it.

      iex> lost = Robot.Localiser.Frame.lost(Robot.Localiser.Belief.new(Hal.Pose.new(1, 0)))
      iex> found = Robot.Localiser.Belief.placed(lost, {1.5, 0.25}, 0.1)
      iex> {worst, _least, _heading} = Robot.Localiser.Belief.sd(found)
      iex> {Float.round(found.pose.x, 1), Float.round(worst, 2)}
      {1.5, 0.1}
      iex> Robot.Localiser.Belief.placed(found, {2.5, 0.25}, 0.1) == found
      true
  """
  @spec placed(t(), Pose.point(), sd :: float()) :: t()
  def placed(%{pose: pose} = belief, {x, y}, sd) do
    noise = sd * sd
    [dx, dy] = [x - pose.x, y - pose.y]

    if dx * dx <= @gate * (variance(belief, {1.0, 0.0, 0.0}) + noise) and
         dy * dy <= @gate * (variance(belief, {0.0, 1.0, 0.0}) + noise) do
      belief = measured(belief, dx, {1.0, 0.0, 0.0}, noise)
      measured(belief, y - belief.pose.y, {0.0, 1.0, 0.0}, noise)
    else
      belief
    end
  end

  @doc """
  The belief at a pose that has nothing to do with what it believed: with this variance of x, covariance, variance of y (m2) and of
  the heading (rad2). It has no marks; what it knows of its wheels remains.
  """
  @spec set(t(), Pose.t(), {float(), float(), float(), float()}) :: t()
  def set(%__MODULE__{marks: []} = belief, pose, {xx, xy, yy, hh}) do
    [_x, _y, _heading | rest] = belief.covariance
    others = for [_x, _y, _heading | row] <- rest, do: [0.0, 0.0, 0.0 | row]
    zeros = List.duplicate(0.0, length(rest))
    own = for row <- [[xx, xy, 0.0], [xy, yy, 0.0], [0.0, 0.0, hh]], do: row ++ zeros
    %{belief | pose: pose, covariance: own ++ others, refused: 0, contradicted: 0}
  end

  # The gain of the common error is zero: its covariances shrink, its variance does not.
  defp reduce(covariance, v, s) do
    covariance
    |> Covariance.reduce(v, s)
    |> List.update_at(@common, &List.replace_at(&1, @common, 1.0))
  end

  defp believe(belief, [x, y, heading, slip, k, l, leader, _common | marks], share, covariance) do
    %{pose: pose, scales: {landmark, robot}} = belief

    %{
      belief
      | pose: Pose.new(pose.x + x * share, pose.y + y * share, pose.heading + heading * share),
        slip: belief.slip + slip * share,
        scales: {landmark + k * share, robot + l * share},
        leader_slip: belief.leader_slip + leader * share,
        marks: shift_marks(belief.marks, marks, share),
        covariance: covariance,
        refused: max(belief.refused - 1, 0)
    }
  end

  defp shift_marks([], [], _share), do: []

  defp shift_marks([mark | marks], [x, y | rest], share),
    do: [%{mark | off: shift(mark.off, {x * share, y * share})} | shift_marks(marks, rest, share)]

  defp shift({x, y}, {dx, dy}), do: {x + dx, y + dy}

  # Slipping wheels may cause a larger error than the odometry model allows; then the position
  # must be found again.
  defp refuse(%{refused: refused} = belief) when refused < @doubt,
    do: %{belief | refused: refused + 2}

  defp refuse(belief), do: doubt(belief)

  @doc """
  The belief after the verdict on a whole picture (`Robot.Localiser.Consistency`): if pictures
  keep contradicting the pose, it is doubted.

      iex> belief = Robot.Localiser.Belief.new(Hal.Pose.new(1, 0))
      iex> weigh = fn belief, times, verdict ->
      ...>   Enum.reduce(1..times, belief, fn _, b -> Robot.Localiser.Belief.weigh(b, verdict) end)
      ...> end
      iex> belief = weigh.(belief, 5, :contradicted)
      iex> {first, _, _} = Robot.Localiser.Belief.sd(belief)
      iex> {then, _, _} = belief |> weigh.(1, :contradicted) |> Robot.Localiser.Belief.sd()
      iex> {first, Float.round(then, 3)}
      {0.03, 0.301}
  """
  @spec weigh(t(), Consistency.verdict()) :: t()
  def weigh(belief, :unknown), do: belief

  def weigh(belief, :consistent),
    do: %{belief | contradicted: max(belief.contradicted - 1, 0)}

  def weigh(%__MODULE__{contradicted: count} = belief, :contradicted)
      when count + 1 >= @contradictions,
      do: doubt(%{belief | contradicted: 0})

  def weigh(belief, :contradicted), do: %{belief | contradicted: belief.contradicted + 1}

  @doc """
  The same pose with more uncertainty, by a standard deviation of 0.3 m and 0.3 rad: something
  happened that was not measured.
  """
  @spec doubt(t()) :: t()
  def doubt(%__MODULE__{} = belief) do
    variance = @doubt_sd * @doubt_sd
    {way, turn, all} = belief.drift

    %{
      belief
      | refused: 0,
        drift: {way + variance, turn + variance, all},
        covariance: Covariance.add(belief.covariance, [variance, variance, variance])
    }
  end
end
