defmodule System.SoakTest do
  @moduledoc "The command `bin/soak` from outside; what it judges by, its own tests show."
  use ExUnit.Case, async: true
  @moduletag :realtime
  @moduletag timeout: 400_000
  @command Path.expand("../bin/soak", __DIR__)

  defp soak(arguments), do: System.cmd(@command, arguments, stderr_to_stdout: true)

  test "it says what it does, and what was wrong" do
    assert {help, 0} = soak(["--help"])
    assert help =~ "bin/soak [MINUTES] [SEED]"
    assert {said, 2} = soak(["long"])
    assert said =~ ~s(soak: MINUTES: expected a number from 0.1 to 10000, got "long")
    assert {said, 2} = soak(["1", "x"])
    assert said =~ ~s(soak: SEED: expected a whole number from 0 to 1000000000, got "x")
  end

  @tag long: true, realtime: :long
  test "six robots hold out for two minutes, and nothing is left of them" do
    assert {said, 0} = soak(["2", "5"])
    assert said =~ "All that was checked held."
    [_line, journal] = Regex.run(~r/written to (.+)/, said)
    [_line, os_pid] = Regex.run(~r/-(\d+)\.log/, journal)
    assert Path.wildcard(Path.join(System.tmp_dir!(), "convoy-soak-#{os_pid}-*")) == []
    File.rm!(journal)
  end
end
