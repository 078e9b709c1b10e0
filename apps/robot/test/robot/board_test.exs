defmodule Robot.BoardTest do
  use Robot.Case, async: false
  alias Robot.{Board, Percept}

  @moduletag :tmp_dir

  defp board(id, options \\ []) do
    start_supervised!({Board, config(id, options)}, id: id)
    Board.find!(id)
  end

  test "readers say how old is too old" do
    board = board(:board1)
    Board.put(board, :drive, :sonar, [1.0], 1_000)
    assert Board.fetch(board, :sonar, 300, 1_300) == {:ok, [1.0], 1_000}
    assert Board.fetch(board, :sonar, 300, 1_301) == :error
    assert Board.fetch(board, :sonar, :infinity, 99_999) == {:ok, [1.0], 1_000}
    assert Board.fetch(board, :ir, 300, 1_000) == :error
  end

  test "each key has one writer" do
    board = board(:board2)
    assert_raise ArgumentError, fn -> Board.put(board, :executive, :sonar, [], 0) end
    assert_raise ArgumentError, fn -> Board.put(board, :drive, :nonsense, [], 0) end
    assert_raise ArgumentError, fn -> Board.put(board, :ptz, {:health, :drive}, :online, 0) end
    assert Board.put(board, :comms, {:peer, :mag2}, %{}, 0) == :ok
    assert Board.peers(board) == %{mag2: %{}}
    assert Board.delete(board, :comms, {:peer, :mag2}) == :ok
    assert Board.peers(board) == %{}
  end

  test "is a device's sink" do
    board = board(:board3)
    Board.sense(board, :drive, {:power, 24.0})
    # What real bases say besides.
    for reading <- [brake: true, joystick: %{twist: Hal.Twist.zero(), held?: true}, home: 1.5],
        do: Board.sense(board, :drive, reading)

    assert {:ok, 1.5, _now} = Board.fetch(board, :home, 1_000)
    # What a driver of somebody else's says is left alone, what is another's still is.
    assert Board.sense(board, :drive, {:temperature, 41.0}) == :ok
    refute Map.has_key?(Board.entries(board), :temperature)
    assert_raise ArgumentError, fn -> Board.sense(board, :drive, {:pose, nil}) end
    Board.sense(board, :drive, {:health, :drive, {{:offline, :enoent}, 5}})
    assert {:ok, 24.0, _now} = Board.fetch(board, :power, 1_000)
    assert {:ok, {:offline, :enoent}, 5} = Board.fetch(board, {:health, :drive}, :infinity)
    assert %{power: {24.0, age_ms}} = Board.entries(board)
    assert age_ms in 0..1_000
  end

  test "a status reads what the robot says of itself, and copies no peers" do
    board = board(:board_entries)
    own = [:pose, {:health, :drive}, {:hung, :gate}, {:crashed, :pilot}]

    for {key, writer} <- Enum.zip(own, [:executive, :drive, :watch, :pilot]),
        do: Board.put(board, writer, key, key, 1_000)

    before = Board.entries(board)
    assert Enum.sort(Map.keys(before)) == Enum.sort(own)
    for id <- [:mag2, :min1], do: Board.put(board, :comms, {:peer, id}, %{id: id}, 1_000)
    assert Map.keys(Board.entries(board)) == Map.keys(before)
    assert Board.peers(board) == %{mag2: %{id: :mag2}, min1: %{id: :min1}}
  end

  @tag :capture_log
  test "one that has ended is empty, and holds its robot, for whoever found it a moment before" do
    board = board(:board_ended)
    Board.put(board, :drive, :sonar, [1.0], 1_000)
    refute Board.latched?(board)
    stop_supervised!(:board_ended)

    assert Board.fetch(board, :sonar, :infinity) == :error
    assert {Board.entries(board), Board.peers(board)} == {%{}, %{}}
    assert Board.latched?(board)
    assert Board.put(board, :drive, :sonar, [2.0], 1_100) == :ok
    assert Board.delete(board, :comms, {:peer, :mag2}) == :ok
    assert_raise ArgumentError, fn -> Board.put(board, :executive, :sonar, [], 0) end
  end

  test "two robots of one name cannot be" do
    board(:board4)
    # It is linked before it finds that it is the second.
    Process.flag(:trap_exit, true)
    assert {:error, {:already_started, _pid}} = Board.start_link(config(:board4))

    assert Board.find(:nobody) == :error
  end

  defp saved(board) do
    :ok = Board.saved(board, {__MODULE__, :tell, [self()]})
    assert_receive {:saved, :ok}
    assert Board.saved?(board)
  end

  @doc false
  def tell(test, result), do: send(test, {:saved, result})

  test "the latch outlives everything where it has a file", %{tmp_dir: dir} do
    file = Path.join(dir, "estop")
    board = board(:board5, estop_file: file)
    refute Board.latched?(board)
    Board.latch(board)
    assert Board.latched?(board)
    saved(board)
    assert File.exists?(file)
    stop_supervised!(:board5)

    board = board(:board5, estop_file: file)
    assert Board.latched?(board)
    Board.unlatch(board)
    refute Board.latched?(board)
    saved(board)
    stop_supervised!(:board5)
    refute Board.latched?(board(:board5, estop_file: file))
  end

  test "a latch that is set while the robot ends is written", %{tmp_dir: dir} do
    file = Path.join(dir, "estop")
    {:ok, pid} = Board.start_link(config(:board9, estop_file: file))
    board = Board.find!(:board9)

    true = :erlang.suspend_process(pid)
    Board.latch(board)
    monitor = Process.monitor(pid)
    Process.unlink(pid)
    Process.exit(pid, :shutdown)
    true = :erlang.resume_process(pid)
    assert_receive {:DOWN, ^monitor, :process, ^pid, :shutdown}, 5_000
    assert File.exists?(file)
  end

  test "a file that cannot be written is told, the latch holds, and it is written as soon as it can be",
       %{
         tmp_dir: dir
       } do
    tell = fn [_, _, event], _measurements, metadata, test -> send(test, {event, metadata}) end

    for event <- [:error, :healed] do
      :ok = Hal.Event.attach({:board6, event}, [:robot, :estop_file, event], tell, self())
      on_exit(fn -> Hal.Event.detach({:board6, event}) end)
    end

    # Root may write into any folder, but not into a file as if it were one.
    folder = Path.join(dir, "folder")
    File.write!(folder, "")
    file = Path.join(folder, "estop")
    board = board(:board6, estop_file: file)
    Board.latch(board)
    :ok = Board.saved(board, {__MODULE__, :tell, [self()]})
    assert_receive {:saved, {:error, {^file, :enotdir}}}
    refute Board.saved?(board)
    assert Board.unsaved(board) == {file, :enotdir}
    assert Board.latched?(board)
    assert_received {:error, %{robot: :board6, file: ^file, reason: :enotdir}}
    refute_received {:error, %{robot: :board6}}

    File.rm!(folder)
    File.mkdir!(folder)
    assert_receive {:healed, %{robot: :board6, file: ^file}}
    assert File.read!(file) == "e-stop\n"
    saved(board)
    assert Board.unsaved(board) == nil
  end

  test "a percept holds what is fresh, and nothing else" do
    board = board(:board7)
    profile = Hal.Profile.magellan()

    assert Percept.Snapshot.take(board, profile, 7) ==
             %Percept{robot: :board7, at_ms: 7, profile: profile}

    Board.put(board, :drive, :sonar, [1.0], 1_000)
    Board.put(board, :drive, :bumpers, [3], 900)
    Board.put(board, :drive, :power, 24.0, 0)
    seen = %Vision.Detections{at_ms: 800, blobs: [], pan: 0.5}
    Board.sense(board, :blob_detector, {:detections, seen})
    Board.put(board, :comms, {:peer, :mag2}, %{mode: :dead}, 0)

    assert %Percept{sonar: [1.0], bumpers: [3], power: 24.0, detections: ^seen} =
             percept = Percept.Snapshot.take(board, profile, 1_200)

    assert percept.peers == %{mag2: %{mode: :dead}}

    assert %Percept{sonar: nil, bumpers: [], power: 24.0, detections: nil} =
             Percept.Snapshot.take(board, profile, 1_301)
  end
end
