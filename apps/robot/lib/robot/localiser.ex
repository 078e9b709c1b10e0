defmodule Robot.Localiser do
  @moduledoc """
  Estimates a robot's pose and its uncertainty: odometry from its start pose, corrected by
  sightings of objects whose places it was given (`Robot.Localiser.Anchors`), or by the walls of a
  floor plan. Pure; the filter is `Robot.Localiser.Belief`, and `Robot.Localiser.Sightings` turns
  pictures into corrections, `Robot.Localiser.Walls` sonar ranges.

  The anchors should come only from the leader and from robots nearer to it in the order, so that
  no robot corrects itself with data that derives from its own pose.

  When odometry begins again in another frame (`Hal.Odometry`), the estimate continues from the
  last estimated pose. The uncertainty grows, because the last decimetres before the stop may not
  have been counted.
  """
  alias Hal.{Odometry, Pose}
  alias Robot.Departure

  alias Robot.Localiser.{
    Anchors,
    Belief,
    Frame,
    History,
    MonteCarlo,
    PlanFilter,
    PrintedMarks,
    RingCheck,
    Sightings,
    TurnCheck,
    Walls
  }

  alias Robot.Localiser.Belief.Marks
  alias Robot.Percept

  # Odometry that begins farther from zero than this (metres, radians) was counting before.
  @put_down 0.1
  # The frame of a leader is that of the plan if its pose is as sure as this (m2, rad2).
  @planned 0.15 * 0.15
  @aligned 0.06 * 0.06
  # So sure must the leader be of its heading for a robot that knows its place in the plan itself (rad2).
  @nearly 0.12 * 0.12
  # A robot that was started again on its way has found its place when it knows it by this (m).
  @found_radius 1.0

  # A robot that is told where it stands believes that if it knows its place less by this factor.
  @less_sure 1.5

  @enforce_keys [:start]
  defstruct @enforce_keys ++
              [
                departed: nil,
                lost?: false,
                odometry: nil,
                odometry_frame: nil,
                belief: nil,
                history: [],
                seen_ms: nil,
                anchors: %Anchors{},
                frame: nil,
                frame_no: nil,
                turn_check: nil,
                ring_check: nil,
                plan?: false,
                walls: %Walls{},
                printed: %PrintedMarks{},
                seed: 0,
                monte_carlo: nil
              ]

  # Frame numbers are sent to other robots, which accept none above half a billion.
  @numbers 400_000_000

  @typedoc """
  `frame` is the frame of the belief, `nil` for that of the start poses. `frame_no` numbers the
  frames that this robot's own poses define for others: it changes when the robot is started, when
  it comes into another frame, and when it gets marks after it had none. `plan?` says that a floor plan corrected it
  before it was led, and was right.
  """
  @type t :: %__MODULE__{
          start: Pose.t(),
          departed: Departure.frame() | nil,
          lost?: boolean(),
          odometry: Pose.t() | nil,
          odometry_frame: reference() | nil,
          belief: Belief.t() | nil,
          history: History.t(),
          seen_ms: integer() | nil,
          anchors: Anchors.t(),
          frame: Anchors.frame() | nil,
          frame_no: non_neg_integer() | nil,
          turn_check: TurnCheck.t(),
          ring_check: RingCheck.t() | nil,
          plan?: boolean(),
          walls: Walls.t(),
          printed: PrintedMarks.t(),
          seed: integer(),
          monte_carlo: MonteCarlo.t() | nil
        }

  @doc """
  The localiser of a robot whose odometry reads zero at the pose `start`. If it has `departed` from there, that is so
  only in this frame of its odometry (`Robot.Departure`); in another one, it could be anywhere. `seed` is that of the
  random numbers with which it looks for its place on a floor plan.
  """
  @spec new(Pose.t(), Departure.frame() | nil, seed :: integer()) :: t()
  def new(%Pose{} = start, departed \\ nil, seed \\ 0),
    do: %__MODULE__{start: start, departed: departed, seed: seed}

  @doc """
  Sets the references from now on. In a new frame, the pose's uncertainty grows by that of the
  leader's own pose, and later by the drift of the leader's odometry.
  """
  @spec anchors(t(), Anchors.t()) :: t()
  def anchors(%{anchors: %{marks: before}} = localiser, %Anchors{frame: frame} = anchors) do
    localiser = localiser |> join(frame) |> Map.put(:anchors, anchors)
    if before == [] and anchors.marks != [], do: Frame.renumber(localiser), else: localiser
  end

  # The frame of the last leader remains valid when no robot leads any more.
  defp join(localiser, nil), do: localiser
  defp join(%{belief: nil} = localiser, _frame), do: localiser

  defp join(%{frame: %{key: key} = known} = localiser, %{key: key} = frame) do
    {way, turn, turned} = known.drift
    {now_way, now_turn, now_turned} = frame.drift

    # The drift decreases only if the leader was started again.
    if now_way >= way and now_turn >= turn and now_turned >= turned do
      belief =
        localiser.belief
        |> Frame.slipped(frame.at, now_turned - turned)
        |> Frame.reframe(frame.at, now_way - way, now_turn - turn)

      %{localiser | frame: frame, belief: belief}
    else
      change(localiser, frame)
    end
  end

  defp join(localiser, frame), do: change(localiser, frame)

  # The marks of the former frame mean nothing in the new one.
  defp change(localiser, frame) do
    {position, heading} = between(localiser.frame, frame)

    # A robot that knows its place in the plan need not turn into the frame of a leader that knows its own there.
    heading = if localiser.plan? and planned?(frame, @nearly), do: 0.0, else: heading

    belief =
      localiser.belief
      |> Marks.forget()
      |> Frame.joined(frame.at, position, heading)
      |> Frame.led(frame.slip)

    Frame.renumber(%{localiser | frame: frame, belief: belief, walls: %Walls{}})
  end

  # The uncertainty between two frames: one may be the base of the other, or both derive from the
  # start poses.
  defp between(nil, frame), do: frame.start
  defp between(%{key: key}, %{base: key} = frame), do: {frame.position, frame.heading}
  defp between(%{base: key} = known, %{key: key}), do: {known.position, known.heading}

  defp between(%{start: {a, b}}, %{start: {position, heading}}),
    do: {a + position, b + heading}

  @doc """
  Moves the estimate by the percept's odometry, corrects it by the percept's detections and, if its
  `grid` is a floor plan, by its sonars, and fills in the percept's `pose` and `uncertainty`, and
  the pose of its detections. Without odometry there is no pose.
  """
  @spec update(t(), Percept.t()) :: {Percept.t(), t()}
  def update(localiser, %Percept{odometry: nil} = percept),
    do: {%{exposed(percept, nil) | pose: nil, uncertainty: nil}, localiser}

  def update(localiser, %Percept{odometry: %Odometry{} = odometry} = percept) do
    localiser =
      localiser
      |> numbered(percept.at_ms)
      |> framed(odometry.frame)
      |> move(odometry.pose)
      |> remember(percept.at_ms)
      |> see(percept)
      |> turn(percept)
      |> hear(percept)
      |> PlanFilter.judged(percept)
      |> told()
      |> found()

    percept = exposed(percept, localiser)
    {%{percept | pose: localiser.belief.pose, uncertainty: uncertainty(localiser)}, localiser}
  end

  # The same error is in all that is told, so it counts only for a robot that knows less.
  defp told(%{anchors: %{told: %{at: at, sd: sd}}, belief: belief} = localiser) do
    {worst, _least, _heading} = Belief.sd(belief)

    if worst > @less_sure * sd,
      do: %{localiser | belief: Belief.placed(belief, at, sd)},
      else: localiser
  end

  defp told(localiser), do: localiser

  defp found(%{lost?: false} = localiser), do: localiser

  defp found(localiser),
    do: %{localiser | lost?: Anchors.radius(PlanFilter.spread(localiser)) > @found_radius}

  defp uncertainty(%{belief: belief, frame: frame, frame_no: number} = localiser) do
    {_worst, _least, heading} = Belief.sd(belief)
    spread = PlanFilter.spread(localiser)
    position = elem(spread, 0)
    {square, turn} = if frame, do: frame.start, else: {0.0, 0.0}

    %{
      radius: Anchors.radius(spread),
      lost?: localiser.lost?,
      place: localiser.monte_carlo && MonteCarlo.told(localiser.monte_carlo),
      position: position,
      spread: spread,
      heading: heading,
      frame: frame && frame.key,
      frame_no: number,
      start: {square + position * position, turn + heading * heading},
      drift: belief.drift,
      slip: Belief.slip_sd(belief)
    }
  end

  # The number begins with the time of the first tick, so that it differs between starts of a robot.
  defp numbered(%{frame_no: nil} = localiser, at_ms),
    do: %{localiser | frame_no: Integer.mod(at_ms, @numbers)}

  defp numbered(localiser, _at_ms), do: localiser

  defp framed(%{odometry_frame: frame} = localiser, frame), do: localiser
  defp framed(%{belief: nil} = localiser, frame), do: %{localiser | odometry_frame: frame}

  # Odometry poses of the former frame are no longer valid.
  defp framed(localiser, frame),
    do: %{
      localiser
      | odometry_frame: frame,
        odometry: nil,
        history: History.new(),
        turn_check: nil,
        ring_check: nil,
        plan?: false,
        walls: %Walls{},
        monte_carlo: nil,
        printed: PrintedMarks.forget(localiser.printed),
        belief: Belief.doubt(localiser.belief)
    }

  defp move(%{odometry: nil, belief: nil} = localiser, odometry) do
    belief = Belief.new(Pose.compose(localiser.start, odometry))
    way = Pose.distance(odometry, {0.0, 0.0})

    localiser = %{localiser | odometry: odometry}

    cond do
      not Departure.start?(localiser.departed, localiser.odometry_frame) ->
        %{localiser | belief: Frame.lost(belief), lost?: true}

      driven?(odometry, way) ->
        %{localiser | belief: Frame.lost(belief, way), lost?: true}

      true ->
        %{localiser | belief: belief}
    end
  end

  defp move(%{odometry: nil} = localiser, odometry), do: %{localiser | odometry: odometry}

  defp move(localiser, odometry) do
    step = Pose.relative(localiser.odometry, odometry)
    belief = Belief.move(localiser.belief, step)
    printed = PrintedMarks.moved(localiser.printed, step)
    %{localiser | odometry: odometry, belief: belief, printed: printed}
  end

  # Every picture counts once. It was taken a moment ago, and the body may have turned since then.
  defp see(localiser, %Percept{detections: nil}), do: localiser
  defp see(%{seen_ms: at_ms} = localiser, %Percept{detections: %{at_ms: at_ms}}), do: localiser

  defp see(localiser, %Percept{detections: %{at_ms: at_ms}} = percept) do
    case History.back(localiser.history, localiser.odometry, at_ms) do
      nil ->
        localiser

      back ->
        localiser = check(localiser, percept, back)
        {read, printed} = PrintedMarks.read(localiser.printed, percept)
        named = PrintedMarks.named(printed, read)
        anchors = localiser.anchors.marks
        belief = Sightings.correct(localiser.belief, anchors, percept, back, named)
        localiser = %{localiser | seen_ms: at_ms, belief: belief, printed: printed}

        # Their places are in the frame of the plan.
        if on_plan?(localiser),
          do: PrintedMarks.see(localiser, read, percept, back, by_walls?(localiser)),
          else: localiser
    end
  end

  # A correction of one that leads, or has led, would have to move all that follow it.
  defp turn(%{anchors: %{walls?: false, standing: nil, frame: nil}} = localiser, _percept),
    do: %{localiser | ring_check: nil}

  defp turn(localiser, percept) do
    {check, belief} = RingCheck.hear(localiser.ring_check, localiser.belief, percept)
    %{localiser | ring_check: check, belief: belief}
  end

  @doc """
  Whether it corrects the pose by the walls of a floor plan, where there is one. That is in the frame of the start poses,
  and in that of a leader that knows where it is in there.
  """
  @spec by_walls?(t()) :: boolean()
  def by_walls?(%__MODULE__{anchors: anchors} = localiser),
    do: anchors.walls? and on_plan?(localiser)

  defp on_plan?(%{frame: frame, plan?: plan?}),
    do: planned?(frame, if(plan?, do: @nearly, else: @aligned))

  # The walls that one faces which was carried away are others.
  defp hear(localiser, percept) do
    carried? = localiser.monte_carlo != nil and MonteCarlo.lost?(localiser.monte_carlo)

    if by_walls?(localiser) and not carried? do
      {walls, belief} = Walls.correct(localiser.walls, localiser.belief, percept)
      kept? = localiser.frame != nil or walls.vague?
      plan? = if kept?, do: localiser.plan?, else: Walls.right?(walls)
      %{localiser | walls: walls, belief: belief, plan?: plan?}
    else
      %{localiser | walls: %Walls{}}
    end
  end

  defp planned?(nil, _aligned), do: true

  defp planned?(%{start: {position, heading}}, aligned),
    do: position <= @planned and heading <= aligned

  # A robot that was never led: no other knows better how it has turned.
  defp check(%{frame: nil, anchors: %{standing: colour}} = localiser, percept, back) do
    %{turn_check: check, belief: belief, odometry: odometry} = localiser
    {check, belief} = TurnCheck.see(check, belief, percept, colour, odometry, back)
    %{localiser | turn_check: check, belief: belief}
  end

  defp check(localiser, _percept, _back), do: %{localiser | turn_check: nil}

  defp remember(localiser, at_ms),
    do: %{localiser | history: History.note(localiser.history, at_ms, localiser.odometry)}

  # Adds the robot's pose at the time of the picture to the detections.
  defp exposed(%Percept{detections: nil} = percept, _localiser), do: percept

  defp exposed(%Percept{detections: %{at_ms: at_ms} = picture} = percept, localiser),
    do: %{percept | detections: %{picture | pose: localiser && pose_at(localiser, at_ms)}}

  defp pose_at(%{belief: belief} = localiser, at_ms) do
    back = History.back(localiser.history, localiser.odometry, at_ms)
    back && Pose.compose(belief.pose, back)
  end

  # Whether the robot was started again on its way: its way there and its corrections are lost.
  defp driven?(%Pose{heading: heading}, way), do: way > @put_down or abs(heading) > @put_down
end
