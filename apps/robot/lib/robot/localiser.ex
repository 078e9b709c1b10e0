defmodule Robot.Localiser do
  @moduledoc """
  Where a robot is, and how sure that is: odometry from its start pose, corrected by what it sees of things whose
  places it was told (`Robot.Localiser.Anchors`). Pure; the filter is `Robot.Localiser.Belief`, what it is told of
  pictures is the matter of `Robot.Localiser.Sightings`.

  Corrections run one way, from the leader down, so that no robot ever corrects itself by its own echo.

  Odometry that begins again in another frame (`Hal.Odometry`) moves the robot nowhere: it goes on from
  where it was believed to be. The few decimetres of its stop that nobody counted are doubted.
  """
  alias Hal.{Odometry, Pose}
  alias Robot.Localiser.{Anchors, Belief, History, Sightings}
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
                joins: 0
              ]

  @typedoc """
  `frame` is the one that the belief is in: `nil` for that of the start poses. `joins` counts how often it came into
  another.
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
          joins: non_neg_integer()
        }

  @doc "A robot that was switched on at `start`, where its odometry said zero."
  @spec new(Pose.t()) :: t()
  def new(%Pose{} = start), do: %__MODULE__{start: start}

  @doc """
  What to find the pose by from now on. In a frame that is new to it the robot is as much less sure as that
  frame's robot is unsure of its own pose, and then by what that robot's odometry drifts.
  """
  @spec anchors(t(), Anchors.t()) :: t()
  def anchors(localiser, %Anchors{frame: frame, marks: marks} = anchors) do
    localiser = localiser |> join(frame) |> Map.put(:anchors, anchors)

    if marks == [] and localiser.belief != nil,
      do: %{localiser | belief: Belief.forget(localiser.belief)},
      else: localiser
  end

  # Where a leader is believed to be stays true when nobody leads any more.
  defp join(localiser, nil), do: localiser
  defp join(%{belief: nil} = localiser, _frame), do: localiser

  # Less drift than before has only a robot that was started anew.
  defp join(%{frame: %{key: key} = known} = localiser, %{key: key} = frame)
       when frame.way >= known.way and frame.turn >= known.turn,
       do: reframe(localiser, frame, frame.way - known.way, frame.turn - known.turn)

  defp join(localiser, frame) do
    {position, heading} = between(localiser.frame, frame)
    # Where things are in the other frame has still to be seen.
    localiser = %{localiser | belief: Belief.forget(localiser.belief)}
    localiser = reframe(localiser, frame, position, heading)
    %{localiser | joins: localiser.joins + 1}
  end

  # What nobody knows of one frame in another: one may have begun in the other, or both elsewhere.
  defp between(nil, frame), do: {frame.position, frame.heading}
  defp between(%{key: key}, %{base: key} = frame), do: {frame.position, frame.heading}
  defp between(%{base: key} = known, %{key: key}), do: {known.position, known.heading}

  defp between(known, frame),
    do: {known.position + frame.position, known.heading + frame.heading}

  defp reframe(localiser, frame, position, heading) do
    belief = Belief.reframe(localiser.belief, frame.at, position, heading)
    %{localiser | frame: frame, belief: belief}
  end

  @doc """
  Moves the estimate by the percept's odometry, corrects it by the percept's blobs, and fills in the percept's
  `pose`, `uncertainty` and `blobs_pose`. Without odometry there is no pose.
  """
  @spec update(t(), Percept.t()) :: {Percept.t(), t()}
  def update(localiser, %Percept{odometry: nil} = percept),
    do: {%{percept | pose: nil, uncertainty: nil, blobs_pose: nil}, localiser}

  def update(localiser, %Percept{odometry: %Odometry{} = odometry} = percept) do
    localiser =
      localiser
      |> framed(odometry.frame)
      |> move(odometry.pose)
      |> see(percept)
      |> remember(percept.at_ms)

    percept = %{
      percept
      | pose: localiser.belief.pose,
        uncertainty: uncertainty(localiser),
        blobs_pose: percept.blobs_at_ms && pose_at(localiser, percept.blobs_at_ms)
    }

    {percept, localiser}
  end

  defp uncertainty(%{belief: belief, frame: frame, joins: joins}) do
    {position, _across, heading} = Belief.sd(belief)

    %{
      radius: Belief.radius(belief),
      position: position,
      heading: heading,
      frame: frame && frame.key,
      joins: joins,
      drift: belief.drift
    }
  end

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
    belief = if driven?(odometry), do: Belief.lost(belief), else: belief
    %{localiser | odometry: odometry, belief: belief}
  end

  defp move(%{odometry: nil} = localiser, odometry), do: %{localiser | odometry: odometry}

  defp move(localiser, odometry) do
    step = Pose.relative(localiser.odometry, odometry)
    %{localiser | odometry: odometry, belief: Belief.move(localiser.belief, step)}
  end

  # Every picture counts once. It was taken a moment ago, and the body may have turned since.
  defp see(localiser, %Percept{blobs: nil}), do: localiser
  defp see(%{seen_ms: at_ms} = localiser, %Percept{blobs_at_ms: at_ms}), do: localiser

  defp see(localiser, %Percept{blobs_at_ms: at_ms} = percept) do
    back = History.back(localiser.history, localiser.odometry, at_ms)
    belief = Sightings.correct(localiser.belief, localiser.anchors.marks, percept, back)
    %{localiser | seen_ms: at_ms, belief: belief}
  end

  defp remember(localiser, at_ms),
    do: %{localiser | history: History.note(localiser.history, at_ms, localiser.odometry)}

  defp pose_at(%{belief: belief} = localiser, at_ms),
    do: Pose.compose(belief.pose, History.back(localiser.history, localiser.odometry, at_ms))

  # It was started anew in the middle of its way: how it came there, and what corrected it, nobody knows any more.
  defp driven?(%Pose{x: x, y: y, heading: heading}),
    do: x * x + y * y > @put_down * @put_down or abs(heading) > @put_down
end
