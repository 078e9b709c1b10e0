Code.require_file("nodes/case.exs", __DIR__)

# Each is a module of its own, so that they wait side by side.
defmodule System.NodesLeaderTest do
  @moduledoc "`bin/demo --nodes` from outside: its leader's process is killed as a person would, by its number."
  use Nodes.Case, async: true
  @moduletag :realtime

  test "kill -9 of the leader's process: another leads, and the report tells", %{environment: env} do
    port = start("--robots 3 --duration 45", env)
    said = await(port, ~r/elected +\w+ leads/)
    [_line, leader] = Regex.run(~r/elected +(\w+) leads/, said)
    processes = for name <- ["mag1", "mag2", "min1", "world"], do: pid(said, name)
    assert said =~ "--remsh mag1@127.0.0.1"
    assert processes == Enum.uniq(processes)
    kill(pid(said, leader))

    {said, status} = ending(port, said)
    assert status in [0, 2]
    assert said =~ "#{leader} is dead"
    assert said =~ ~r/"name":"#{leader}","alive":false,"state":"dead"/
    assert [_, _ | _] = Regex.scan(~r/elected +\w+ leads/, said)
    assert [_line, next] = Regex.run(~r/"leader":"(\w+)"/, said)
    assert next != leader
    refute Enum.any?(processes, &there?/1)
    refute mapped?(env)
  end
end

defmodule System.NodesWorldTest do
  @moduledoc "`bin/demo --nodes` from outside: the process of its world is killed."
  use Nodes.Case, async: true
  @moduletag :realtime

  @tag long: true, realtime: :long
  test "kill -9 of the world's process: it comes back, robots stand, and go on when they are told to",
       %{environment: env} do
    port = start("--robots 2 --duration 60", env, "")
    said = await(port, ~r/elected +\w+ leads/)
    kill(pid(said, "world"))
    said = await(port, ~r/world_back .*until a start/, said)
    said = await(port, ~r/world_back.* s  2 robots, .*no leader/s, said)
    true = Port.command(port, "start\n")
    {said, status} = ending(port, said)
    assert status in [0, 2]
    assert said =~ ~r/world_lost.*world_back.*start: accepted.*formed +every robot/s
    assert said =~ ~r/"name":"mag1","alive":true/
    assert said =~ ~r/"name":"min1","alive":true/
  end
end

defmodule System.NodesLauncherTest do
  @moduledoc "`bin/demo --nodes` from outside: what was started is killed."
  use Nodes.Case, async: true
  @moduletag :realtime

  test "kill -9 of what was started: all that it started ends with it", %{environment: env} do
    if match?({_, 0}, System.cmd("sh", ["-c", "setpriv --pdeathsig TERM true 2>&1"])) do
      port = start("--robots 2 --duration 45", env)
      said = await(port, ~r/elected +\w+ leads/)
      processes = for name <- ["mag1", "min1", "world"], do: pid(said, name)
      [_line, folder] = Regex.run(~r/HOME=(\S+) iex/, said)
      assert File.ls!(folder) == [".erlang.cookie"]
      {:os_pid, script} = Port.info(port, :os_pid)
      kill("#{script}")
      deadline = System.monotonic_time(:millisecond) + 15_000
      ended(processes, deadline)
      unmapped(env, deadline)
      removed(folder, deadline)
    end
  end
end

defmodule System.NodesDoorsTest do
  @moduledoc "`bin/demo --nodes` from outside: what it lets in, and what it leaves when it crashes."
  use Nodes.Case, async: true
  @moduletag :realtime
  @root Path.expand("..", __DIR__)

  test "its nodes take few names of strangers, and a crash leaves no dump", %{environment: env} do
    port = start("--robots 2 --duration 45", env)
    said = await(port, ~r/elected +\w+ leads/)
    ports = listening(env)
    assert ports |> Map.keys() |> Enum.sort() == ["demo", "mag1", "min1", "world"]

    for name <- ["demo", "mag1", "world"] do
      greeted = Enum.count(1..60, &greeted?(ports[name], "stranger#{&1}@127.0.0.1"))
      assert {name, greeted in 1..40} == {name, true}
    end

    before = dumps()
    {_text, 0} = System.cmd("kill", ["-USR1", main(said)])
    {_said, status} = ending(port, said)
    assert status != 0
    assert dumps() == before
  end

  test "`mix demo --nodes` without bin/demo has other doors, and is refused" do
    {said, status} =
      System.cmd("mix", ["demo", "--nodes"],
        cd: @root,
        stderr_to_stdout: true,
        env: [{"ELIXIR_ERL_OPTIONS", ""}]
      )

    assert {status, said =~ "demo: --nodes needs bin/demo"} == {1, true}
  end

  # Its folder bears its number.
  defp main(said), do: ~r/HOME=\S+convoy-(\d+)-/ |> Regex.run(said) |> List.last()

  defp dumps, do: Path.wildcard(Path.join(@root, "**/erl_crash.dump*"))
end
