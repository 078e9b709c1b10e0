defmodule System.RobotCommandTest do
  @moduledoc "What `bin/robot` makes of a release that does not do as it should."
  use ExUnit.Case, async: true
  @moduletag :realtime

  @robot Path.expand("../bin/robot", __DIR__)

  # A release of our own making, and a clock that does not make us wait.
  defp robot(folder, release, arguments) do
    script(Path.join(folder, "bin/robot"), release)
    script(Path.join(folder, "path/sleep"), "exit 0")

    System.cmd(@robot, arguments,
      env: [
        {"CONVOY_RELEASE", folder},
        {"RELEASE_TMP", "/run/convoy"},
        {"PATH", Path.join(folder, "path") <> ":" <> System.get_env("PATH")}
      ],
      stderr_to_stdout: true
    )
  end

  defp script(path, text) do
    File.mkdir_p!(Path.dirname(path))
    File.write!(path, "#!/bin/sh\n" <> text <> "\n")
    File.chmod!(path, 0o755)
  end

  @tag :tmp_dir
  test "daemon has done its work when the robot is up, and not before", %{tmp_dir: folder} do
    # Up at the third look.
    looks = Path.join(folder, "looks")

    slow = """
    echo "$1" >>"#{looks}"
    [ "$1" = daemon ] || [ "$(grep -c rpc "#{looks}")" -ge 3 ]
    """

    assert {"", 0} = robot(folder, slow, ["daemon"])
    assert File.read!(looks) == "daemon\nrpc\nrpc\nrpc\n"
  end

  @tag :tmp_dir
  test "what cannot be printed is told, and a reader that has enough is not", %{tmp_dir: folder} do
    script(Path.join(folder, "bin/robot"), "echo 4711; echo more")
    environment = [{"CONVOY_RELEASE", folder}]

    shell = fn line ->
      System.cmd("sh", ["-c", line, "sh", @robot], env: environment, stderr_to_stdout: true)
    end

    for command <- ["status", "pid", "rpc 1"] do
      assert {"robot: the output cannot be written\n1\n", 0} =
               shell.(~s({ "$1" #{command} >/dev/full; } 2>&1; echo $?))
    end

    assert {"4711\n", 0} = shell.(~s("$1" status 2>&1 | head -n 1))
  end

  @tag :tmp_dir
  test "restart has done its work when the robot answers anew", %{tmp_dir: folder} do
    looks = Path.join(folder, "looks")

    release = """
    echo "$1" >>"#{looks}"
    case "$2" in nil*) [ "$(grep -c rpc "#{looks}")" -ge 4 ] ;; esac
    """

    assert {"", 0} = robot(folder, release, ["restart"])
    assert File.read!(looks) == "rpc\nrestart\nrpc\nrpc\nrpc\n"
  end

  @tag :tmp_dir
  test "daemon says that the robot was started and is not up, and where its log is", %{
    tmp_dir: folder
  } do
    assert {text, 1} = robot(folder, ~s([ "$1" = daemon ]), ["daemon"])

    assert text ==
             "robot: it was started, and does not answer; its log is in /run/convoy/log\n"
  end
end
