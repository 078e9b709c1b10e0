defmodule Bench.RecordingTest do
  use ExUnit.Case, async: true
  import ExUnit.CaptureIO
  alias Bench.Recording
  @moduletag :slow
  doctest Bench.Recording

  test "the table has a row for each number of robots" do
    text =
      capture_io(fn -> assert :ok = Recording.Main.run(~w(--robots 1 --seeds 1-1 --rounds 1)) end)

    assert text =~
             ~r/^\| 1 \| 1 \| [\d.]+ \| -?[\d.]+ \/ -?[\d.]+ \/ -?[\d.]+ \| .* \| [\d.]+ \/ [\d.]+ \|$/m
  end

  test "wrong input is one line each" do
    assert {:error, [robots, rounds]} = Recording.Main.run(~w(--robots 0,x --rounds 0))
    assert robots =~ ~s(--robots: expected whole numbers from 1 to 100)
    assert rounds =~ ~r/--rounds: expected .*, got "0"/
  end
end
