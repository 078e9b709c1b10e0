defmodule System.OutputTest do
  @moduledoc "Commands whose standard output is lost say so, also if they print once, at their end."
  use ExUnit.Case, async: true
  @moduletag :tmp_dir
  @root Path.expand("..", __DIR__)

  test "a full disk is a line and status 1, for a demo and for what prints once", %{
    tmp_dir: folder
  } do
    commands = ["demo --headless --robots 2 --duration 3 --json -", "bench vision --help"]
    Enum.each(commands, &full/1)
    full("fleet.secret", [Path.join(folder, "secret")])
  end

  @tag :long
  test "a full disk is a line and status 1, whatever the command prints" do
    for command <- [
          "robot.check",
          "robot.check --help",
          "demo --help",
          "fleet.certs --help",
          "blobs --help",
          "calibrate odometry --help",
          "chaos --help",
          "replay --help",
          "scenario --help"
        ],
        do: full(command)
  end

  defp full(command, files \\ []) do
    name = command |> String.split() |> hd()
    line = "#{name}: the output cannot be written: no space left on device\n1\n"
    told = sh("mix #{command} \"$@\" 2>&1 >/dev/full; echo $?", files)

    # With `--json -` the demo tells the rest there; and newer Erlangs log that their writer has ended.
    assert {command, told} == {command, line} or
             ((name == "demo" or logs?()) and String.ends_with?(told, line)),
           told
  end

  defp logs?, do: String.to_integer(System.otp_release()) >= 26

  test "who reads no further is told nothing more" do
    assert sh("{ mix robot.check; echo $? >&2; } 2>&1 >/dev/null | cat") == "0\n"
    assert sh("mix robot.check 2>&1 | true") == ""
  end

  # Files are words of their own, whatever their names are.
  defp sh(script, files \\ []) do
    {told, 0} = System.cmd("sh", ["-c", script, "sh" | files], cd: @root)
    told
  end
end
