defmodule Robot.Localiser.PrintedMarks.Hypotheses do
  @moduledoc false
  # Keeps poses from which a printed mark would look as it was read, and weighs them by what is read, and heard, later. Pure.
  #
  # A mark that tells where it faces gives one pose with its uncertainty; any other an arc before it, at its range, from each place
  # of which the robot's heading follows by the bearing (mixture Monte Carlo localisation: Thrun, Fox, Burgard and Dellaert 2001).
  # They are spread evenly and not drawn, so no random number is needed.
  alias Hal.Pose
  alias Nav.Grid
  alias Robot.Localiser.MonteCarlo.Modes
  alias Robot.Percept
  alias Vision.Mark

  # A mark is read from up to so far aside of it (radians), and its arc has so many poses to each side.
  @aside 1.3
  @poses 24
  # A yaw is spread over so many deviations to each side.
  @strata 2
  # Standard deviations of what is read, seen from a pose that is one of few: metres and per metre, radians.
  @range_sd 0.05
  @range_share 0.03
  @bearing_sd 0.06
  @yaw_sd 0.06
  # A reading that has nothing to do with the place: as unlikely as one that is three deviations off.
  @stray :math.exp(-4.5)
  # A mark counts again after so much way or turn (metres, radians).
  @moved 0.1
  @turned 0.1
  # Poses that are less likely than the best by this factor are left out.
  @least :math.exp(-8.0)
  # They are one place if they are no farther apart than this (standard deviations in metres, radians).
  @here 0.3
  @heading 0.12
  # A reading fits the place where it is more likely than this.
  @fits :math.exp(-3.0)
  # They are forgotten after so much way (metres).
  @most_way 15.0

  @enforce_keys [:poses, :marks, :last]
  defstruct @enforce_keys ++ [way: 0.0, step: {0.0, 0.0}]

  @typedoc """
  Poses of the robot now with the logarithms of their weights, `marks` the ids that fit, `last` that which was weighed last, `way`
  that since they began (metres), and `step` way and turn since the last weighing.
  """
  @type t :: %__MODULE__{
          poses: [{Pose.t(), float()}],
          marks: [non_neg_integer()],
          last: non_neg_integer(),
          way: float(),
          step: {way :: float(), turn :: float()}
        }

  @doc "The poses from which a mark, which hangs and faces there, looks like this; `nil` if the plan has walls at all of them."
  @spec new(Mark.t(), at :: Pose.t(), back :: Pose.t(), Percept.t()) :: t() | nil
  def new(%Mark{} = mark, %Pose{} = at, back, percept) do
    now = Pose.relative(back, Pose.new(0.0, 0.0))

    poses =
      for {exposed, log} <- before(mark, at),
          pose = Pose.compose(exposed, now),
          floor?(percept.grid, pose),
          do: {pose, log}

    if poses != [], do: %__MODULE__{poses: poses, marks: [mark.id], last: mark.id}
  end

  defp before(%{yaw: nil} = mark, at) do
    for k <- -@poses..@poses//1,
        g = at.heading + k * @aside / @poses,
        do: {from(mark, at, g, g + :math.pi() - mark.bearing), 0.0}
  end

  defp before(mark, at) do
    for k <- -@strata..@strata//1 do
      heading = at.heading + :math.pi() - mark.yaw + k * mark.yaw_sd
      {from(mark, at, heading + mark.bearing + :math.pi(), heading), -k * k / 2}
    end
  end

  defp from(mark, at, direction, heading),
    do:
      Pose.new(
        at.x + mark.range * :math.cos(direction),
        at.y + mark.range * :math.sin(direction),
        heading
      )

  defp floor?(%Grid{closed?: true} = grid, pose),
    do: Grid.clearance(grid, Pose.point(pose)) > 0.0

  defp floor?(_no_plan, _pose), do: true

  @doc "All of them after a step of odometry."
  @spec moved(t(), step :: Pose.t()) :: t() | nil
  def moved(%__MODULE__{way: way}, _step) when way > @most_way, do: nil

  def moved(%__MODULE__{step: {since, turned}} = hypotheses, step) do
    way = :math.sqrt(step.x * step.x + step.y * step.y)

    %{
      hypotheses
      | poses: for({pose, log} <- hypotheses.poses, do: {Pose.compose(pose, step), log}),
        way: hypotheses.way + way,
        step: {since + way, turned + abs(step.heading)}
    }
  end

  @doc """
  Weighed by the reading of a mark that hangs and faces there, unless the same was weighed just before; and by `heard`, a function
  from poses to logarithms of likelihoods. Begun anew by that mark if it fits nowhere.
  """
  @spec weighed(
          t(),
          Mark.t(),
          at :: Pose.t(),
          back :: Pose.t(),
          heard :: ([Pose.t()] -> [float()])
        ) ::
          t() | nil
  def weighed(%__MODULE__{last: last, step: {way, turn}} = known, %{id: id}, _at, _back, _heard)
      when last == id and way < @moved and turn < @turned,
      do: known

  def weighed(%__MODULE__{} = hypotheses, mark, at, back, heard) do
    {poses, logs} = Enum.unzip(hypotheses.poses)
    read = for pose <- poses, do: read(Pose.compose(pose, back), mark, at)
    best = Enum.max(read)

    weighed =
      for {pose, log, seen, ranges} <- zip(poses, logs, read, heard.(poses)),
          do: {pose, log + :math.log(seen) + ranges}

    most = weighed |> Enum.map(&elem(&1, 1)) |> Enum.max()
    likely = for {pose, log} <- weighed, log - most > :math.log(@least), do: {pose, log - most}
    marks = if best > @fits, do: Enum.uniq([mark.id | hypotheses.marks]), else: hypotheses.marks
    %{hypotheses | poses: likely, marks: marks, last: mark.id, step: {0.0, 0.0}}
  end

  defp zip(a, b, c, d),
    do:
      Enum.zip(Enum.zip(a, b), Enum.zip(c, d))
      |> Enum.map(fn {{a, b}, {c, d}} -> {a, b, c, d} end)

  # How likely a reading is from a pose.
  defp read(exposed, mark, at) do
    {dx, dy} = {at.x - exposed.x, at.y - exposed.y}
    distance = :math.sqrt(dx * dx + dy * dy)
    range = (mark.range - distance) / (@range_sd + @range_share * distance)
    bearing = Pose.wrap(mark.bearing - (:math.atan2(dy, dx) - exposed.heading)) / @bearing_sd
    faces = Pose.wrap(:math.atan2(-dy, -dx) - at.heading)

    yaw =
      if mark.yaw,
        do: Pose.wrap(mark.yaw - (at.heading + :math.pi() - exposed.heading)) / @yaw_sd,
        else: 0.0

    if abs(faces) > :math.pi() / 2,
      do: @stray,
      else: max(:math.exp(-(range * range + bearing * bearing + yaw * yaw) / 2), @stray)
  end

  @doc "The place of them all, its variance, and how many marks fit there; `nil` as long as they are several places."
  @spec place(t()) :: {Pose.t(), Modes.variance(), marks :: pos_integer()} | nil
  def place(%__MODULE__{poses: [{first, _log} | _] = poses, marks: marks}) do
    weights = for {_pose, log} <- poses, do: :math.exp(log)
    total = Enum.sum(weights)
    mean = fn value -> Enum.zip(poses, weights) |> mean(value, total) end
    x = mean.(& &1.x)
    y = mean.(& &1.y)
    turn = mean.(&Pose.wrap(&1.heading - first.heading))
    xx = mean.(&((&1.x - x) * (&1.x - x)))
    yy = mean.(&((&1.y - y) * (&1.y - y)))
    hh = mean.(fn pose -> square(Pose.wrap(pose.heading - first.heading) - turn) end)

    if xx + yy <= @here * @here and hh <= @heading * @heading do
      noise = @range_sd * @range_sd
      pose = Pose.new(x, y, first.heading + turn)
      {pose, {xx + noise, 0.0, yy + noise, hh + @bearing_sd * @bearing_sd}, length(marks)}
    end
  end

  defp mean(weighed, value, total),
    do: Enum.reduce(weighed, 0.0, fn {{pose, _log}, w}, sum -> sum + w * value.(pose) end) / total

  defp square(x), do: x * x
end
