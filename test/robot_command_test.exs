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
  test "daemon says that the robot was started and is not up, and where its log is", %{
    tmp_dir: folder
  } do
    assert {text, 1} = robot(folder, ~s([ "$1" = daemon ]), ["daemon"])

    assert text ==
             "robot: it was started, and does not answer; its log is in /run/convoy/log\n"
  end
end
