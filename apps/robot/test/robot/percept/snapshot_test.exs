defmodule Robot.Percept.SnapshotTest do
  use ExUnit.Case, async: true
  alias Hal.{Profile, Scan}
  alias Robot.Percept
  alias Robot.Percept.Snapshot

  defp percept(profile, entries) do
    Snapshot.build(%Percept{robot: :rex, at_ms: 1_000, profile: profile}, fn key, limit_ms ->
      case entries do
        %{^key => {value, age_ms}} when age_ms <= limit_ms -> {:ok, value, 1_000 - age_ms}
        _none -> :error
      end
    end)
  end

  test "a body hears by its sonars, or by the beams of its lidar, whose poses are in its profile" do
    sonar = List.duplicate(1.0, 16)
    scan = %Scan{start: -3.14, step: 0.0175, ranges: :binary.copy(<<2000::16>>, 360)}
    entries = %{sonar: {sonar, 100}, scan: {scan, 400}}

    assert %{sonar: ^sonar, profile: profile} = percept(Profile.magellan(), entries)
    assert profile == Profile.magellan()

    body = %{Profile.magellan() | scan: Profile.scan()}
    assert %{sonar: beams, profile: ring} = percept(body, entries)
    assert beams == List.duplicate(2.0, 36)
    assert ring == Scan.ring(body)
    assert length(ring.sonars) == 36

    assert %{sonar: nil, profile: ^ring} = percept(body, %{entries | scan: {scan, 501}})
    assert %{sonar: nil} = percept(Profile.magellan(), %{sonar: {sonar, 301}})
  end
end
