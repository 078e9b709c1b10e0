defmodule System.LocaleTest do
  @moduledoc "Umlauts in folders and options, where the environment says that there are none."
  use ExUnit.Case, async: true
  @moduletag :realtime
  @moduletag :tmp_dir

  @root Path.expand("..", __DIR__)

  setup %{tmp_dir: folder} do
    folder = Path.join(folder, "Flügel")
    File.mkdir_p!(folder)
    %{folder: folder}
  end

  defp under_c(command, arguments, folder) do
    # A locale that is not installed, as ssh brings one along, counts as C does.
    environment = [{"LC_ALL", "C"}, {"LC_CTYPE", "de_XX.UTF-8"}, {"CONVOY_SECRET_FILE", nil}]
    System.cmd(command, arguments, cd: folder, env: environment, stderr_to_stdout: true)
  end

  test "the scripts read and write files with umlauts in their names", %{folder: folder} do
    demo = Path.join(@root, "bin/demo")
    line = ~w(--robots 1 --headless --seed 1 --record übung.mcap)
    assert {said, 0} = under_c(demo, line, folder)
    assert said =~ "Wrote #{folder}/übung.mcap"
    assert File.exists?(Path.join(folder, "übung.mcap"))

    assert {"bin/node: there is no secret " <> said, 1} =
             under_c(
               "env",
               ["CONVOY_SECRET_FILE=ü", Path.join(@root, "bin/node"), "mag1"],
               folder
             )

    assert said == "#{folder}/ü; make it: mix fleet.secret\n"
  end

  # From a folder whose name has an umlaut, mix itself finds no mix.exs then.
  test "mix says in a line what it needs for them, and nothing where there are none" do
    folder = Path.join(System.tmp_dir!(), "locale#{System.unique_integer([:positive])}")
    File.mkdir_p!(folder)
    on_exit(fn -> File.rm_rf!(folder) end)
    for file <- ~w(mix.exs release.exs), do: File.cp!(Path.join(@root, file), "#{folder}/#{file}")

    assert under_c("mix", ["help", "übung"], folder) ==
             {"mix: the options hold letters that need UTF-8: export LC_ALL=C.UTF-8\n", 1}

    assert {said, 0} = under_c("mix", ["help", "compile"], folder)
    assert said =~ "mix compile"
  end
end
