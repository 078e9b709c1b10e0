defmodule Swarm.StatusTest do
  use Swarm.Case, async: false
  alias Swarm.Status
  alias Swarm.Status.Frame

  doctest Frame
  doctest Swarm.Status.Sight
  doctest Swarm.Status.Words

  test "the line shows the view's number, and names robots that it does not hear" do
    line = fn fields -> inspect(struct!(%Status{robot: :mag1, age_ms: 5}, fields)) end
    members = [:mag1, :mag2, :min1, :min2, :min3, :min4, :min5]

    assert line.([]) == "#mag1 idle (pose unknown) 0.00 m/s, hears 0, age 5 ms"
    assert line.(view: {3, [:mag1, :mag2]}, hears: [:mag2]) =~ ", view 3, hears 1, age"
    assert line.(view: {3, [:mag1, :mag2]}) =~ ", view 3, hears 0 but not mag2, age"

    assert line.(view: {9, members}, hears: [:mag2]) =~
             ", view 9, hears 1 but not min1 min2 min3 and 2 more, age"

    assert line.(blocked_by: "the landmark", leader: :min1) =~
             ", BLOCKED by the landmark, leader min1,"

    assert line.(network: "wlan0 is not connected") =~
             ", hears 0, NO NETWORK (wlan0 is not connected), age"
  end

  test "the speed is what the wheels report, with its age, whatever they are told" do
    id = robot(:status_speed)
    report = fn v -> {:odometry, %Hal.Odometry{pose: Pose.new(0, 0), twist: Twist.new(v, 0)}} end
    send(Names.whereis(id, :drive), {:readings, [report.(0.38)]})
    eventually(fn -> Swarm.status(id).speed == 0.38 end)
    # The gate has told them to stand.
    assert {:ok, %{twist: told}, _} = Board.fetch(Board.find!(id), :driving, :infinity)
    assert Twist.zero?(told)
    assert order(fn -> Swarm.stop(id) end) == :ok
    assert %Status{speed: 0.38, age_ms: age_ms} = status = Swarm.status(id)
    assert is_integer(age_ms)
    assert inspect(status) =~ ~r/ 0\.38 m\/s by \w+, .*age \d+ ms/
    send(Names.whereis(id, :drive), {:readings, [report.(0.0)]})
    eventually(fn -> Swarm.status(id).speed == 0.0 end)

    unknown = %{status | speed: nil}
    assert inspect(unknown) =~ "speed unknown"
    assert {:ok, %{speed: nil}} = Status.Row.decode(id, Status.Row.encode(unknown), 10)
  end

  test "status and row say where the camera looks, and what it shows of the landmark" do
    classes =
      for name <- ["Lamp", "Red"], do: %{name: name, y: {80, 240}, u: {60, 90}, v: {130, 145}}

    {:ok, colours} = Vision.Colours.new(classes)
    camera = {Hal.FakeCamera, test: self(), device: :camera}

    id =
      robot(:status_sight,
        camera: camera,
        colours: colours,
        ptz: {Hal.FakePtz, test: self(), device: :ptz}
      )

    assert %{head: nil, sees: nil} = Swarm.status(id)

    board = Board.find!(id)
    look = %{pan: 0.21, tilt: -0.1, field_of_view: 0.85}

    lamp = %Vision.Blob{
      colour: "Lamp",
      area: 90,
      share: 0.01,
      x: 159.5,
      y: 9.0,
      left: 150,
      top: 1,
      right: 169,
      bottom: 17,
      width: 320,
      height: 240,
      distance: 2.314
    }

    show = fn blobs ->
      now_ms = System.monotonic_time(:millisecond)
      Board.put(board, :ptz, :ptz, look, now_ms)
      picture = %Vision.Detections{at_ms: now_ms, blobs: blobs, pan: 0.3, field_of_view: 0.85}
      Board.put(board, :blob_detector, :detections, picture, now_ms)
      Swarm.status(id)
    end

    status = show.([%{lamp | colour: "Red", area: 900}, lamp])
    assert %{head: ^look, sees: %{colour: "Lamp", bearing: 0.3, distance: 2.314}} = status
    assert inspect(status) =~ ", looks at 12, -6 deg (zoom 49 deg), sees Lamp at 17 deg, 2.31 m"
    assert {:ok, told} = Status.Row.decode(id, Status.Row.encode(status), 10)
    assert {told.head, told.sees} == {look, status.sees}

    status = show.([])
    assert status.sees == %{colour: "Lamp", bearing: nil, distance: nil}
    assert inspect(status) =~ ", sees no Lamp"
    row = Status.Row.encode(status)
    assert {:ok, %{sees: %{bearing: nil}}} = Status.Row.decode(id, row, 10)

    for junk <- [
          7,
          {1, 2, -3},
          {"x", 1.5, 2},
          {String.duplicate("x", 81), 1, 2},
          {"\e[2J", 1, 2},
          {:pan, 1, 2},
          {0, 0, -1}
        ],
        do:
          assert(
            {:ok, %{head: nil, sees: nil}} =
              Status.Row.decode(id, %{row | head: junk, sees: junk}, 10)
          )
  end

  test "what sonars measure is asked for, and only what is of now" do
    id = robot(:status_sonar)
    send(Names.whereis(id, :drive), {:readings, [{:sonar, for(n <- 1..16, do: n / 10)}]})
    eventually(fn -> match?({:ok, [{%Pose{}, 0.1} | _]}, Swarm.sonar(id)) end)
    assert {:ok, [_ | _] = ranges} = Swarm.sonar(id)
    assert length(ranges) == 16
    Board.put(Board.find!(id), :drive, :sonar, [1.0], System.monotonic_time(:millisecond) - 5_000)
    assert Swarm.sonar(id) == {:error, "status_sonar: its sonars say nothing"}
    assert {:error, line} = Swarm.sonar(:status_snoar)
    assert line =~ "status_snoar"
  end

  defmodule Drawing do
    @moduledoc "A mission that draws so many points, and leads the others in a wedge."
    @behaviour Robot.Mission
    @impl Robot.Mission
    def init(_robot, options), do: {:lead, options[:points], [{:claim, %{phase: :lead}}]}
    @impl Robot.Mission
    def handle(_event, points), do: {:lead, points, []}
    @impl Robot.Mission
    def layer(points),
      do: [{:points, "points", for(k <- 1..points//1, do: {k * 0.1, 0.0, "point #{k}"})}]

    @impl Robot.Mission
    def shape(%{phase: :lead}, _pose, _ahead_m), do: %{formation: {:wedge, 1.5}, slots: %{}}
    def shape(_claim, _pose, _ahead_m), do: nil
  end

  test "what a mission draws, its name and its shape are asked for; what is too much is refused" do
    id = robot(:status_layer)
    assert Swarm.layer(id) == {:ok, []}
    assert %Status{mission: nil, formation: nil} = Swarm.status(id)

    :ok = Robot.Control.Pilot.start(id, Drawing, points: 2)
    drawn = [{:points, "points", [{0.1, 0.0, "point 1"}, {0.2, 0.0, "point 2"}]}]
    eventually(fn -> Swarm.layer(id) == {:ok, drawn} end)
    Board.put(Board.find!(id), :executive, :pose, Pose.new(1.0, 2.0), Board.now(Board.find!(id)))

    assert %Status{mission: "Swarm.StatusTest.Drawing", formation: {:wedge, 1.5}} =
             Swarm.status(id)

    :ok = Robot.Control.Pilot.start(id, Drawing, points: 4_000)
    too_much = {:error, "status_layer: its mission draws too much to be sent"}
    eventually(fn -> Swarm.layer(id) == too_much end)
    assert {:error, line} = Swarm.layer(:status_layre)
    assert line =~ "status_layre"
  end

  test "no escape of a row reaches a terminal" do
    status = %Status{robot: :mag1, node: node(), by: :follow, says: "a\e[2Jb\n", age_ms: 5}
    row = Status.Row.encode(status)
    assert {:ok, %{says: "a [2Jb "}} = Status.Row.decode(:mag1, row, 10)

    for {key, junk} <- [says: "\e[2J", state: "\e]0;x", by: "\a", limits: ["\e"], offline: ["\e"]],
        do: assert(Status.Row.decode(:mag1, Map.put(row, key, junk), 10) == :error)
  end

  test "a robot's row says what blocks it, as text of limited length" do
    status = %Status{robot: :mag1, node: node(), by: :follow, blocked_by: "mag2", age_ms: 5}
    row = Status.Row.encode(status)
    assert {:ok, %{blocked_by: "mag2"}} = Status.Row.decode(:mag1, row, 10)
    assert {:ok, %{blocked_by: nil}} = Status.Row.decode(:mag1, Map.delete(row, :blocked_by), 10)

    for junk <- [:landmark, String.duplicate("x", 321)],
        do: assert(Status.Row.decode(:mag1, %{row | blocked_by: junk}, 10) == :error)
  end

  test "a robot's row says in which frame its pose is, and which epoch it knows" do
    frame = %Frame{within: {:mag1, 399_000_000}, own: 12, start: {-1.5, 2.0}}
    status = %Status{robot: :mag1, node: node(), by: :follow, frame: frame, epoch: 3, age_ms: 5}
    row = Status.Row.encode(status)
    assert {:ok, %{frame: ^frame, epoch: 3}} = Status.Row.decode(:mag1, row, 10)
    # Of a robot that does not say it, or whose leader nobody here has heard of, it is not known.
    assert {:ok, %{frame: nil, epoch: nil}} =
             Status.Row.decode(:mag1, Map.drop(row, [:frame, :epoch]), 10)

    for frame <- [{"nobody of this name", 1, 2, 3, 4}, {"mag1", 1, 2, 3, :far}, "found"],
        do: assert({:ok, %{frame: nil}} = Status.Row.decode(:mag1, %{row | frame: frame}, 10))

    assert Status.Row.decode(:mag1, %{row | epoch: "3"}, 10) == :error
  end

  test "a robot's row says what it hangs in" do
    hung = {:silent, "its mission Patrol", 150}
    status = %Status{robot: :mag1, node: node(), by: :follow, hung: hung, age_ms: 5}
    row = Status.Row.encode(status)
    assert {:ok, told} = Status.Row.decode(:mag1, row, 10)
    assert told.hung == {:silent, "its mission Patrol", 160}
    assert inspect(told) =~ ", HANGS in its mission Patrol,"
    started = Status.Row.encode(%{status | hung: {:hung, "Acts.Hang", 3_000}})
    assert {:ok, told} = Status.Row.decode(:mag1, started, 10)
    assert inspect(told) =~ ", HUNG in Acts.Hang 3 s ago, started again,"
    assert {:ok, %{hung: nil}} = Status.Row.decode(:mag1, Map.delete(row, :hung), 10)

    for junk <- [:hung, {"asleep", "x", 1}, {"hung", :x, 1}, {"hung", "x", -1}],
        do: assert(Status.Row.decode(:mag1, %{row | hung: junk}, 10) == :error)
  end

  test "a robot's row says what crashed, and which file does not take its e-stop" do
    crash = "(RuntimeError) boom, lib/gather.ex:42"
    file = "no space left on device: /var/estop"

    status = %Status{
      robot: :mag1,
      node: node(),
      age_ms: 5,
      crashed: crash,
      estop: true,
      estop_file: file
    }

    row = Status.Row.encode(status)
    assert {:ok, told} = Status.Row.decode(:mag1, row, 10)
    assert inspect(told) =~ ", CRASHED (RuntimeError) boom, lib/gather.ex:42,"

    assert inspect(told) =~
             ", E-STOP, E-STOP NOT ON ITS DISK (no space left on device: /var/estop),"

    released = Status.Row.encode(%{status | estop: false, crashed: nil})
    assert {:ok, told} = Status.Row.decode(:mag1, released, 10)
    assert inspect(told) =~ ", RESET NOT ON ITS DISK (no space"
    refute inspect(told) =~ "CRASHED"

    for key <- [:crashed, :estop_file],
        junk <- [:x, 1, String.duplicate("x", 10_000)],
        do: assert(Status.Row.decode(:mag1, %{row | key => junk}, 10) == :error)

    # A text from outside is as long as it likes.
    long = Status.Row.encode(%{status | crashed: String.duplicate("ä", 9_000)})
    assert {:ok, %Status{}} = Status.Row.decode(:mag1, long, 10)
  end

  test "the line says how sure the pose is, if that is known" do
    line = fn fields -> inspect(struct!(%Status{robot: :mag1, age_ms: 5}, fields)) end
    pose = Hal.Pose.new(1.2, 3.4, 1.5708)

    assert line.(pose: pose) =~ "#mag1 idle (1.20, 3.40, 90 deg) 0.00 m/s, hears"

    assert line.(pose: pose, uncertainty: 0.1234) =~
             "#mag1 idle (1.20, 3.40, 90 deg) ±0.12 m, 0.00 m/s, hears"

    assert line.(uncertainty: 0.1234) =~ "#mag1 idle (pose unknown) 0.00 m/s, hears"

    assert line.(pose: pose, says: "as its mission puts it", leader: :min1) =~
             " m/s, as its mission puts it, leader min1,"
  end

  test "a robot's row says how sure its pose is, in whole mm, and what its mission says" do
    status = %Status{robot: :mag1, node: node(), by: :follow, age_ms: 5}
    sure = %{status | uncertainty: 0.12345, says: "point 2 of 4"}
    row = Status.Row.encode(sure)
    assert row.uncertainty == 123
    assert {:ok, %{uncertainty: 0.123, says: "point 2 of 4"}} = Status.Row.decode(:mag1, row, 10)

    # A robot that does not know says nothing, as older versions do.
    none = Status.Row.encode(status)
    refute is_map_key(none, :uncertainty) or is_map_key(none, :says)
    assert {:ok, %{uncertainty: nil, says: nil}} = Status.Row.decode(:mag1, none, 10)

    for zero <- [0, 0.0],
        do: assert(%{uncertainty: 0} = Status.Row.encode(%{sure | uncertainty: zero}))

    # However uncertain it is, it can say so.
    lost = Status.Row.encode(%{sure | uncertainty: 1.0e12})
    assert {:ok, %{uncertainty: 1.0e5}} = Status.Row.decode(:mag1, lost, 10)

    for junk <- [-1, 0.5, 100_000_001, 10 ** 40, "123", :far, {1}, [1]],
        do: assert(Status.Row.decode(:mag1, %{row | uncertainty: junk}, 10) == :error)

    for junk <- [1, :maybe, String.duplicate("x", 1_000)],
        do: assert(Status.Row.decode(:mag1, %{row | says: junk}, 10) == :error)

    # However long it is, some of it is told.
    long = Status.Row.encode(%{status | says: String.duplicate("ä", 1_000)})
    assert {:ok, %{says: "ä" <> _}} = Status.Row.decode(:mag1, long, 10)
  end

  test "a robot without a mission says how sure it is of its pose" do
    id = robot(:st_sure)
    standing([id])
    assert eventually(fn -> is_float(Swarm.status(id).uncertainty) end)
    status = Swarm.status(id)
    assert status.uncertainty >= 0.0
    assert inspect(status) =~ ~r/ deg\) ±\d+\.\d\d m, 0\.00 m\/s/
  end

  test "robots of one node are in each other's view and hear each other, and the status says so" do
    for id <- [:st1, :st2], do: robot(id)
    assert eventually(fn -> :st2 in Swarm.status(:st1).hears end)

    status = Enum.find(Swarm.status(), &(&1.robot == :st1))
    assert %Status{view: {number, members}} = status
    assert number >= 1 and :st1 in members and :st2 in members
    assert inspect(status) =~ "view #{number}, hears #{length(status.hears)}"
    assert Swarm.Status.Matrix.hears?(Swarm.matrix(), :st1, :st2)
  end

  test "the line says why a device is offline, and that a robot without sonar is slow" do
    status = %Status{
      robot: :mag1,
      node: :mag1@lab,
      health: %{drive: {:offline, :eacces}, ptz: :online},
      offline: %{drive: "/dev/ttyR0: permission denied"},
      limits: [:blind, :caution],
      fault: "bumper 0 stays pressed"
    }

    assert inspect(status) =~ ", BLIND (no sonar; slow), "
    assert inspect(status) =~ ", drive offline (/dev/ttyR0: permission denied)"
    # So does its row, for nodes that cannot reach it.
    {:ok, told} = Status.Row.decode(:mag1, Status.Row.encode(status), 7)
    slow = "BLIND (no sonar; slow), CAUTIOUS (another robot may be near; slow)"
    assert inspect(told) =~ ", FAULT (bumper 0 stays pressed), #{slow}, "
    assert inspect(told) =~ ", drive offline (/dev/ttyR0: permission denied)"
    # A row of an older version has no text.
    row = status |> Status.Row.encode() |> Map.delete(:words)
    assert {:ok, %Status{offline: none} = told} = Status.Row.decode(:mag1, row, 7)
    assert none == %{} and inspect(told) =~ ", drive offline"
  end

  @tag :capture_log
  test "the driver explains why a drive is offline" do
    port = "/dev/convoy_no_such_line"
    id = robot(:st_line, drive: {Hal.RFlex.Driver, port: port}, arm: :manual)
    words = "drive offline (#{port}: no such device)"
    assert eventually(fn -> inspect(Swarm.status(id)) =~ words end)
    assert {:error, line} = Swarm.arm(id)
    assert line == "st_line: the drive is offline (#{port}: no such device)"
  end
end
