defmodule Hal.Camera.CameraCaseTest do
  @moduledoc "What must hold for every camera, at one that sends JPEG pictures over a socket."
  use ExUnit.Case, async: true
  alias Hal.Camera.FFmpeg
  alias Hal.{CameraCase, FaultyCamera, NetworkCamera}

  @moduletag :realtime
  @moduletag :capture_log
  @moduletag timeout: 600_000
  @moduletag if(System.find_executable("ffmpeg"), do: [], else: [skip: "ffmpeg is missing"])

  test "all rules hold for what ffmpeg reads" do
    driver = {FFmpeg, &[source: "unix://" <> &1, unsafe: true]}

    assert CameraCase.problems(driver, {NetworkCamera, []}, size: {64, 48}, format: :yuyv) == []
  end

  # A driver with one fault.
  defp faults(fault, rules) do
    driver = {FaultyCamera, &[source: "unix://" <> &1, fault: fault]}
    options = [only: rules, size: {64, 48}, format: :yuyv, wait_ms: 5_000]
    CameraCase.problems(driver, {NetworkCamera, []}, options)
  end

  test "each fault is found by its rule" do
    assert faults(nil, [:options, :pictures, :newest, :junk]) == []

    for {fault, rule, words} <- [
          {:lenient, :options, "no_such_option: 1 is not refused"},
          {:wordy, :missing, "expected one line that names /"},
          {:small, :pictures, "its pictures are 32 x 24"},
          {:short, :pictures, "bytes are no picture of 64 x 48"},
          {:late, :pictures, "a picture that comes at"},
          {:back, :pictures, "the time of its pictures goes back"},
          {:stands, :pictures, "the time of its pictures stands"},
          {:blind, :sees, "does not see another scene"},
          {:pushes, :newest, "messages queue while nothing takes its pictures"},
          {:queues, :newest, "gives old pictures after it had to wait"},
          {:hoards, :junk, "its state has"},
          {:picky, :messages, "after messages that it does not know"},
          {:deaf, :unplug, "is not offline, and has no cable"},
          {:leaves, :killed, "runs on after the killing of its process"}
        ] do
      assert {^fault, [line]} = {fault, faults(fault, [rule])}
      assert line =~ "#{rule}: "
      assert line =~ words
    end
  end

  test "wrong options are refused by name" do
    assert_raise ArgumentError, ~r/camera case option size: expected {width, height}/, fn ->
      CameraCase.problems({FFmpeg, []}, {NetworkCamera, []}, size: 64)
    end
  end
end
