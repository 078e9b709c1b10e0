defmodule Robot.Safety.GateTest do
  use Robot.Case, async: true
  @moduletag :realtime
  @moduletag :capture_log

  @zero Twist.zero()

  # What the gate did next, in the order of its own trace.
  defp after_sense(reading) do
    receive do
      {:gate, :input, {:cast, {:sense, ^reading}}, at_ms} ->
        assert_receive {:gate, kind, what, ^at_ms}
        {kind, what}

      {:gate, _kind, _what, _at_ms} ->
        after_sense(reading)
    after
      10_000 -> flunk("the gate did not hear #{inspect(reading)}")
    end
  end

  # A speed is decided when a reading arrives, and not at the next step.
  defp decided(id, reading) do
    rolls()
    send(Names.whereis(id, :drive), {:readings, [reading]})

    assert {:effect, {:drive, twist, limits}} = after_sense(reading)

    {twist.linear, limits}
  end

  test "a touched bumper stops the wheels when it arrives" do
    id = rolling(:gate1, trace: {Kernel, :send, [self()]})
    assert {stop, limits} = decided(id, {:bumpers, [0]})
    assert stop == 0.0
    assert :bumper in limits
    assert_receive {:drive, {:drive, %Twist{linear: v}}, _} when v == 0.0
  end

  test "a near sonar slows the wheels when it arrives" do
    id = rolling(:gate2, trace: {Kernel, :send, [self()]})
    near = List.duplicate(5.1, 16) |> List.replace_at(11, 0.1)
    assert {slow, limits} = decided(id, {:sonar, near})
    assert :near in limits
    assert slow < 0.1
  end

  test "e-stop is latched, survives the gate and the executive, and only a reset clears it" do
    id = rolling(:gate3)
    rolls()
    listen(id, [:robot, :gate, :start])
    listen(id, [:robot, :pilot, :phase])
    assert Gate.estop(id) == :ok
    assert Board.latched?(Board.find!(id))
    stands(250)

    kill(id, :gate)
    assert_receive {[:robot, :gate, :start], %{latched?: true}}
    assert_receive {[:robot, :pilot, :phase], %{state: :idle}}
    assert Pilot.start(id) == :ok
    stands(250)

    assert {:ok, %{twist: twist, limits: [:estop]}, _} =
             Board.fetch(Board.find!(id), :driving, :infinity)

    assert Twist.zero?(twist)

    assert Gate.reset(id) == :ok
    refute Board.latched?(Board.find!(id))
    rolls()
  end

  @tag :tmp_dir
  test "a disk that hangs holds back the answer to an e-stop, and no step", %{tmp_dir: folder} do
    file = Path.join(folder, "estop")
    id = rolling(:gate8, estop_file: file)
    rolls()
    Robot.Case.hang(file)
    answer = Task.async(fn -> Gate.estop(id) end)
    assert_receive {:drive, {:drive, twist}, _} when twist == @zero
    assert Board.latched?(Board.find!(id))
    # Other steps follow, and the person's reset and next stop are heard.
    for _step <- 1..5, do: assert_receive({:drive, {:drive, twist}, _} when twist == @zero)
    assert Gate.reset(id) == :ok
    rolls()
    assert Gate.latch(id) == :ok
    stands(250)
    refute Board.saved?(Board.find!(id))
    assert Task.yield(answer, 0) == nil

    Robot.Case.resume(file)
    assert Task.await(answer) == :ok
    # What was cleared and set meanwhile is written after the answer.
    eventually(fn -> Board.saved?(Board.find!(id)) end)
    assert File.exists?(file)
  end

  test "a gate that starts again does not lay its fence in another frame of odometry" do
    {:ok, fence} = Robot.Fence.new({{-50, -50}, {50, 50}})
    id = rolling(:gate6, fence: fence)
    board = Board.find!(id)

    tell = fn frame ->
      odometry = %Hal.Odometry{pose: Hal.Pose.new(0, 0), twist: @zero, frame: frame}
      Gate.sense(id, {:odometry, odometry})
      # The gate has heard it when it answers.
      Gate.reset(id)
    end

    tell.(frame = make_ref())
    assert {:ok, {:is, ^frame}, _} = Board.fetch(board, :frame, :infinity)
    assert %{state: %{reflex: %{place: {_pose, _at_ms}}}} = :sys.get_state(Names.via(id, :gate))
    listen(id, [:robot, :gate, :start])
    kill(id, :gate)
    assert_receive {[:robot, :gate, :start], _}
    tell.(make_ref())
    assert {:ok, {:is, ^frame}, _} = Board.fetch(board, :frame, :infinity)
    assert %{state: %{reflex: %{place: nil}}} = :sys.get_state(Names.via(id, :gate))
  end

  test "a gate that starts again knows that its drive is not armed" do
    mission = {Acts.Mission, effects: [{:goal, :roll, {Acts.Roll, twist: Twist.new(0.1, 0.0)}}]}
    id = robot(:gate5, arm: :manual, mission: mission)
    assert Pilot.start(id) == {:error, "its wheels are disarmed; arm it first"}
    eventually_limits(id, [:disarmed])
    stands(250)
    :ok = Hal.Device.arm(Names.whereis(id, :drive))
    stands(250)
    :ok = Pilot.start(id)
    rolls()
    :ok = Hal.Device.disarm(Names.whereis(id, :drive))
    listen(id, [:robot, :gate, :start])
    listen(id, [:robot, :gate, :limits])
    kill(id, :gate)
    assert_receive {[:robot, :gate, :start], %{latched?: false}}
    # Its first word is why it stands.
    assert_receive {[:robot, :gate, :limits], %{limits: limits}}
    assert limits == [:disarmed]
  end

  defp eventually_limits(id, limits) do
    listen(id, [:robot, :gate, :limits])

    case Board.fetch(Board.find!(id), :driving, :infinity) do
      {:ok, %{limits: ^limits}, _at_ms} -> :ok
      _others -> assert_receive {[:robot, :gate, :limits], %{limits: ^limits}}
    end

    Hal.Event.detach({Robot.Case, id, [:robot, :gate, :limits]})
  end

  test "whatever is wished, only sane speeds come out" do
    id = robot(:gate4)
    assert_receive {:drive, {:drive, twist}, _} when twist == @zero
    for part <- [:watch, :executive], do: :ok = :sys.suspend(Names.whereis(id, part))

    for wish <- [%{linear: :nan, turn: 0.0}, %{linear: 1.0e308, turn: 0.0}, :nonsense] do
      Gate.wish(id, wish)
      forget_drives()
      assert_receive {:drive, {:drive, %Twist{linear: v}}, _} when v == 0.0
    end

    assert_in_delta first_step(id, Twist.new(50.0, 0.0)), 0.05, 0.0501
  end

  # The wheels' first speed. On a busy machine a wish may be too old at the next step.
  defp first_step(id, wish, wishes \\ 50) do
    Gate.wish(id, wish)

    receive do
      {:drive, {:drive, %Twist{linear: v}}, _} when v > 0 -> v
    after
      300 ->
        assert wishes > 1, "no wish of 50 moved the wheels"
        first_step(id, wish, wishes - 1)
    end
  end
end
