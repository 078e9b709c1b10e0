defmodule Robot.DepartureTest do
  @moduledoc "A robot that has left its start pose, and what is started again on the way."
  use Robot.Case, async: true
  @moduletag :realtime
  doctest Robot.Departure
  alias Hal.{Odometry, Pose, Profile}
  alias Robot.{Departure, Localiser, Percept}
  alias Robot.Safety.Reflex

  setup do
    folder =
      Path.join(System.tmp_dir!(), "convoy_departure_#{System.unique_integer([:positive])}")

    File.mkdir_p!(folder)
    on_exit(fn -> File.rm_rf!(folder) end)
    %{path: Path.join(folder, "mag1.departed")}
  end

  test "a note counts until it is deleted, and not after the machine was booted", %{path: path} do
    assert Departure.Note.read(nil) == nil
    assert Departure.Note.read(path) == nil
    frame = Departure.frame(make_ref())
    assert Departure.Note.write(path, frame) == :ok
    assert Departure.Note.read(path) == frame
    assert File.ls!(Path.dirname(path)) == ["mag1.departed"]
    File.write!(path, "another boot\n#{frame}\n")
    assert Departure.Note.read(path) == nil

    for half <- ["", "\n", "another boot\n", "another boot\n#{frame}", <<255, 0>>] do
      File.write!(path, half)
      refute Departure.start?(Departure.Note.read(path), make_ref())
    end

    refute Departure.start?(Departure.Note.read(Path.dirname(path)), make_ref())
    assert Departure.Note.write(path, frame) == :ok
    assert Departure.Note.delete(path) == :ok
    assert Departure.Note.read(path) == nil
    assert Departure.Note.delete(path) == :ok
    assert Departure.Note.write(Path.join(path, "x"), frame) == {:error, :enoent}
  end

  defp radius(departed, frame, odometry) do
    percept = %Percept{
      robot: :mag1,
      at_ms: 0,
      profile: Profile.magellan(),
      odometry: %Odometry{pose: odometry, twist: Twist.zero(), frame: frame}
    }

    {percept, _localiser} = Localiser.update(Localiser.new(Pose.new(1, 2), departed), percept)
    percept.uncertainty.radius
  end

  test "wheels that count from zero again say nothing of the start pose" do
    frame = make_ref()
    zero = Pose.new(0, 0)
    assert radius(nil, frame, zero) < 0.2
    assert radius(Departure.frame(frame), frame, zero) < 0.2
    assert radius(Departure.frame(make_ref()), frame, zero) > 5.0
    # Wheels that have counted on know how far it is from there.
    on = radius(Departure.frame(frame), frame, Pose.new(1, 0))
    assert on > 0.5 and on < 5.0
  end

  test "of wheels without frames nobody knows, once it was left, where their zero is" do
    assert radius(nil, nil, Pose.new(0, 0)) < 0.2
    assert radius(Departure.frame(nil), nil, Pose.new(0, 0)) > 5.0
  end

  test "nor do they say where a fence is" do
    {:ok, fence} = Robot.Fence.new({{-50, -50}, {50, 50}})
    frame = make_ref()
    reading = {:odometry, %Odometry{pose: Pose.new(0, 0), twist: Twist.zero(), frame: frame}}

    place = fn departed ->
      reflex = Reflex.new(Profile.magellan(), fence: fence, frame: {:was, departed})
      {reflex, _urgency} = Reflex.sense(reflex, reading, 0)
      reflex.place
    end

    assert {%Pose{}, 0} = place.(Departure.frame(frame))
    assert place.(Departure.frame(make_ref())) == nil
  end

  test "a robot of which everything falls on its way knows that it does not know its place", %{
    path: path
  } do
    id = :departure1
    {:ok, fence} = Robot.Fence.new({{-50, -50}, {50, 50}})
    robot(id, departure_file: path, fence: fence)
    frame = make_ref()
    count(id, frame, Pose.new(0, 0))
    assert eventually(fn -> radius(id) end) < 0.2
    refute File.exists?(path)
    count(id, frame, Pose.new(0.5, 0))
    assert eventually(fn -> Departure.Note.read(path) end) == Departure.frame(frame)

    listen(id, [:robot, :executive, :start])
    listen(id, [:robot, :executive, :away])
    kill(id, :board)
    assert_receive {[:robot, :executive, :start], _}
    count(id, make_ref(), Pose.new(0, 0))
    assert_receive {[:robot, :executive, :away], _}
    assert eventually(fn -> radius(id) end) > 5.0
    assert %{state: %{reflex: %{place: nil}}} = :sys.get_state(Names.via(id, :gate))
  end

  test "what cannot be written is told once, and tried again", %{path: path} do
    id = :departure2
    path = Path.join(path, "mag1.departed")
    listen(id, [:robot, :departure_file, :failed])
    robot(id, departure_file: path)
    frame = make_ref()
    count(id, frame, Pose.new(0, 0))
    assert eventually(fn -> radius(id) end) < 0.2
    count(id, frame, Pose.new(0.5, 0))
    assert_receive {[:robot, :departure_file, :failed], _}
    File.mkdir_p!(Path.dirname(path))

    # Of a driver that has started again meanwhile, zero is not the start.
    another = make_ref()

    noted = fn ->
      count(id, another, Pose.new(0, 0))
      Departure.Note.read(path)
    end

    assert eventually(noted) == Departure.frame(frame)
    refute_received {[:robot, :departure_file, :failed], _}
  end

  test "a disk that hangs stops no tick", %{path: path} do
    id = :departure4
    robot(id, departure_file: path)
    Robot.Case.hang(path <> ".new")
    frame = make_ref()
    count(id, frame, Pose.new(0, 0))
    assert eventually(fn -> radius(id) end) < 0.2
    count(id, frame, Pose.new(0.5, 0))
    board = Robot.Board.find!(id)
    assert eventually(fn -> Robot.Board.departed(board) end) == Departure.frame(frame)
    tick = fn -> elem(Robot.Board.fetch(board, :doing, :infinity), 1).tick end
    before = tick.()
    assert eventually(fn -> if(tick.() > before + 3, do: true) end)
    refute File.exists?(path)
    Robot.Case.resume(path <> ".new")
    assert eventually(fn -> if(File.exists?(path), do: true) end)
  end

  test "an executive that starts again knows its place, and tells nothing else later", %{
    path: path
  } do
    id = :departure3
    robot(id, departure_file: path)
    frame = make_ref()
    count(id, frame, Pose.new(0, 0))
    assert eventually(fn -> radius(id) end) < 0.2
    count(id, frame, Pose.new(0.5, 0))
    assert eventually(fn -> Departure.Note.read(path) end)
    listen(id, [:robot, :executive, :start])
    listen(id, [:robot, :executive, :away])
    kill(id, :executive)
    assert_receive {[:robot, :executive, :start], _}
    count(id, frame, Pose.new(0.5, 0))
    known = eventually(fn -> if(radius(id) > 1.0, do: radius(id)) end)
    assert known < 2.0
    # A driver that starts again while its executive goes on is another matter.
    count(id, make_ref(), Pose.new(0, 0))
    assert eventually(fn -> if(radius(id) > known, do: radius(id)) end) < 5.0
    refute_received {[:robot, :executive, :away], _}
  end

  # As if the base had said it.
  defp count(id, frame, pose) do
    online(id)
    odometry = %Odometry{pose: pose, twist: Twist.zero(), frame: frame}
    send(Names.whereis(id, :drive), {:readings, [{:odometry, odometry}]})
  end

  defp radius(id) do
    with {:ok, board} <- Board.find(id),
         {:ok, %{radius: radius}, _at_ms} <- Board.fetch(board, :uncertainty, :infinity),
         do: radius,
         else: (_not_yet -> nil)
  end
end
