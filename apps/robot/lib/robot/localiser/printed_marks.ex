defmodule Robot.Localiser.PrintedMarks do
  @moduledoc """
  Corrects a robot's pose by printed marks whose places it was told (`Robot.Config`, `marks: [known: …]`), and finds it again by
  them. Pure; on a `Robot.Localiser`.

  A mark counts when it was read in three frames in a row. Its range, its bearing and, where it is told, its yaw are measurements
  of the extended Kalman filter `Robot.Localiser.Belief`, each as exact as the reading says and as the place of a mark is known.
  They never make the pose surer than that.

  A mark may hang elsewhere than the robot was told. One that contradicts the belief by more than three standard deviations does
  not correct it. Poses from which it would look like this are kept instead (`Robot.Localiser.PrintedMarks.Hypotheses`), and go
  with the wheels. A robot that is lost, or unsure of its heading by half a radian, takes the place of these as soon as they are one place.
  Any other needs a second mark that fits there, so that no single mark carries it off; a mark that fits the belief ends them.
  """
  alias Hal.Pose
  alias Robot.Localiser.{Belief, Frame, MonteCarlo, PlanFilter, Sightings, Walls}
  alias Robot.Localiser.PrintedMarks.Hypotheses
  alias Robot.Percept
  alias Vision.Mark
  alias Vision.Marks.Streaks

  # How exactly people measure where a mark hangs (metres), and how it is turned (radians). One whose place is vaguer than this finds no
  # robot that is lost.
  @place_sd 0.03
  @turn_sd 0.03
  @vague_place 0.3
  # What the pose is known to is not improved (metres, radians).
  @exact 0.04
  @exact_turn 0.01
  # Pictures that follow one another have errors in common, so that this many count as one.
  @repeated 3
  @gate 9.0
  # Of a heading that is vaguer than this (radians) an arc is no line.
  @vague 0.5
  @near 0.2

  defstruct known: %{}, robots: %{}, streaks: %{}, hypotheses: nil

  @typedoc "Where the marks hang and face, which were read of late, and where the robot may be by those that contradict its belief."
  @type t :: %__MODULE__{
          known: %{Mark.id() => {Pose.t(), sd :: float()}},
          robots: %{Mark.id() => atom()},
          streaks: Streaks.t(),
          hypotheses: Hypotheses.t() | nil
        }

  @doc """
  What a robot is told of marks: `known: [{id, {x, y, heading}}]`, where they hang (metres, radians), as people measure it, or
  `{x, y, heading, sd}` with the standard deviation of the place, and `robots: [{id, name}]`, which robots bear them.

      iex> Robot.Localiser.PrintedMarks.new(known: [{7, {1.0, 2.0, 0.5}}, {8, {0.0, 0.0, 0.0, 0.25}}], size: 0.2).known
      %{7 => {Hal.Pose.new(1.0, 2.0, 0.5), 0.03}, 8 => {Hal.Pose.new(0, 0), 0.25}}
  """
  @spec new(keyword()) :: t()
  def new(marks) do
    known =
      for {id, place} <- marks[:known] || [] do
        {x, y, heading, sd} =
          if tuple_size(place) == 3, do: Tuple.insert_at(place, 3, 0.0), else: place

        {id, {Pose.new(x, y, heading), max(sd * 1.0, @place_sd)}}
      end

    %__MODULE__{known: Map.new(known), robots: Map.new(marks[:robots] || [])}
  end

  @doc "The hypotheses moved by a step of odometry, in the robot's own frame."
  @spec moved(t(), step :: Pose.t()) :: t()
  def moved(%__MODULE__{hypotheses: nil} = printed, _step), do: printed

  def moved(%__MODULE__{hypotheses: hypotheses} = printed, step),
    do: %{printed | hypotheses: Hypotheses.moved(hypotheses, step)}

  @doc "Without hypotheses and streaks: the odometry began again."
  @spec forget(t()) :: t()
  def forget(%__MODULE__{} = printed), do: %{printed | streaks: %{}, hypotheses: nil}

  @doc "The marks that count of a picture, read in it and in the two before, with a range."
  @spec read(t(), Percept.t()) :: {[Mark.t()], t()}
  def read(%__MODULE__{known: known, robots: robots} = printed, _percept)
      when known == %{} and robots == %{},
      do: {[], printed}

  def read(%__MODULE__{} = printed, %Percept{detections: %{marks: marks, at_ms: at_ms}}) do
    {read, streaks} = Streaks.note(printed.streaks, marks, at_ms)
    {for(%{range: range} = mark <- read, range != nil, do: mark), %{printed | streaks: streaks}}
  end

  @doc "Those of the marks that robots bear, by the names of these."
  @spec named(t(), [Mark.t()]) :: %{atom() => Mark.t()}
  def named(%__MODULE__{robots: robots}, read),
    do: for(mark <- read, id = robots[mark.id], into: %{}, do: {id, mark})

  @doc """
  The localiser after the marks of a picture that was taken at the pose `back` relative to the present one. Its belief is corrected
  only if `corrects?`: one that leads would have to move all that follow it.
  """
  @spec see(localiser, [Mark.t()], Percept.t(), back :: Pose.t(), corrects? :: boolean()) ::
          localiser
        when localiser: map()
  def see(%{printed: %{known: known}} = localiser, read, percept, back, corrects?) do
    for mark <- read, is_map_key(known, mark.id), reduce: localiser do
      localiser -> judge(localiser, {mark, known[mark.id]}, {percept, back, corrects?})
    end
  end

  defp judge(%{belief: belief} = localiser, {mark, {at, _sd} = place}, picture) do
    {_percept, back, corrects?} = picture
    exposed = Pose.compose(belief.pose, back)

    cond do
      vague?(localiser) or Pose.distance(exposed, Pose.point(at)) < @near ->
        suspect(localiser, {mark, place}, picture)

      Enum.all?(measurements(belief, exposed, mark, place), &fits?(belief, &1)) ->
        printed = localiser.printed
        localiser = %{localiser | printed: %{printed | hypotheses: nil}}

        if corrects?,
          do: %{localiser | belief: corrected(belief, back, mark, place)},
          else: localiser

      true ->
        suspect(localiser, {mark, place}, picture)
    end
  end

  defp vague?(%{lost?: true}), do: true

  defp vague?(%{belief: belief}) do
    {_worst, _least, heading} = Belief.sd(belief)
    heading > @vague
  end

  defp fits?(belief, {error, slope, noise, _exact}),
    do: error * error <= @gate * (Belief.variance(belief, slope) + noise)

  # One after the other, because the first ones move the belief.
  defp corrected(belief, back, mark, place) do
    count = length(measurements(belief, Pose.compose(belief.pose, back), mark, place))

    Enum.reduce(0..(count - 1), belief, fn k, belief ->
      exposed = Pose.compose(belief.pose, back)
      {error, slope, noise, exact} = measurements(belief, exposed, mark, place) |> Enum.at(k)

      if Belief.variance(belief, slope) > exact * exact,
        do: Belief.measured(belief, error, slope, @repeated * noise),
        else: belief
    end)
  end

  # Innovation, derivatives by x, y and heading, variance of the noise, and how exact it can be: along the line of sight, across it
  # and of the yaw. The robot stands at this distance from the mark, in a direction that it knows as well as its heading, so where
  # the mark is, is a linear function of the position, however vague that is; of the heading it is an arc.
  defp measurements(belief, exposed, mark, {at, sd}) do
    {dx, dy} = {at.x - exposed.x, at.y - exposed.y}
    direction = exposed.heading + mark.bearing
    {ux, uy} = {:math.cos(direction), :math.sin(direction)}
    {along, across} = Sightings.arc(Belief.variance(belief, {0.0, 0.0, 1.0}), mark.range)
    place = sd * sd
    exact = max(@exact, sd)
    aside = mark.range * mark.bearing_sd

    [
      {ux * dx + uy * dy - mark.range, {ux, uy, 0.0},
       mark.range_sd * mark.range_sd + place + along, exact},
      {ux * dy - uy * dx, {-uy, ux, mark.range}, aside * aside + place + across, exact}
    ] ++ yaw(exposed, mark, at)
  end

  defp yaw(_exposed, %{yaw: nil}, _at), do: []

  defp yaw(exposed, %{yaw: yaw, yaw_sd: sd}, at) do
    expected = at.heading + :math.pi() - exposed.heading

    [
      {Pose.wrap(yaw - Pose.wrap(expected)), {0.0, 0.0, -1.0}, sd * sd + @turn_sd * @turn_sd,
       @exact_turn}
    ]
  end

  # The mark is not where it should be seen from here, or nothing is known of where that is.
  defp suspect(localiser, {_mark, {_at, sd}}, _picture) when sd > @vague_place, do: localiser

  defp suspect(%{printed: printed} = localiser, {mark, {at, _sd}}, picture) do
    {percept, back, _corrects?} = picture

    hypotheses =
      case printed.hypotheses do
        nil -> Hypotheses.new(mark, at, back, percept)
        known -> Hypotheses.weighed(known, mark, at, back, weigher(localiser, percept))
      end

    settle(%{localiser | printed: %{printed | hypotheses: hypotheses}}, vague?(localiser))
  end

  defp weigher(%{belief: belief}, percept),
    do: fn poses -> MonteCarlo.likelihoods(percept, belief.pose, poses) end

  defp settle(%{printed: %{hypotheses: nil}} = localiser, _vague?), do: localiser

  defp settle(%{printed: printed} = localiser, vague?) do
    case Hypotheses.place(printed.hypotheses) do
      {pose, variance, marks} when vague? or marks > 1 ->
        belief = PlanFilter.placed(localiser, {pose, variance})

        Frame.renumber(%{
          localiser
          | belief: belief,
            lost?: false,
            walls: %Walls{},
            monte_carlo: nil,
            printed: %{printed | hypotheses: nil}
        })

      _undecided ->
        localiser
    end
  end
end
