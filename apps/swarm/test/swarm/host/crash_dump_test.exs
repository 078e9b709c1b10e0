defmodule Swarm.Host.CrashDumpTest do
  # A crash dump holds the cookie and the key of the fleet.
  use ExUnit.Case, async: true
  @moduletag :tmp_dir

  @root Path.expand("../../../../..", __DIR__)

  # The VM crashes as it does for want of memory.
  defp crash(folder, given, before) do
    line = before <> "exec erl -noshell -eval 'erlang:halt(\"on purpose\")'"
    env = [{"ERL_CRASH_DUMP_SECONDS", given}, {"RELEASE_COMMAND", "version"}]
    options = [cd: folder, env: env, stderr_to_stdout: true]
    {_said, status} = System.cmd("sh", ["-euc", line, @root], options)
    assert status != 0
    File.ls!(folder)
  end

  test "a robot's release writes none, unless it is told to", %{tmp_dir: folder} do
    release = ~s(. "$0/rel/env.sh.eex"; )
    assert crash(folder, nil, release) == []
    assert crash(folder, "-1", release) == ["erl_crash.dump"]
  end

  test "a shell in a node of the mesh writes none", %{tmp_dir: folder} do
    [line] = for "export ERL_CRASH" <> _ = line <- lines("bin/node"), do: line
    assert crash(folder, nil, line <> "; ") == []
  end

  defp lines(file), do: @root |> Path.join(file) |> File.read!() |> String.split("\n")
end
