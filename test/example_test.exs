defmodule System.ExampleTest do
  @moduledoc """
  Projects outside the umbrella: the one of `examples/` in a folder of its own is built, runs its mission, and makes a
  release with its own driver.
  """
  use ExUnit.Case, async: true
  @root Path.expand("..", __DIR__)

  setup do
    folder = Path.join(System.tmp_dir!(), "convoy-example-#{System.unique_integer([:positive])}")

    File.mkdir_p!(folder)
    on_exit(fn -> File.rm_rf!(folder) end)
    sh("cp -a #{quoted(Path.join(@root, "examples/gather"))}/. .", folder)
    %{folder: folder}
  end

  test "a mission, a behaviour and a driver of another project", %{folder: folder} do
    # What was built here for tests does for it, too. Its own files must look older than that.
    File.mkdir_p!(Path.join(folder, "_build/prod"))
    sh("find . -type f -exec touch -d 2020-01-01 {} +", folder)
    sh("cp -a #{quoted(Mix.Project.build_path())}/lib _build/prod/lib", folder)
    whole(folder)
  end

  @tag :long
  test("the same, built from nothing", %{folder: folder}, do: whole(folder))

  defp whole(folder) do
    sh("mix compile --warnings-as-errors", folder)

    said = sh("mix demo --headless --robots 3 --landmark none --mission gather --seed 1", folder)
    assert said =~ "hall, seed 1, gather\n"
    assert said =~ "gather: all 3 robots have reached their goal."

    assert sh("mix demo --headless --mission gahter", folder, 1) =~ "did you mean gather?"

    checked = sh("mix robot.check", folder)
    assert checked =~ "config/robots/mag1.exs: valid"
    assert checked =~ ~r/^ +drive +Gather.DeskBase$/m

    sh("mix release --quiet", folder)
    {:ok, _secret} = Mesh.Secret.create(Path.join(folder, "secret"), false)

    said =
      sh("ROBOT=mag1 CONVOY_SECRET_FILE=secret _build/prod/rel/robot/bin/robot check", folder)

    assert said =~ ~r/^ +drive +Gather.DeskBase$/m
    assert said =~ ~r/^ +mission +gather, radius 1.0$/m
    assert File.exists?(Path.join(folder, "_build/prod/rel/robot/lib/record-0.1.0"))

    for app <- ~w(sim tools),
        do: refute(File.exists?(Path.join(folder, "_build/prod/rel/robot/lib/#{app}-0.1.0")))
  end

  # What a line prints on both ways; its status is looked at.
  defp sh(line, folder, status \\ 0) do
    environment = [{"CONVOY", @root}, {"MIX_ENV", "prod"}, {"MIX_TARGET", nil}]
    options = [cd: folder, env: environment, stderr_to_stdout: true]
    {said, ended} = System.cmd("sh", ["-c", "exec </dev/null; " <> line], options)
    assert ended == status, "#{line}: status #{ended}: #{said}"
    said
  end

  defp quoted(path), do: "'" <> String.replace(path, "'", "'\\''") <> "'"
end
