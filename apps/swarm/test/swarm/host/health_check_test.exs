defmodule Swarm.Host.HealthCheckTest do
  use ExUnit.Case, async: true
  @moduletag :realtime
  use Swarm.Case
  alias Swarm.Host.HealthCheck

  doctest HealthCheck

  defp words(id, well?) do
    eventually(fn ->
      with {^well?, words} <- HealthCheck.of(id), do: words, else: (_not_yet -> nil)
    end)
  end

  test "a robot that works is well, and the check says how it is armed" do
    id = robot(:pulse_well)
    assert words(id, true) =~ "pulse_well is "
  end

  test "a robot that does not exist is not well" do
    assert HealthCheck.of(:pulse_none) == {false, "pulse_none is not there"}
  end

  test "a drive that is offline is reported, but the robot is well" do
    drive = {Hal.FakeDrive, test: self(), device: :drive, open: fn -> {:error, :enoent} end}
    id = robot(:pulse_away, drive: drive)
    assert words(id, true) == "pulse_away is there, and its drive is offline"
  end

  test "a gate or an executive that hangs is named" do
    for {id, part} <- [pulse_gate: :gate, pulse_mind: :executive] do
      id = robot(id)
      assert words(id, true)
      # It would start the executive again before a second is over.
      :ok = :sys.suspend(Names.whereis(id, :watch))
      :ok = :sys.suspend(Names.whereis(id, part))
      assert words(id, false) =~ "its #{part} has done nothing for 1."
      :ok = :sys.resume(Names.whereis(id, part))
      assert words(id, true)
    end
  end

  test "a drive that handles no messages is named, but it may be busy for a while" do
    id = robot(:pulse_drive)
    assert words(id, true)
    drive = Names.whereis(id, :drive)
    :ok = :sys.suspend(drive)
    for _ <- 1..150, do: send(drive, :nothing)
    assert {true, _words} = HealthCheck.of(id)
    for _ <- 1..51, do: send(drive, :nothing)
    assert words(id, false) =~ "its drive hangs, "
    :ok = :sys.resume(drive)
    assert words(id, true)
  end

  test "a drive that is gone, and a line that was lost" do
    well = [gate: 0, executive: 0]
    assert HealthCheck.judge(:mag1, well, nil, nil) == {false, "mag1: its drive is gone"}
    lost = %{state: {:error, :unplugged}, why: nil}
    assert {true, "mag1 has lost its line" <> _} = HealthCheck.judge(:mag1, well, 0, lost)
    why = %{state: :disarmed, why: "distance is missing"}

    assert HealthCheck.judge(:mag1, well, 0, why) ==
             {true, "mag1 is disarmed: distance is missing"}

    assert HealthCheck.judge(:mag1, [gate: 0, executive: nil], 0, nil) ==
             {false, "mag1: its executive has done nothing yet"}
  end
end
