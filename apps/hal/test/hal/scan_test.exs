defmodule Hal.ScanTest do
  use ExUnit.Case, async: true
  alias Hal.{Pose, Profile, Scan}

  doctest Hal.Scan

  @lidar %{Profile.scan() | max: 8.0}

  defp scan(ranges, start \\ -:math.pi()) do
    rays = for range <- ranges, into: <<>>, do: Scan.pack(range)
    %Scan{start: start, step: 2 * :math.pi() / length(ranges), ranges: rays}
  end

  test "a beam has the nearest ray of its sector, wherever a turn begins and in either sense" do
    # A turn of 360 rays whose range says their direction: of half a degree to 359.5.
    start = :math.pi() / 360
    up = for degree <- 0..359, do: 1.0 + degree / 100
    beams = Scan.beams(scan(up, start), @lidar)
    # The first beam begins behind, where the 180th ray is.
    assert Enum.take(beams, 2) == [2.8, 2.9]
    assert Enum.at(beams, 18) == 1.0
    assert length(beams) == 36

    down = %{scan(Enum.reverse(up), 2 * :math.pi() - start) | step: -:math.pi() / 180}
    assert Scan.beams(down, @lidar) == beams
    turned = Enum.drop(up, 77) ++ Enum.take(up, 77)
    assert Scan.beams(scan(turned, start + 77 * :math.pi() / 180), @lidar) == beams
  end

  test "what was not measured is not free, what surely is nothing is, and an echo counts among both" do
    rays = fn first, others -> scan([first | List.duplicate(others, 359)]) end
    assert Enum.uniq(Scan.beams(rays.(nil, nil), @lidar)) == [nil]
    assert Enum.uniq(Scan.beams(rays.(:silent, :silent), @lidar)) == [8.0]
    assert [0.5 | nothing] = Scan.beams(rays.(0.5, nil), @lidar)
    assert Enum.uniq(nothing) == [nil]
    assert [8.0 | _] = Scan.beams(rays.(8.5, nil), @lidar)
    # Something touches it.
    assert [0.05 | _] = Scan.beams(rays.(0.05, :silent), @lidar)
    assert Enum.all?(Scan.beams(%Scan{start: 0.0, step: 0.1, ranges: <<>>}, @lidar), &is_nil/1)
  end

  test "its beams look where its rays look, from where the lidar is" do
    mount = Pose.new(0.1, 0.05, 0.3)
    body = %{Profile.magellan() | scan: %{@lidar | pose: mount, field_of_view: :math.pi()}}
    %{sonars: sonars, sonar_cone: cone} = ring = Scan.ring(body)
    assert {length(sonars), ring.sonar_min, ring.sonar_max} == {18, 0.15, 8.0}
    assert_in_delta cone, :math.pi() / 18, 1.0e-9

    for {direction, k} <- Enum.with_index([-1.5, -0.02, 0.02, 1.5]) do
      one = %Scan{start: direction, step: 0.1, ranges: <<1000::16>>}
      [{beam, 1.0}] = sonars |> Enum.zip(Scan.beams(one, body.scan)) |> Enum.filter(&elem(&1, 1))
      assert Pose.point(beam) == Pose.point(mount)
      assert abs(Pose.wrap(beam.heading - 0.3 - direction)) <= cone / 2 + 1.0e-9, "#{k}"
    end

    behind = %Scan{start: 3.0, step: 0.1, ranges: <<1000::16>>}
    assert Enum.all?(Scan.beams(behind, body.scan), &is_nil/1)
    assert Scan.ring(Profile.magellan()) == Profile.magellan()
  end

  test "what a driver of a user may send is whole or it is not" do
    assert Scan.whole?(scan([1.0, nil]))

    for odd <- [
          nil,
          %{},
          %Scan{start: 0, step: 0.1, ranges: <<>>},
          %Scan{start: 0.0, step: 0.1, ranges: <<1>>}
        ],
        do: refute(Scan.whole?(odd))
  end
end
