defmodule Record.LidarTest do
  @moduledoc "What a recording holds of a robot with a lidar."
  use ExUnit.Case, async: true
  alias Hal.{Pose, Profile, Scan}
  alias Record.Recording
  alias Record.Recording.Drawing
  alias Robot.Percept
  alias Robot.Percept.Snapshot

  defp percept(body) do
    rays = for k <- 0..359, into: <<>>, do: Scan.pack(if(k < 10, do: 1.0))
    scan = %Scan{start: 0.0, step: :math.pi() / 180, ranges: rays}
    raw = %Percept{robot: :rex, at_ms: 100, profile: body, pose: Pose.new(2, 0)}

    Snapshot.build(raw, fn key, _limit_ms ->
      if key == :scan, do: {:ok, scan, 100}, else: :error
    end)
  end

  test "its body is written once, also with its beams, and read again as it was" do
    body = %{Profile.magellan() | scan: Profile.scan()}
    robots = %{rex: %{offset_ms: 0, profile: body}}
    entry = {:rex, {:executive, :input, {:tick, percept(body)}, 100}}
    {bytes, _names} = Recording.trace([entry], robots, MapSet.new())
    assert Recording.read_trace(bytes, robots) == {:ok, [entry]}

    # Of another body all is written.
    other = {:rex, {:executive, :input, {:tick, percept(%{body | radius: 0.3})}, 100}}
    {more, _names} = Recording.trace([other], robots, MapSet.new())
    assert byte_size(more) > byte_size(bytes) + 100
    assert Recording.read_trace(more, robots) == {:ok, [other]}
  end

  test "other programs are shown the ends of its beams" do
    body = %{Profile.magellan() | scan: Profile.scan()}
    scene = 0 |> Drawing.scene(percept(body), "idle", nil) |> IO.iodata_to_binary()
    # One ray in ten degrees has an echo: one beam, 1 m ahead and a little to the left.
    assert scene =~ ~s("id":"heard")

    assert [_, x, y] =
             Regex.run(~r/"spheres":\[{"pose":{"position":{"x":([^,]*),"y":([^,]*),/, scene)

    assert_in_delta String.to_float(x), 3.0, 0.01
    assert_in_delta String.to_float(y), :math.sin(:math.pi() / 36), 0.01

    scene = 0 |> Drawing.scene(percept(Profile.magellan()), "idle", nil) |> IO.iodata_to_binary()
    refute scene =~ "heard"
  end
end
