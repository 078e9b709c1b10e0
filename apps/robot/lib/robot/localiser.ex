defmodule Robot.Localiser do
  @moduledoc """
  Where a robot is, and how sure that is: odometry from its start pose, corrected by sightings of
  objects whose places it was told (`Robot.Localiser.Anchors`). Pure; the filter is
  `Robot.Localiser.Belief`, and `Robot.Localiser.Sightings` turns pictures into corrections.

  Corrections run one way, from the leader down, so that no robot ever corrects itself by its own echo.

  Odometry that begins again in another frame (`Hal.Odometry`) moves the robot nowhere: it goes on from
  where it was believed to be. The few decimetres of its stop that nobody counted are doubted.
  """
  alias Hal.{Odometry, Pose}
  alias Robot.Localiser.{Anchors, Belief, Frame, History, Sightings}
  alias Robot.Percept

  # Odometry that begins farther from zero than this (metres, radians) has counted before.
  @put_down 0.1

  @enforce_keys [:start]
  defstruct @enforce_keys ++
              [
                odometry: nil,
                odometry_frame: nil,
                belief: nil,
                history: [],
                seen_ms: nil,
                anchors: %Anchors{},
                frame: nil,
                frame_no: nil
              ]

  # Numbers of frames are told to others, who take none above half a billion.
  @numbers 400_000_000

  @typedoc """
  `frame` is the one that the belief is in: `nil` for that of the start poses. `frame_no` numbers the frames that this robot's
  own poses make for others: another one each time that it was started, that it came into another's frame, or began to be
  corrected anew.
  """
  @type t :: %__MODULE__{
          start: Pose.t(),
          odometry: Pose.t() | nil,
          odometry_frame: reference() | nil,
          belief: Belief.t() | nil,
          history: History.t(),
          seen_ms: integer() | nil,
          anchors: Anchors.t(),
          frame: Anchors.frame() | nil,
          frame_no: non_neg_integer() | nil
        }

  @doc "A robot that was switched on at `start`, where its odometry said zero."
  @spec new(Pose.t()) :: t()
  def new(%Pose{} = start), do: %__MODULE__{start: start}

  @doc """
  What to find the pose by from now on. In a frame that is new to it the robot is as much less sure as that
  frame's robot is unsure of its own pose, and then by what that robot's odometry drifts.
  """
  @spec anchors(t(), Anchors.t()) :: t()
  def anchors(%{anchors: %{marks: before}} = localiser, %Anchors{frame: frame} = anchors) do
    localiser = localiser |> join(frame) |> Map.put(:anchors, anchors)
    if before == [] and anchors.marks != [], do: renumber(localiser), else: localiser
  end

  # The first tick's time tells one start of a robot from another.
  defp renumber(%{frame_no: nil} = localiser), do: localiser
  defp renumber(%{frame_no: number} = localiser), do: %{localiser | frame_no: number + 1}

  # Where a leader is believed to be stays true when nobody leads any more.
  defp join(localiser, nil), do: localiser
  defp join(%{belief: nil} = localiser, _frame), do: localiser

  defp join(%{frame: %{key: key} = known} = localiser, %{key: key} = frame) do
    {way, turn, turned} = known.drift
    {now_way, now_turn, now_turned} = frame.drift

    # Less drift than before has only a robot that was started anew.
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

  # Where things are in the other frame has still to be seen.
  defp change(localiser, frame) do
    {position, heading} = between(localiser.frame, frame)

    belief =
      localiser.belief
      |> Belief.forget()
      |> Frame.reframe(frame.at, position, heading)
      |> Frame.led(frame.slip)

    renumber(%{localiser | frame: frame, belief: belief})
  end

  # What nobody knows of one frame in another: one may have begun in the other, or both in the start poses.
  defp between(nil, frame), do: frame.start
  defp between(%{key: key}, %{base: key} = frame), do: {frame.position, frame.heading}
  defp between(%{base: key} = known, %{key: key}), do: {known.position, known.heading}

  defp between(%{start: {a, b}}, %{start: {position, heading}}),
    do: {a + position, b + heading}

  @doc """
  Moves the estimate by the percept's odometry, corrects it by the percept's detections, and fills in the percept's
  `pose` and `uncertainty`, and the pose of its detections. Without odometry there is no pose.
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

    percept = exposed(percept, localiser)
    {%{percept | pose: localiser.belief.pose, uncertainty: uncertainty(localiser)}, localiser}
  end

  defp uncertainty(%{belief: belief, frame: frame, frame_no: number}) do
    {position, _across, heading} = Belief.sd(belief)
    {square, turn} = if frame, do: frame.start, else: {0.0, 0.0}

    %{
      radius: Belief.radius(belief),
      position: position,
      spread: Belief.spread(belief),
      heading: heading,
      frame: frame && frame.key,
      frame_no: number,
      start: {square + position * position, turn + heading * heading},
      drift: belief.drift,
      slip: Belief.slip_sd(belief)
    }
  end

  defp numbered(%{frame_no: nil} = localiser, at_ms),
    do: %{localiser | frame_no: Integer.mod(at_ms, @numbers)}

  defp numbered(localiser, _at_ms), do: localiser

  defp framed(%{odometry_frame: frame} = localiser, frame), do: localiser
  defp framed(%{belief: nil} = localiser, frame), do: %{localiser | odometry_frame: frame}

  # Poses of the frame before mean nothing any more.
  defp framed(localiser, frame),
    do: %{
      localiser
      | odometry_frame: frame,
        odometry: nil,
        history: History.new(),
        belief: Belief.doubt(localiser.belief)
    }

  defp move(%{odometry: nil, belief: nil} = localiser, odometry) do
    belief = Belief.new(Pose.compose(localiser.start, odometry))
    way = Pose.distance(odometry, {0.0, 0.0})
    belief = if driven?(odometry, way), do: Frame.lost(belief, way), else: belief
    %{localiser | odometry: odometry, belief: belief}
  end

  defp move(%{odometry: nil} = localiser, odometry), do: %{localiser | odometry: odometry}

  defp move(localiser, odometry) do
    step = Pose.relative(localiser.odometry, odometry)
    %{localiser | odometry: odometry, belief: Belief.move(localiser.belief, step)}
  end

  # Every picture counts once. It was taken a moment ago, and the body may have turned since.
  defp see(localiser, %Percept{detections: nil}), do: localiser
  defp see(%{seen_ms: at_ms} = localiser, %Percept{detections: %{at_ms: at_ms}}), do: localiser

  defp see(localiser, %Percept{detections: %{at_ms: at_ms}} = percept) do
    case History.back(localiser.history, localiser.odometry, at_ms) do
      nil ->
        localiser

      back ->
        belief = Sightings.correct(localiser.belief, localiser.anchors.marks, percept, back)
        %{localiser | seen_ms: at_ms, belief: belief}
    end
  end

  defp remember(localiser, at_ms),
    do: %{localiser | history: History.note(localiser.history, at_ms, localiser.odometry)}

  # Where the robot stood when the picture was taken.
  defp exposed(%Percept{detections: nil} = percept, _localiser), do: percept

  defp exposed(%Percept{detections: %{at_ms: at_ms} = picture} = percept, localiser),
    do: %{percept | detections: %{picture | pose: localiser && pose_at(localiser, at_ms)}}

  defp pose_at(%{belief: belief} = localiser, at_ms) do
    back = History.back(localiser.history, localiser.odometry, at_ms)
    back && Pose.compose(belief.pose, back)
  end

  # It was started anew in the middle of its way: how it came there, and what corrected it, nobody knows any more.
  defp driven?(%Pose{heading: heading}, way), do: way > @put_down or abs(heading) > @put_down
end
