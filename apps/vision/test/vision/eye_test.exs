defmodule Vision.EyeTest do
  use ExUnit.Case, async: true
  alias Hal.Frame
  alias Vision.{Colours, Eye}

  setup do
    {:ok, colours} =
      Colours.new([%{name: "Yellow", y: {170, 240}, u: {60, 90}, v: {130, 145}}], min_area: 2)

    eye = start_supervised!({Eye, colours: colours, sink: {Kernel, :send, [self()]}})
    %{eye: eye, colours: colours}
  end

  defp frame(at_ms) do
    {:ok, frame} = Frame.new(:yuyv, 2, 1, <<200, 70, 200, 140>>, at_ms)
    %{frame | pan: 0.5}
  end

  test "blobs go to the sink with the time and direction of the frame", %{eye: eye} do
    :ok = Eye.frame(eye, {:frame, frame(7)})
    assert_receive {:blobs, [%{colour: "Yellow", area: 2}], %{at_ms: 7, pan: 0.5, tilt: tilt}}
    assert tilt == 0.0
  end

  test "only the newest frame of those that wait is read", %{eye: eye} do
    :sys.suspend(eye)
    for at_ms <- 1..20, do: Eye.frame(eye, frame(at_ms))
    :sys.resume(eye)
    assert_receive {:blobs, _, %{at_ms: 20}}
    assert %{read: 1, dropped: 19} = Eye.status(eye)
    refute_received {:blobs, _, _}
  end

  test "wrong frames are counted and give nothing", %{eye: eye} do
    Eye.frame(eye, %{frame(1) | bytes: <<1>>})
    assert %{wrong: 1, last_error: {:bytes, 1, :expected, 4}} = Eye.status(eye)
    Eye.frame(eye, {:frame, :nonsense})
    assert %{wrong: 2, read: 0, last_error: :no_frame} = Eye.status(eye)
    Eye.frame(eye, {:health, :camera, {:online, 0}})
    refute_received {:blobs, _, _}
  end

  @tag if(System.find_executable("ffmpeg"), do: [], else: [skip: "ffmpeg is missing"])
  test "a camera's device feeds it, and its end or health is nothing to it", %{eye: eye} do
    source = "lavfi:color=color=0xDCCD5A:size=32x24:rate=50:duration=0.1"

    start_supervised!(
      {Hal.Device,
       kind: :camera,
       driver: {Hal.Camera.FFmpeg, source: source},
       sinks: [{Eye, :frame, [eye]}, {Kernel, :send, [self()]}]}
    )

    assert_receive {:blobs, [%{colour: "Yellow", share: 1.0}], _meta}, 10_000
    assert_receive {:health, :camera, {{:offline, :eof}, _since_ms}}, 10_000
    assert Eye.status(eye).wrong == 0
  end

  test "wrong options are named", %{colours: colours} do
    assert_raise ArgumentError, ~r/:colours/, fn -> Eye.start_link(sink: {Kernel, :send, []}) end

    assert_raise ArgumentError, ~r/:sink/, fn ->
      Eye.start_link(colours: colours, sink: self())
    end

    assert_raise ArgumentError, ~r/:size/, fn -> Eye.start_link(size: 3) end
  end
end
