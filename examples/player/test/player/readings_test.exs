defmodule Player.ReadingsTest do
  @moduledoc "What a robot measures as bytes of Player's messages, read as the protocol has them."
  use ExUnit.Case, async: true
  alias Console.About
  alias Hal.{Pose, Profile, Scan}
  alias Player.{Client, Devices, Readings, Session}

  @lidar %{Profile.scan() | rays: 4, max: 8.0}
  @profile %{Profile.magellan() | scan: @lidar}
  @body %{profile: @profile, sonars: @profile.sonars, pictures?: true}

  defp about(readings, more \\ %{}) do
    About.nothing()
    |> Map.merge(%{pose: [1.0, 2.0], heading: 0.5, speed: 0.25, turn: -0.5, estop: false})
    |> Map.merge(%{readings: readings, profile: @profile})
    |> Map.merge(more)
  end

  defp payload(device, about) do
    with bytes when bytes != nil <- Readings.about({:mag1, device}, 1_500_000_000, about) do
      <<_interface::32, _index::32, 1::32, 1::32, 1.5::float, 0::32, size::32,
        payload::binary-size(size)>> = IO.iodata_to_binary(bytes)

      payload
    end
  end

  test "where it is, and that it stalls while it is held" do
    moving = payload({:position2d, 0}, about(%{}))

    assert Client.position(moving) ==
             %{x: 1.0, y: 2.0, yaw: 0.5, vx: 0.25, va: -0.5, stall: 0}

    for held <- [%{estop: true}, %{fault: "a bumper stays pressed"}],
        do: assert(Client.position(payload({:position2d, 0}, about(%{}, held))).stall == 1)

    assert payload({:position2d, 0}, about(%{}, %{pose: nil})) == nil
  end

  test "infrareds, bumpers and the battery" do
    assert <<2::32, 2::32, 0::64, 2::32, 2::32, 0.5::float-32, 0.25::float-32>> =
             payload({:ir, 0}, about(%{ir: [0.5, 0.25]}))

    assert <<2::32, 2::32, 0.5::float, 0.25::float>> =
             payload({:ranger, 1}, about(%{ir: [0.5, 0.25]}))

    assert <<16::32, 16::32, 1, 0, 0, 1, 0::96>> =
             payload({:bumper, 0}, about(%{bumpers: [0, 3]}))

    assert <<1::32, 24.5::float-32, 0::128>> = payload({:power, 0}, about(%{}, %{power: 24.5}))
    assert payload({:power, 0}, about(%{})) == nil
    assert payload({:ir, 0}, about(%{})) == nil
  end

  test "sonars of a robot elsewhere are those that it was asked for" do
    beams = %{sonar: [[0.2, 0.0, 0.0, 1.5], [0.0, 0.2, 1.57, 2.5]]}

    assert <<2::32, 2::32, 1.5::float-32, 2.5::float-32>> =
             payload({:sonar, 0}, about(%{}, beams))

    body = %{profile: nil, sonars: [Pose.new(0.2, 0), Pose.new(0, 0.2, 1.57)], pictures?: false}

    assert {:ok, %{poses: [{0.2, +0.0, +0.0, +0.0, +0.0, +0.0}, _left]}} =
             Devices.answer({:sonar, 0}, 1, body)

    assert {:ok, %{size: {+0.0, +0.0, +0.0}}} = Devices.answer({:position2d, 0}, 1, body)
  end

  # Ahead, to the left, behind, to the right: from behind on.
  test "a lidar's turn begins behind, and goes to the left, whichever way the driver names its rays" do
    quarter = :math.pi() / 2

    turn = fn start, step, list ->
      %Scan{start: start, step: step, ranges: for(mm <- list, into: "", do: <<mm::16>>)}
    end

    for scan <- [
          turn.(0.0, quarter, [1_000, 2_000, 65_535, 0]),
          turn.(0.0, -quarter, [1_000, 0, 65_535, 2_000]),
          turn.(-2 * quarter, quarter, [65_535, 0, 1_000, 2_000])
        ] do
      <<least::float-32, most::float-32, step::float-32, 8.0::float-32, 4::32, 4::32,
        8.0::float-32, 0::32, 1.0::float-32, 2.0::float-32, 0::32, 0::32,
        0::32>> = payload({:laser, 0}, about(%{scan: scan}))

      assert_in_delta least, -2 * quarter, 1.0e-6
      assert_in_delta most, quarter, 1.0e-6
      assert_in_delta step, quarter, 1.0e-6

      assert <<4::32, 4::32, 8.0::float, 0::64, 1.0::float, 2.0::float>> =
               payload({:ranger, 2}, about(%{scan: scan}))
    end
  end

  test "a lidar that sees half a turn begins to the right" do
    scan = %Scan{start: -1.0, step: 1.0, ranges: <<1_000::16, 2_000::16, 3_000::16>>}

    assert <<-1.0::float-32, 1.0::float-32, 1.0::float-32, _most::32, 3::32, 3::32, 1.0::float-32,
             _::binary>> = payload({:laser, 0}, about(%{scan: scan}))
  end

  test "where the camera looks, and what it sees" do
    ptz = %{pan: 0.5, tilt: -0.25, field_of_view: 1.0}

    assert <<0.5::float-32, -0.25::float-32, 1.0::float-32, 0::96>> =
             payload({:ptz, 0}, about(%{ptz: ptz}))

    blob = %Vision.Blob{
      colour: "YellowLandmark",
      area: 12,
      share: 0.1,
      x: 10.4,
      y: 20.6,
      left: 8,
      top: 18,
      right: 12,
      bottom: 22,
      width: 160,
      height: 120,
      distance: 1.5
    }

    seen = %Vision.Detections{at_ms: 0, blobs: [blob]}

    assert <<160::32, 120::32, 1::32, 1::32, _id::32, 0xFFFF00::32, 12::32, 10::32, 21::32, 8::32,
             12::32, 18::32, 22::32,
             1.5::float-32>> = payload({:blobfinder, 0}, about(%{detections: seen}))

    assert <<320::32, 240::32, 0::64>> =
             payload({:blobfinder, 0}, about(%{detections: %{seen | blobs: []}}))

    mark = %Vision.Mark{
      family: :tag36h11,
      id: 7,
      at_ms: 0,
      x: 0.0,
      y: 0.0,
      corners: [],
      width: 2,
      height: 2,
      range: 2.0,
      bearing: :math.pi() / 2,
      range_sd: 0.1
    }

    far = %{mark | range: nil, bearing: nil}
    marks = payload({:fiducial, 0}, about(%{detections: %{seen | marks: [mark, far]}}))

    assert <<1::32, 1::32, 7::32, x::float, 2.0::float, _place::binary-size(32), 0.1::float,
             _sd::binary-size(40)>> = marks

    assert abs(x) < 1.0e-9
  end

  test "how sure it is of its place, as a covariance" do
    sure = %{uncertainty: %{radius: 0.2447746830680816, heading: 0.02}}

    <<0::32, 0::64, 1::32, 1::32, 1.0::float, 2.0::float, 0.5::float, x2::float, y2::float,
      a2::float, 0::64, 0::64, 0::64, 1.0::float>> = payload({:localize, 0}, about(sure))

    assert_in_delta x2, 0.01, 1.0e-6
    assert_in_delta y2, 0.01, 1.0e-6
    assert_in_delta a2, 0.0004, 1.0e-9
  end

  test "commands become orders of a person, each place once" do
    session = Session.new(:mag1, @body, {127, 0, 0, 1}, 6665)

    hear = fn session, device, subtype, payload ->
      Session.hear(session, Client.message(device, 2, subtype, payload), 0.0)
    end

    place = <<1.0::float, 2.0::float, 0.5::float, 0::64, 0::64, 0::64, 1::32>>
    {:ok, session, [order: "mag1 goto:1.0:2.0:0.5"]} = hear.(session, {4, 0}, 2, place)
    {:ok, session, []} = hear.(session, {4, 0}, 2, place)

    {:ok, session, [drive: 0.2, drive: +0.0]} =
      Session.hear(
        session,
        Client.message({4, 0}, 2, 1, <<0.2::float, 0::64, 0::64, 1::32>>),
        0.0
      )
      |> drives()

    {:ok, session, [order: _again]} = hear.(session, {4, 0}, 2, place)

    {:ok, session, [say: "hello"]} =
      hear.(session, {12, 0}, 1, <<6::32, 6::32, "hello", 0, 0, 0>>)

    {:ok, session, []} = hear.(session, {12, 0}, 1, <<1::32, 1::32, 7, 0, 0, 0>>)

    {:ok, _session, [order: "stop mag1"]} =
      Session.hear(session, Client.message({4, 0}, 3, 2, <<0::32>>), 0.0)
  end

  defp drives({:ok, session, [{:drive, ahead, left}]}),
    do: {:ok, session, [drive: ahead, drive: left]}
end
