defmodule Robot.Devices.LogTest do
  use ExUnit.Case, async: true
  alias Robot.Devices.Log
  doctest Robot.Devices.Log

  @drive %{robot: :mag1, device: :drive}

  test "a lost line is an error, wheels that were disarmed by nobody a warning" do
    lost =
      Map.merge(@drive, %{
        state: {:error, :unplugged},
        was: :armed,
        why: nil,
        line: "x: unplugged"
      })

    assert {:error, "mag1: drive: LINE LOST while the wheels turned (x: unplugged)" <> _} =
             Log.line(:arming, lost)

    stale = Map.merge(@drive, %{state: :disarmed, was: :armed, why: "no sonar", line: nil})
    assert Log.line(:arming, stale) == {:warning, "mag1: drive disarmed: no sonar"}
  end

  test "what a person did, and what was never there, is no news" do
    for change <- [
          %{state: :armed, was: :disarmed, why: nil, line: nil},
          %{state: :disarmed, was: :armed, why: nil, line: nil},
          %{state: :disarmed, was: :disarmed, why: "angle is missing", line: nil},
          %{state: :disarmed, was: {:error, :eio}, why: nil, line: nil}
        ],
        do: assert(Log.line(:arming, Map.merge(@drive, change)) == nil)

    assert Log.line(:online, Map.put(@drive, :again?, false)) == {:debug, "mag1: drive online"}
  end

  test "what hangs is one line when it is noticed, and one when it is over" do
    about = %{robot: :mag1, behaviour: Acts.Hang, line: "Acts.Hang"}
    assert Log.line(:silent, about) == {:warning, "mag1 hangs in Acts.Hang"}
    assert Log.line(:again, about) == {:info, "mag1 no longer hangs in Acts.Hang"}

    assert Log.line(:hung, about) ==
             {:error, "mag1 hung in Acts.Hang for 2 s: started again, idle"}
  end

  test "what would be found out only when it is needed is told: the stop's file, pictures, a second robot" do
    for event <- [
          [:robot, :estop_file, :error],
          [:vision, :saver, :failed],
          [:robot, :recorder, :failed],
          [:swarm, :comms, :duplicate_id],
          [:swarm, :comms, :unique_id]
        ],
        do: assert(event in Log.events())

    file = %{robot: :mag1, file: "/var/estop", reason: :eacces}
    assert {:error, "mag1: the e-stop file /var/estop is not as" <> line} = Log.line(:error, file)
    assert line =~ "permission denied"
    why = "no pictures are saved in /p: no space left on device"
    assert Log.line(:failed, %{folder: "/p", line: why}) == {:warning, why}
    twice = %{robot: :mag1, other: :mag1@lab}

    assert {:error, "mag1: a robot of this name was on mag1@lab" <> _} =
             Log.line(:duplicate_id, twice)

    assert {:warning, "mag1: no other robot of this name" <> _} =
             Log.line(:unique_id, %{robot: :mag1})
  end

  test "a robot whose numbers are impossible is named, with what is allowed; other stages are not logged" do
    assert [:robot, :stage] in Log.events()

    about = %{robot: :mag1, stage: :refused, from: :mag9, epoch: 500_000_000, allowed: 1_000_007}

    assert {:warning, "mag1: mag9 says epoch 500000000, " <> line} = Log.line(:stage, about)
    assert line =~ "at most 1000007 is allowed"
    crash = %{robot: :mag1, stage: :crashed, crash: "(RuntimeError) boom, lib/gather.ex:42"}

    assert Log.line(:stage, crash) ==
             {:error, "mag1 crashed, and is idle: (RuntimeError) boom, lib/gather.ex:42"}

    assert Log.line(:stage, %{robot: :mag1, stage: :elected, epoch: 1, size_ppm: 9}) == nil
  end
end
