defmodule Swarm.Discovery.RobotInfoTest do
  use Swarm.Case, async: false
  @moduletag :realtime
  @moduletag :capture_log
  alias Swarm.{Blackboard, Status}
  alias Swarm.Discovery.RobotInfo
  alias Swarm.Discovery.Presence

  doctest Swarm.Discovery.RobotInfo
  doctest Swarm.Status.Matrix
  doctest Swarm.Discovery.Search

  # A row as another node would send it.
  defp told(robot, key, value, age_ms \\ 0, sequence \\ 1) do
    row =
      {Atom.to_string(robot), Blackboard.Codec.id(key), 5, sequence, age_ms,
       Blackboard.Codec.encode(key, value)}

    Blackboard.hear(:far@away, {:rows, [row]})
    Blackboard.info()
  end

  defp status_row(robot, changes \\ []) do
    status = %Status{
      robot: robot,
      node: node(),
      state: :follow,
      hears: [:ab2],
      view: {3, [robot, :ab2, :ab3]},
      age_ms: 40
    }

    Status.Row.encode(struct!(status, changes))
  end

  test "a robot is found by its properties, and by those that say/2 added" do
    profile = Hal.Profile.atrv_mini()
    for {id, options} <- [ab1: [], ab2: [profile: profile]], do: robot(id, options)
    eventually(fn -> Swarm.find(robot: [:ab1, :ab2]) == [:ab1, :ab2] end)
    assert Swarm.find(robot: [:ab1, :ab2], profile: :atrv_mini) == [:ab2]

    assert Swarm.find(robot: :ab1, service: :drive, calibrated: true, state: :idle, mission: nil) ==
             [:ab1]

    assert Swarm.find(robot: "ab1", battery: 11..14) == []
    assert Swarm.find(service: :submarine) == []
    assert :ab1 in Swarm.find()

    assert RobotInfo.say(:ab1, services: [:gripper]) == :ok
    assert RobotInfo.say(:ab1, calibrated: false) == :ok
    eventually(fn -> Swarm.find(service: :gripper, calibrated: false) == [:ab1] end)

    # A responder is found while it runs.
    responder =
      start_supervised!({Agent, fn -> Names.register(:ab1, {:service, :power}, nil) end})

    eventually(fn -> Swarm.find(service: :power) == [:ab1] end)
    stop_supervised!(Agent)
    refute Process.alive?(responder)
    eventually(fn -> Swarm.find(service: :power) == [] end)

    # It is written on each change, not only once a second.
    :ok = Swarm.start(robots: [:ab2])
    eventually(fn -> Swarm.find(robot: :ab2, mission: :stand_mission) == [:ab2] end, 900)
    send(Names.whereis(:ab1, :drive), {:readings, [{:power, 12.5}]})
    eventually(fn -> Swarm.find(robot: :ab1, battery: {11.5, 14.0}) == [:ab1] end)
    assert Swarm.find(robot: :ab1, battery: &(&1 > 13)) == []

    assert {:ok, %RobotInfo{battery: 12.5, node: node, services: services}} =
             RobotInfo.of(:ab1, 2_000)

    assert node == node()
    assert :gripper in services and :drive in services
  end

  test "bad options are an error of one line that says what is allowed" do
    for bad <- [
          :camera,
          [1],
          [srevice: :camera],
          [battery: :full],
          [battery: 14..11//-1],
          [calibrated: 1],
          [profile: 3],
          [max_age_ms: -1],
          [state: [:a | :b]]
        ] do
      assert {:error, line} = Swarm.find(bad)
      refute line =~ "\n"
    end

    assert {:error, line} = Swarm.find(srevice: :camera)
    assert line =~ "did you mean service?"
    assert {:error, line} = RobotInfo.say(:ab1, wheels: 4)
    assert line =~ "calibrated"
    assert {:error, _} = RobotInfo.say(:nobody_here, calibrated: false)
    assert {:error, _} = RobotInfo.say(:ab1, 5)
  end

  test "a subscriber is notified of robots that join and leave, until it unsubscribes" do
    assert {:ok, there} = Swarm.subscribe()
    refute :ab5 in there
    robot(:ab5)
    assert_receive {:swarm, {:join, :ab5, %RobotInfo{robot: :ab5, node: node}}}
    assert node == node()
    assert {:ok, there} = Swarm.subscribe()
    assert :ab5 in there
    stop_supervised!(:ab5)
    assert_receive {:swarm, {:leave, :ab5, :left}}
    assert Swarm.unsubscribe() == :ok
    robot(:ab6)
    {:ok, there} = Presence.subscribe(spawn(fn -> :ok end))
    assert :ab6 in there
    # Robots of earlier tests may still be leaving when this one subscribes.
    refute_received {:swarm, {_, :ab6, _}}
    assert {:error, line} = Swarm.subscribe(:me)
    assert line =~ "process"
  end

  test "a directory that restarts makes nobody leave" do
    robot(:ab7)
    {:ok, _} = Swarm.subscribe()
    fell(Directory, Process.whereis(Directory))
    # Those that are back after it are not reported as joined either.
    eventually(fn -> Directory.whereis(:ab7) end)
    send(Presence, :settled)
    {:ok, there} = Swarm.subscribe()
    assert :ab7 in there
    refute_received {:swarm, {_, :ab7, _}}
    robot(:ab8)
    assert_receive {:swarm, {:join, :ab8, _}}
  end

  defp fell(name, pid) do
    ref = Process.monitor(pid)
    Process.exit(pid, :kill)
    assert_receive {:DOWN, ^ref, :process, _, :killed}
    eventually(fn -> Process.whereis(name) end)
  end

  test "a robot that does not answer is shown from its row, with its age" do
    since_ms = System.monotonic_time(:millisecond)
    told(:ab9, :status, status_row(:ab9, pose: Pose.new(1, 2), speed: 0.31), 1_000)

    assert %Status{from: :row, state: :follow, hears: [:ab2], view: {3, [:ab9, :ab2, :ab3]}} =
             status = Swarm.status(:ab9)

    # Its own age, what the way may have taken, and what has passed here.
    assert status.age_ms in 1_040..(1_100 + System.monotonic_time(:millisecond) - since_ms)

    assert inspect(status) =~
             ~r/^#ab9 follow \(1.00, 2.00, 0 deg\) 0.31 m\/s, view 3, hears 1 but not ab3, age \d+ ms by its row$/

    assert Enum.any?(Swarm.status(), &match?(%Status{robot: :ab9, from: :row}, &1))
    assert inspect(Swarm.matrix()) =~ ~r/ab9.*x.* 3: ab9 ab2 ab3, \d{4,} ms ago/

    # A robot long silent is not present, but still known by name.
    told(:ab10, :status, status_row(:ab10), 60_000)
    refute Enum.any?(Swarm.status(), &(&1.robot == :ab10))
    assert %Status{from: :row} = Swarm.status("ab10")
    assert {:error, _} = Swarm.status(:ab_never)
  end

  test "senseless rows are not shown to anybody, and crash nobody" do
    good = status_row(:ab11)
    assert {:ok, _} = Status.Row.decode(:ab11, good, 0)

    for {key, bad} <- [
          state: 1,
          pose: {1.5, 2, 3},
          hears: nil,
          view: {1},
          view: {1, [1 | 2]},
          deaf_to: [:x],
          speed: 1.5,
          limits: nil,
          power: "x",
          age_ms: "x",
          rejected: nil,
          arming: "armed?",
          arming: :disarmed
        ],
        row = Map.put(good, key, bad),
        row != good and key != :hears,
        do: assert(Status.Row.decode(:ab11, row, 0) == :error)

    for junk <- [nil, %{}, [], "x", {1, 2}],
        do: assert(Status.Row.decode(:ab11, junk, 0) == :error)

    for {arming, shown} <-
          [disarmed: :disarmed, armed: nil] ++ [{{:error, :eio}, {:error, :unknown}}] do
      row = status_row(:ab11, arming: arming)
      assert {:ok, %{arming: ^shown}} = Status.Row.decode(:ab11, row, 0)
    end

    told(:ab11, :status, %{state: "follow"})
    assert {:error, _} = Swarm.status(:ab11)
    told(:ab11, :about, :junk)
    assert RobotInfo.of(:ab11, :infinity) == :error
  end

  test "both rows of a robot among thirty fit one datagram" do
    names = for n <- 1..30, do: :"mag#{n}"

    row =
      status_row(:mag1,
        hears: tl(names),
        view: {100, names},
        limits: [:sonar, :bumpers],
        by: :track_blob
      )

    bytes =
      for value <- [row, Map.from_struct(%RobotInfo{robot: :mag1})],
          do: byte_size(Blackboard.Codec.encode(:status, value))

    assert Enum.sum(bytes) < 1_100
    assert {:ok, %{hears: hears}} = Status.Row.decode(:mag1, row, 0)
    assert hears == tl(names)
  end
end
