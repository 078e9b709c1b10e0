defmodule Robot.Localiser.PlanFilter do
  @moduledoc false
  # Joins the belief of a robot with the filter of its floor plan (`Robot.Localiser.MonteCarlo`), which goes its own way: what the
  # belief tells the filter, and when the filter's estimate takes the place of the belief. Pure; on a `Robot.Localiser`.
  alias Hal.Pose
  alias Nav.Grid
  alias Robot.Localiser.{Anchors, Belief, Frame, MonteCarlo, Walls}
  alias Robot.Localiser.Belief.Marks
  alias Robot.Percept

  # A belief that is vaguer than this (metres) tells the filter of the plan nothing. One is set by that filter if it contradicts
  # it by so many standard deviations, and more than so many metres, or is vaguer by so much, of its heading beyond so much (rad).
  @hint 1.0
  @contradicts 3.0
  @apart 0.5
  @vaguer 2.5
  @turned 0.12

  @doc "The filter after this tick, and the belief corrected where that contradicts it."
  @spec judged(localiser, Percept.t()) :: localiser when localiser: map()
  def judged(%{monte_carlo: nil} = localiser, %{grid: %Grid{closed?: true}} = percept) do
    filter = MonteCarlo.new(percept, start(localiser), localiser.seed, localiser.lost?)
    %{localiser | monte_carlo: filter}
  end

  def judged(%{monte_carlo: %MonteCarlo{} = before} = localiser, percept) do
    filter = MonteCarlo.update(before, percept, hint(localiser), among(localiser))
    localiser = %{localiser | monte_carlo: filter}

    cond do
      filter.at_ms == before.at_ms -> localiser
      filter.search != nil -> astray(localiser, before, percept)
      true -> agree(localiser, MonteCarlo.estimate(filter, localiser.walls.trust.trusted?))
    end
  end

  def judged(localiser, _percept), do: localiser

  # Where it is among the other robots, as well as it knows.
  defp among(%{monte_carlo: filter, belief: belief, walls: walls}) do
    case MonteCarlo.estimate(filter, walls.trust.trusted?) do
      {pose, _variance} -> pose
      nil -> belief.pose
    end
  end

  # By marks or by other robots it may find its place again, too.
  defp astray(%{lost?: false} = localiser, %{search: %{}}, percept),
    do: judged(%{localiser | monte_carlo: nil}, percept)

  defp astray(localiser, %{search: %{}}, _percept), do: localiser

  defp astray(localiser, _knew, _percept) do
    belief = Frame.lost(localiser.belief)
    %{localiser | belief: belief, lost?: true, plan?: false, walls: %Walls{}}
  end

  # One that the filter contradicts, or knows far better, is set to its estimate at once, also one that leads, with all that follow
  # it: they may stand by its frame for long.
  defp agree(localiser, nil), do: localiser

  defp agree(localiser, {_pose, _variance} = estimate) do
    placed = placed(localiser, estimate)
    {worst, _least, _direction} = spread(localiser, placed)
    {now, _least, _direction} = Belief.spread(placed)
    {_worst, _least, heading} = Belief.sd(localiser.belief)
    {_worst, _least, turn} = Belief.sd(placed)
    off = Pose.distance(placed.pose, localiser.belief.pose)
    vague? = worst > @vaguer * now or (heading > @turned and heading > @vaguer * turn)

    if vague? or
         (off > @apart and off > @contradicts * :math.sqrt(worst * worst + now * now)),
       do: Frame.renumber(%{localiser | belief: placed, lost?: false, walls: %Walls{}}),
       else: localiser
  end

  @doc "A belief at a pose on the plan, with this variance, in the present frame."
  @spec placed(map(), {Pose.t(), MonteCarlo.Modes.variance()}) :: Belief.t()
  def placed(%{belief: belief, frame: frame}, {pose, variance}) do
    belief = belief |> Marks.forget() |> Belief.set(pose, variance)

    if frame,
      do: Frame.joined(belief, frame.at, elem(frame.start, 0), elem(frame.start, 1)),
      else: belief
  end

  # Where it believes to be on the plan.
  defp start(%{belief: belief} = localiser) do
    {worst, _least, heading} = Belief.sd(belief)
    {square, turn} = if localiser.frame, do: localiser.frame.start, else: {0.0, 0.0}
    {belief.pose, {:math.sqrt(worst * worst + square), :math.sqrt(heading * heading + turn)}}
  end

  defp hint(localiser) do
    {_pose, {place_sd, _heading_sd}} = hint = start(localiser)
    if place_sd < @hint, do: hint
  end

  @doc "How sure the robot is of its place, among the robots of its frame."
  @spec spread(map()) :: Anchors.spread()
  def spread(%{anchors: %{frame: nil}, belief: belief}), do: Belief.spread(belief)

  def spread(%{monte_carlo: %MonteCarlo{} = filter} = localiser) do
    estimate = MonteCarlo.estimate(filter, localiser.walls.trust.trusted?)
    spread(localiser, estimate && placed(localiser, estimate))
  end

  def spread(localiser), do: spread(localiser, nil)

  # The filter takes the errors of the robots ahead for less common than they are: at the end of a long column it would be surer of
  # the direction of the column than those at its beginning. What a robot knows by the plan does not swing with them.
  defp spread(%{anchors: %{frame: nil}, belief: belief}, _placed), do: Belief.spread(belief)

  defp spread(%{belief: belief, anchors: %{frame: frame} = anchors}, placed) do
    at = Pose.point(belief.pose)
    spread = Anchors.swung(Belief.spread(belief), at, frame.at, Anchors.direction_sd(anchors))

    if placed,
      do:
        Enum.min_by(
          [spread, beside(Belief.spread(placed), Pose.distance(placed.pose, at))],
          &elem(&1, 0)
        ),
      else: spread
  end

  # That of a place as one of another that is so far from it (metres).
  defp beside({worst, least, direction}, off),
    do: {:math.sqrt(worst * worst + off * off), :math.sqrt(least * least + off * off), direction}
end
