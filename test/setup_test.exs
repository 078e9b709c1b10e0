defmodule System.SetupTest do
  @moduledoc "What a machine is told on which something is missing."
  use ExUnit.Case, async: true

  @root Path.expand("..", __DIR__)

  # A machine of our own making: only these programs exist on it.
  defp machine(folder, programs) do
    for name <- ~w(sh sed cat echo printf ls dirname),
        do: File.ln_s!(System.find_executable(name), Path.join(folder, name))

    for {name, script} <- programs do
      path = Path.join(folder, name)
      File.write!(path, "#!/bin/sh\n" <> script <> "\n")
      File.chmod!(path, 0o755)
    end

    System.cmd("sh", [Path.join(@root, "bin/setup"), "test"],
      env: [{"PATH", folder}],
      stderr_to_stdout: true
    )
  end

  @tag :tmp_dir
  test "no Debian: the programs and their versions are named", %{tmp_dir: folder} do
    assert {text, 1} = machine(folder, [])

    for words <- [
          "Elixir 1.14 or newer",
          "Erlang/OTP 25 or newer",
          "gcc",
          "ffmpeg 5 or newer",
          "no Debian"
        ],
        do: assert(text =~ words)
  end

  @tag :tmp_dir
  test "not root: the packages are named, nothing is installed", %{tmp_dir: folder} do
    programs = [
      {"id", "echo 1000"},
      {"dpkg-query", "exit 1"},
      {"apt-get", "echo apt-get was called; exit 1"}
    ]

    assert {text, 1} = machine(folder, programs)
    assert text =~ "apt-get install --no-install-recommends elixir erlang-dev gcc libc6-dev"
    refute text =~ "apt-get was called"
  end

  @tag :tmp_dir
  test "with all packages there it says nothing", %{tmp_dir: folder} do
    assert {"", 0} = machine(folder, [{"dpkg-query", "printf installed"}])
  end
end
