defmodule Robot.CameraTest do
  @moduledoc "What the robot sees, and that it drives on when it does not."
  use Robot.Case, async: true
  @moduletag :realtime
  @moduletag :capture_log

  defp seeing(id, more \\ []) do
    {:ok, colours} =
      Vision.Colours.new([%{name: "Yellow", y: {170, 240}, u: {60, 90}, v: {130, 145}}],
        min_area: 2
      )

    goal = {:goal, :roll, {Acts.Roll, twist: Twist.new(0.1, 0.0)}}

    rolling(
      id,
      [
        camera: {Hal.FakeCamera, test: self(), device: :camera},
        colours: colours,
        mission: {Acts.Mission, test: self(), effects: [goal]}
      ] ++ more
    )
  end

  defp show(id, pan) do
    at_ms = System.monotonic_time(:millisecond)
    {:ok, frame} = Hal.Frame.new(:yuyv, 2, 1, <<200, 70, 200, 140>>, at_ms)
    send(Names.whereis(id, :camera), {:readings, [{:frame, %{frame | pan: pan}}]})
    at_ms
  end

  # A camera makes pictures one after the other: on a busy machine one may be too old by the next tick.
  defp percept(id, pan, pictures \\ 50) do
    at_ms = show(id, pan)

    receive do
      {:mission, {:tick, %{detections: %{at_ms: ^at_ms}} = percept}} -> percept
    after
      300 ->
        assert pictures > 1, "no picture of 50 came into the percept"
        percept(id, pan, pictures - 1)
    end
  end

  defp sees(id),
    do: assert(%{blobs: [%{colour: "Yellow"}], pan: 0.5} = percept(id, 0.5).detections)

  # The first percept without a picture, after one with.
  defp blind, do: assert_receive({:mission, {:tick, %{detections: nil}}})

  defp forget_ticks do
    receive do
      {:mission, {:tick, _}} -> forget_ticks()
    after
      0 -> :ok
    end
  end

  test "a picture becomes blobs in the percept, and then the next one is asked for" do
    id = seeing(:sight1)
    assert_receive {:camera, :next, camera}
    sees(id)
    assert_receive {:camera, :next, ^camera}
  end

  test "a camera that does not know where it looks gets it from its pan-tilt unit" do
    id = seeing(:sight_ptz, ptz: {Hal.FakePtz, test: self(), device: :ptz})
    looks = {:ptz, %{pan: 0.3, tilt: 0.1, field_of_view: 0.7}}
    send(Names.whereis(id, :ptz), {:readings, [looks]})

    # The unit's process has handed the reading on when it answers, and then the detector has it, too.
    _ = :sys.get_state(Names.whereis(id, :ptz))
    _ = Vision.BlobDetector.status(Names.via(id, :blob_detector))
    percept = percept(id, nil)
    assert {percept.detections.pan, percept.detections.field_of_view} == {0.3, 0.7}
    assert Robot.Percept.Sighting.field_of_view(percept) == 0.7
  end

  for fallen <- [:blob_detector, :camera] do
    test "#{fallen} is killed: blobs grow old, driving goes on, and it sees again" do
      id = seeing(:"sight_#{unquote(fallen)}")
      sees(id)
      roles = [:drive, :gate, :executive, :pilot]
      parts = parts(id, roles)
      old = kill(id, unquote(fallen))
      forget_ticks()
      blind()
      rolls()
      assert parts(id, roles) == parts
      assert Names.whereis(id, unquote(fallen)) != old
      sees(id)
    end
  end

  test "a camera that crashes rests, restarts alone, and sees again" do
    id = seeing(:sight4)
    assert_receive {:camera, :init, camera}
    parts = parts(id, [:blob_detector, :gate, :executive])
    send(camera, :raise)
    assert_receive {:camera, :init, other} when other != camera
    assert parts(id, [:blob_detector, :gate, :executive]) == parts
    assert_receive {:camera, :next, ^other}
    sees(id)
    {:ok, :online, _} = Board.fetch(Board.find!(id), {:health, :camera}, :infinity)
  end
end
