defmodule Vision.BlobDetectorTest do
  use ExUnit.Case, async: true
  alias Hal.Frame
  alias Vision.Backend.Native
  alias Vision.{BlobDetector, Colours, Detections}
  @moduletag :realtime

  setup do
    {:ok, colours} =
      Colours.new([%{name: "Yellow", y: {170, 240}, u: {60, 90}, v: {130, 145}}], min_area: 2)

    detector =
      start_supervised!({BlobDetector, colours: colours, sink: {Kernel, :send, [self()]}})

    %{detector: detector, colours: colours}
  end

  defp frame(at_ms) do
    {:ok, frame} = Frame.new(:yuyv, 2, 1, <<200, 70, 200, 140>>, at_ms)
    %{frame | pan: 0.5}
  end

  test "blobs go to the sink with the time and direction of the frame", %{detector: detector} do
    :ok = BlobDetector.frame(detector, {:frame, frame(7)})
    assert_receive {:detections, %Detections{at_ms: 7, pan: 0.5} = seen}
    assert [%{colour: "Yellow", area: 2}] = seen.blobs
    assert {seen.tilt, seen.field_of_view, seen.pose} == {0.0, nil, nil}
  end

  test "only the newest frame of those that wait is read", %{detector: detector} do
    :sys.suspend(detector)
    for at_ms <- 1..20, do: BlobDetector.frame(detector, frame(at_ms))
    :sys.resume(detector)
    assert_receive {:detections, %{at_ms: 20}}
    assert %{read: 1, dropped: 19} = BlobDetector.status(detector)
    refute_received {:detections, _}
  end

  test "it searches all its frames in the same memory", %{detector: detector} do
    {Native, scratch} = :sys.get_state(detector).scratch
    assert Native.held(scratch) == 0
    {:ok, wide} = Frame.new(:yuyv, 64, 1, String.duplicate(<<200, 70, 200, 140>>, 32), 1)

    for frame <- [wide, frame(2), wide] do
      BlobDetector.frame(detector, frame)
      assert_receive {:detections, %{blobs: [_]}}
      assert {Native, ^scratch} = :sys.get_state(detector).scratch
      assert Native.held(scratch) >= 64 * 34
    end
  end

  defmodule Phantoms do
    @moduledoc "A backend that also finds what is larger than the picture."
    @behaviour Vision.Backend
    @impl Vision.Backend
    def reads?(_format), do: true
    @impl Vision.Backend
    def regions(_frame, _colours),
      do: {:ok, [{0, 1, 0, 0, 0, 0, 0, 0}, {0, 113_240, 0, 0, 0, 0, 22_647, 4}]}
  end

  test "what cannot be in a picture is not passed on, whatever finds it", %{colours: colours} do
    options = [colours: colours, backend: Phantoms, sink: {Kernel, :send, [self()]}]
    detector = start_supervised!({BlobDetector, options}, id: :phantoms)
    :ok = BlobDetector.frame(detector, frame(7))
    assert_receive {:detections, %Detections{at_ms: 7, blobs: [%{area: 1}]}}
  end

  test "wrong frames are counted and give nothing", %{detector: detector} do
    BlobDetector.frame(detector, %{frame(1) | bytes: <<1>>})
    assert %{wrong: 1, last_error: {:bytes, 1, :expected, 4}} = BlobDetector.status(detector)
    BlobDetector.frame(detector, {:frame, :nonsense})
    assert %{wrong: 2, read: 0, last_error: :no_frame} = BlobDetector.status(detector)
    BlobDetector.frame(detector, {:health, :camera, {:online, 0}})
    refute_received {:detections, _}
  end

  @tag if(System.find_executable("ffmpeg"), do: [], else: [skip: "ffmpeg is missing"])
  test "a camera's device feeds it, and its end or health is nothing to it", %{detector: detector} do
    source = "lavfi:color=color=0xDCCD5A:size=32x24:rate=50:duration=0.1"

    start_supervised!(
      {Hal.Device,
       kind: :camera,
       driver: {Hal.Camera.FFmpeg, source: source},
       sinks: [{BlobDetector, :frame, [detector]}, {Kernel, :send, [self()]}]}
    )

    assert_receive {:detections, %{blobs: [%{colour: "Yellow", share: 1.0}]}}, 10_000
    assert_receive {:health, :camera, {{:offline, :eof}, _since_ms}}, 10_000
    assert BlobDetector.status(detector).wrong == 0
  end

  describe "on a pan-tilt unit" do
    setup %{colours: colours} do
      sink = {Kernel, :send, [self()]}
      clock = {__MODULE__, :time, [start_supervised!({Agent, fn -> 1_000 end})]}
      options = [colours: colours, sink: sink, ptz: true, clock: clock]

      %{
        detector: start_supervised!({BlobDetector, options}, id: :detector_on_ptz),
        clock: List.first(elem(clock, 2))
      }
    end

    defp looks(detector, clock, at_ms, pan) do
      Agent.update(clock, fn _ -> at_ms end)
      BlobDetector.aim(detector, {:ptz, %{pan: pan, tilt: 0.1, field_of_view: 0.8}})
      # It has taken the time by now.
      BlobDetector.status(detector)
    end

    test "a frame that does not know where it looked gets what held when it was taken", context do
      %{detector: detector, clock: clock} = context
      looks(detector, clock, 1_000, 0.0)
      looks(detector, clock, 1_100, 0.4)
      BlobDetector.frame(detector, %{frame(1_050) | pan: nil})
      assert_receive {:detections, %{at_ms: 1_050, blobs: [_]} = seen}
      assert_in_delta seen.pan, 0.2, 1.0e-9
      assert_in_delta seen.tilt, 0.1, 1.0e-9
      assert_in_delta seen.field_of_view, 0.8, 1.0e-9
      # One that knows is taken at its word.
      BlobDetector.frame(detector, frame(1_060))
      assert_receive {:detections, %{at_ms: 1_060, blobs: [_], pan: 0.5, field_of_view: nil}}
    end

    test "nobody knows where it looked: no blobs, which is not the same as none seen", context do
      %{detector: detector, clock: clock} = context
      BlobDetector.frame(detector, %{frame(1_000) | pan: nil})
      assert %{wrong: 1, last_error: :no_aim} = BlobDetector.status(detector)
      looks(detector, clock, 1_000, 0.3)
      BlobDetector.aim(detector, {:health, :ptz, {:online, 0}})
      BlobDetector.frame(detector, %{frame(1_900) | pan: nil})
      assert_receive {:detections, %{at_ms: 1_900, blobs: [_], pan: 0.3}}
      BlobDetector.frame(detector, %{frame(2_001) | pan: nil})
      assert %{wrong: 2} = BlobDetector.status(detector)
      refute_received {:detections, _}
    end

    test "readings that wait behind a frame are heard before it is looked at", context do
      %{detector: detector, clock: clock} = context
      looks(detector, clock, 1_000, 0.0)
      Agent.update(clock, fn _ -> 1_100 end)
      :sys.suspend(detector)
      BlobDetector.frame(detector, %{frame(1_050) | pan: nil})
      BlobDetector.aim(detector, {:ptz, %{pan: 0.4, tilt: 0.1, field_of_view: 0.8}})
      :sys.resume(detector)
      assert_receive {:detections, %{blobs: [_], pan: pan}}
      assert_in_delta pan, 0.2, 1.0e-9
    end
  end

  def time(agent), do: Agent.get(agent, & &1)

  @tag if(System.find_executable("ffmpeg"), do: [], else: [skip: "ffmpeg is missing"])
  test "pictures of ffmpeg bear the direction of a unit that turns meanwhile", context do
    sink = {Kernel, :send, [self()]}
    options = [colours: context.colours, sink: sink, ptz: true]
    detector = start_supervised!({BlobDetector, options}, id: :turning)
    # 0.5 rad/s, told each 50 ms, from before the first picture on.
    begun_ms = System.monotonic_time(:millisecond)
    pan = fn at_ms -> (at_ms - begun_ms) / 2_000 end

    tell = fn ->
      reading = %{pan: pan.(System.monotonic_time(:millisecond)), tilt: 0.0, field_of_view: 0.8}
      BlobDetector.aim(detector, {:ptz, reading})
    end

    tell.()
    {:ok, timer} = :timer.apply_interval(50, Kernel, :apply, [tell, []])

    start_supervised!(
      {Hal.Device,
       kind: :camera,
       driver:
         {Hal.Camera.FFmpeg, source: "lavfi:color=color=0xDCCD5A:size=32x24:rate=25:duration=5"},
       sinks: [{BlobDetector, :frame, [detector]}]}
    )

    seen = until_turned([])
    :timer.cancel(timer)

    for detections <- seen, do: assert_in_delta(detections.field_of_view, 0.8, 1.0e-9)

    # A busy machine hands some readings on late; with the newest reading instead of the direction
    # between two, half of the pictures would be wrong by more than 0.0125 rad.
    wrong = for %{pan: told, at_ms: at_ms} <- seen, do: abs(told - pan.(at_ms))
    assert Enum.at(Enum.sort(wrong), div(length(wrong), 2)) < 0.01
  end

  # The pictures, ten at least, until the unit has turned by 0.1 rad. A busy machine delivers the
  # first ones together.
  defp until_turned(seen) do
    assert_receive {:detections, %{blobs: [_], pan: pan} = detections}, 10_000
    seen = seen ++ [detections]

    if length(seen) >= 10 and pan > hd(seen).pan + 0.1,
      do: seen,
      else: until_turned(seen)
  end

  test "wrong options are named", %{colours: colours} do
    assert_raise ArgumentError, ~r/option colours: /, fn ->
      BlobDetector.start_link(sink: {Kernel, :send, []})
    end

    assert_raise ArgumentError, ~r/option sink: /, fn ->
      BlobDetector.start_link(colours: colours, sink: self())
    end

    assert_raise ArgumentError, ~r/:size/, fn -> BlobDetector.start_link(size: 3) end

    assert_raise ArgumentError, ~r/option ptz: /, fn ->
      BlobDetector.start_link(colours: colours, sink: {Kernel, :send, []}, ptz: 3)
    end
  end
end
