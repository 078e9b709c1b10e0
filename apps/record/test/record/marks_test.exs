defmodule Record.MarksTest do
  @moduledoc "Marks in recordings: to the byte among the inputs, as boxes and in words for viewers."
  use ExUnit.Case, async: true
  alias Record.Recording.{Drawing, Tick}

  @mark %Vision.Mark{
    family: :tag36h11,
    id: 7,
    at_ms: 40,
    x: 15.0,
    y: 10.0,
    corners: [{10.2, 5.0}, {20.7, 5.5}, {20.5, 15.9}, {10.0, 15.0}],
    width: 64,
    height: 48,
    range: 1.5,
    bearing: 0.25,
    yaw: nil,
    range_sd: 0.01,
    bearing_sd: 0.002
  }

  test "a tick with marks is packed and read again, and one without as before" do
    for marks <- [nil, [], [@mark]] do
      seen = %Vision.Detections{at_ms: 100, blobs: [], marks: marks}
      entries = [{:step, :mag1, {:detections, seen}, []}]
      assert entries |> Tick.pack() |> Tick.unpack() == {:ok, entries}
    end

    {_messages, [packed]} =
      Tick.pack([{:step, :mag1, {:detections, %Vision.Detections{at_ms: 1, blobs: []}}, []}])

    assert packed == {2, :mag1, 1, 0.0, 0.0, nil, nil, [], []}
  end

  test "viewers get their boxes with their numbers, and what was read" do
    seen = %Vision.Detections{at_ms: 100, blobs: [], marks: [@mark]}
    boxes = 0 |> Drawing.boxes(seen) |> IO.iodata_to_binary()
    assert boxes =~ "tag36h11 7"
    json = Drawing.blobs(seen)
    assert json =~ ~s("family":"tag36h11","id":7,"at_ms":40)
    assert json =~ ~s("range":1.5,"bearing":0.25,"yaw":null)
    refute Drawing.blobs(%{seen | marks: nil}) =~ "marks"
  end
end
