defmodule Tools.ConvoyNewTest do
  use ExUnit.Case, async: true

  @moduletag :tmp_dir

  setup %{tmp_dir: folder} do
    project =
      "defmodule Any.MixProject do\n  use Mix.Project\n  def project, do: [app: :any, version: ~s(0.1.0), prune_code_paths: false]\nend\n"

    File.write!(Path.join(folder, "mix.exs"), project)
  end

  # What a person types in a folder, and what it says and does there.
  defp typed(words, folder) do
    paths = for path <- :code.get_path(), word <- ["-pa", to_string(path)], do: word
    mix = paths ++ ["-S", "mix", "convoy.new" | words]
    System.cmd("elixir", mix, cd: folder, stderr_to_stdout: true, env: [{"MIX_ENV", "test"}])
  end

  test "it makes an app that the umbrella builds, and overwrites nothing", %{tmp_dir: folder} do
    File.write!(Path.join(folder, "support.exs"), "")
    assert {_said, 0} = typed(["mine"], folder)
    project = File.read!(Path.join(folder, "apps/mine/mix.exs"))
    assert project =~ "defmodule Mine.MixProject do"
    assert Code.format_string!(project) |> IO.iodata_to_binary() |> Kernel.<>("\n") == project
    assert File.dir?(Path.join(folder, "apps/mine/lib"))
    assert File.read!(Path.join(folder, "apps/mine/test/test_helper.exs")) == "ExUnit.start()\n"

    assert {said, 1} = typed(["mine"], folder)
    assert said =~ "convoy.new: apps/mine exists, and nothing is overwritten"
  end

  test "what cannot be is one line", %{tmp_dir: folder} do
    assert {said, 1} = typed(["mine"], folder)
    assert said =~ "convoy.new: this is not Convoy's top folder"
    File.write!(Path.join(folder, "support.exs"), "")

    for {words, line} <- [
          {["../mine"], ~s(got "../mine")},
          {["Mine"], ~s(got "Mine")},
          {["logger"], "logger is a name of Erlang, Elixir or Convoy"},
          {["agent"], "agent is a name of Erlang, Elixir or Convoy"},
          {[], "expected one name, as in mix convoy.new mine, got 0"},
          {["a", "b"], "got 2"}
        ] do
      assert {said, 1} = typed(words, folder)
      assert said =~ line
      refute File.exists?(Path.join(folder, "apps"))
    end
  end

  test "--help says how", %{tmp_dir: folder} do
    assert {said, 0} = typed(["--help"], folder)
    assert said =~ "mix convoy.new mine"
  end
end
