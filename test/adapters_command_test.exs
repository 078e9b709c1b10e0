defmodule System.AdaptersCommandTest do
  @moduledoc "What `bin/adapters` says without any package; with packages, it is a test itself."
  use ExUnit.Case, async: true

  @root Path.expand("..", __DIR__)

  setup do
    folder =
      Path.join(System.tmp_dir!(), "convoy-deps-#{System.pid()}-#{:rand.uniform(1_000_000)}")

    File.mkdir_p!(folder)
    on_exit(fn -> File.rm_rf!(folder) end)
    %{folder: folder}
  end

  defp adapters(words),
    do: System.cmd(Path.join(@root, "bin/adapters"), words, stderr_to_stdout: true)

  defp package(folder, name, deps) do
    path = Path.join(folder, "#{name}/mix.exs")
    File.mkdir_p!(Path.dirname(path))
    File.write!(path, "[version: \"1.0.0\", elixir: \"~> 1.14\", deps: #{deps}]")
    path
  end

  test "wrong words are named, with what is meant", %{folder: folder} do
    for {words, said} <- [
          {[], "the folder of the packages' sources is missing"},
          {["/nowhere"], "/nowhere is not a folder"},
          {["--all"], "--all is not an option"},
          {[folder, "libclutser"], "libclutser is not known; did you mean libcluster?"},
          {[folder, "tortoise"], "tortoise is not known; there are circuits_uart"}
        ] do
      assert {line, 2} = adapters(words)
      assert line =~ "bin/adapters: #{said}"
      assert length(String.split(line, "\n", trim: true)) == 1
    end

    assert {help, 0} = adapters(["--help"])
    assert help =~ "bin/adapters ../deps libcluster"
  end

  test "what is not there is not run, and nothing passed", %{folder: folder} do
    assert {said, 1} = adapters([folder, "libcluster"])
    assert said =~ "| libcluster |  |  | not run: there is no #{folder}/libcluster/mix.exs |"
    assert said =~ "nothing was run"
    refute said =~ "passed"
  end

  test "a package lacks what it always needs, and no more", %{folder: folder} do
    package(folder, :box, ~s([{:lid, "~> 1.0"}, {:paint, ">= 0.0.0", optional: true},
      {:docs, "~> 1.0", only: :dev}, {:glue, "~> 2.0", runtime: false}]))

    lid = Path.join(folder, "lid/mix.exs")

    assert Convoy.Packages.lacks(:box, folder) ==
             "box needs glue, and there is no #{folder}/glue/mix.exs"

    package(folder, :glue, "[]")
    assert Convoy.Packages.lacks(:box, folder) == "box needs lid, and there is no #{lid}"
    package(folder, :lid, ~s([{:box, "~> 1.0"}]))
    assert Convoy.Packages.lacks(:box, folder) == nil
  end
end
