defmodule Console.AboutTest do
  @moduledoc "What the page is told of a robot: of one on this node, of one in lockstep, and of one elsewhere, in the same words."
  use ExUnit.Case, async: true
  alias Console.About
  alias Hal.{Odometry, Pose, Twist}
  alias Robot.Board
  alias Swarm.{Member, Status}
  doctest About

  defmodule Silent do
    @moduledoc "Says nothing."
    @behaviour Robot.Mission

    @impl Robot.Mission
    def init(_robot, _options), do: {:waits, nil, []}

    @impl Robot.Mission
    def handle(_event, nil), do: {:waits, nil, []}
  end

  @why "lost: a third of what it hears fits the plan"
  @astray %{radius: 3.0, place: {:lost, @why}, lost?: true}
  @doing %{
    by: :follow,
    weights: [follow: 0.5, rest: 0.1],
    way: [{1.0, 2.0}],
    limits: [:caution],
    fault: nil
  }

  # The board of a robot on this node, whose parts have written this.
  defp board(id, entries) do
    profile = Hal.Profile.magellan()
    config = Robot.Config.new!(id: id, profile: profile, drive: {Hal.FakeDrive, []})
    start_supervised!({Board, config})
    board = Board.find!(id)
    release = {:comms, :release, %{mission: nil, replace: false, profile: profile}}

    for {writer, key, value} <- [release | entries],
        do: Board.put(board, writer, key, value, Board.now(board))

    board
  end

  defp driving, do: %Odometry{pose: Pose.new(1, 1), twist: Twist.new(0.3, -0.1)}

  test "a lost robot without a mission says why, on this node and elsewhere" do
    board(:about1, [{:executive, :uncertainty, @astray}])
    assert About.of(:about1).notes == [@why]
    assert About.of_status(%Status{robot: :about1, says: @why}).notes == [@why]
  end

  test "what a mission says comes first, and what blocks it before that" do
    claim = %{says: "in its slot, but NOT SURE", blocked_by: "mag2"}
    mission = %{state: :idle, claim: claim, since_ms: 0, ticked_ms: 0, options: []}

    board(:about2, [{:executive, :uncertainty, @astray}, {:pilot, :mission, mission}])
    assert About.of(:about2).notes == ["blocked by mag2", "in its slot, but NOT SURE"]
  end

  test "a robot of this node tells what it does, and how it turns" do
    board(:about3, [
      {:executive, :doing, @doing},
      {:executive, :pose, Pose.new(0.5, 0.25)},
      {:gate, :driving, %{twist: Twist.zero(), limits: [:fence]}},
      {:drive, :odometry, driving()},
      {:drive, {:health, :drive}, {:offline, :enoent}},
      {:drive, :power, 24.5}
    ])

    assert %{
             by: :follow,
             wishes: [[:follow, 0.5], [:rest, 0.1]],
             way: [[1.0, 2.0]],
             pose: [0.5, 0.25],
             limits: [:caution, :fence],
             offline: [:drive],
             speed: 0.3,
             turn: -0.1,
             power: 24.5,
             estop: false,
             notes: []
           } = about = About.of(:about3)

    assert About.json(:about3, about) =~ ~s("by":"follow")
  end

  test "what its camera has found is told as boxes, blobs and marks" do
    blob = %Vision.Blob{
      colour: "Red",
      area: 4,
      share: 0.1,
      x: 1.0,
      y: 1.0,
      left: 0,
      top: 1,
      right: 2,
      bottom: 3,
      width: 64,
      height: 48
    }

    mark = %Vision.Mark{
      family: :tag36h11,
      id: 7,
      at_ms: 0,
      x: 15.0,
      y: 10.0,
      corners: [{10.2, 5.0}, {20.7, 5.5}, {20.5, 15.9}, {10.0, 15.0}],
      width: 64,
      height: 48
    }

    board = board(:about6, [])

    for {blobs, marks, boxes} <- [
          {[blob], nil, [["Red", 0, 1, 2, 3]]},
          {[blob], [mark], [["Red", 0, 1, 2, 3], ["tag36h11 7", 10, 5, 21, 16]]},
          {[], [mark], [["tag36h11 7", 10, 5, 21, 16]]}
        ] do
      now = Board.now(board)
      seen = %Vision.Detections{at_ms: now, blobs: blobs, marks: marks}
      Board.put(board, :blob_detector, :detections, seen, now)
      assert %{width: 64, height: 48, boxes: ^boxes} = About.of(:about6).seen
    end

    now = Board.now(board)
    nothing = %Vision.Detections{at_ms: now, blobs: [], marks: []}
    Board.put(board, :blob_detector, :detections, nothing, now)
    assert About.of(:about6).seen == nil
  end

  test "what is older than a second is not of now, and a robot that is gone has nothing to tell" do
    board = board(:about4, [])
    Board.put(board, :drive, :odometry, driving(), Board.now(board) - 1_500)
    Board.put(board, :drive, :power, 24.5, Board.now(board) - 1_500)
    assert %{speed: nil, turn: nil, power: 24.5, pose: nil, wishes: []} = About.of(:about4)
    assert About.of(:about_none) == nil
  end

  test "a robot in lockstep says the same" do
    profile = Hal.Profile.magellan()

    member =
      Member.new(
        id: :about5,
        profile: profile,
        start: Pose.new(0, 0),
        mission: {Silent, []}
      )

    {member, _effects} = Member.step(member, {:reading, {:odometry, driving()}, 100})
    {member, _effects} = Member.step(member, {:reading, {:power, 24.5}, 100})
    {member, _effects} = Member.step(member, {:tick, 100})

    assert %{speed: 0.3, turn: -0.1, power: 24.5, notes: [], camera: false, offline: []} =
             About.of_member(member)

    board = Map.put(member.lockstep.board, :uncertainty, {@astray, 100})
    assert About.of_member(put_in(member.lockstep.board, board)).notes == [@why]
  end
end
