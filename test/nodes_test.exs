Code.require_file("nodes/case.exs", __DIR__)

# Each is a module of its own, so that they wait side by side.
defmodule System.NodesLeaderTest do
  @moduledoc "`bin/demo --nodes` from outside: its leader's process is killed as a person would, by its number."
  use Nodes.Case, async: true
  @moduletag :realtime

  test "kill -9 of the leader's process: another leads, and the report tells", %{environment: env} do
    port = start("--robots 3 --duration 25", env)
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

defmodule System.NodesPageTest do
  @moduledoc "`bin/demo --nodes` and its page: what it cannot serve of robots in other processes is not offered, or says why."
  use Nodes.Case, async: true
  alias Console.Browser
  @moduletag :realtime
  @moduletag skip: Browser.why_not()

  test "the chosen robot's panel is that of its process; its sonars are shown, and why its camera is not",
       %{environment: env} do
    port = start("--robots 2 --duration 120 --page 0", env, "")
    said = await(port, ~r"http://\S+\n")
    [url] = Regex.run(~r"http://\S+", said)
    said = await(port, ~r/elected +\w+ leads/, said)
    browser = Browser.open({1280, 800})
    Browser.go(browser, url)
    Browser.await(browser, "return window.floor.scene?.robots.length === 2")
    Browser.run(browser, "document.querySelector('[data-id=mag1] button').click()")
    Browser.await(browser, "return window.floor.about?.sonar.length === 16")

    Browser.await(
      browser,
      "return /wishes\\w+ \\d/.test(document.getElementById('about').textContent)"
    )

    # Direct blobs have no pictures; else it is the node that has them.
    shown =
      "return [...document.querySelectorAll('#acts button')].filter((b) => b.offsetParent && !b.disabled).map((b) => b.textContent)"

    assert Browser.run(browser, shown) == ["Start", "Stop", "Kill", "Drive by keys", "Sonars"]

    assert Browser.run(browser, "return document.getElementById('camera').title") =~
             "do not leave mag1@"

    # All that is offered is served.
    for {button, answer} <- [
          {"[data-one=stop]", "stop mag1: accepted"},
          {"[data-one=start]", "start mag1: accepted"},
          {"[data-one=kill]", "kill mag1: done"}
        ] do
      Browser.run(browser, "document.querySelector('#acts #{button}').click()")

      Browser.await(
        browser,
        "return document.getElementById('answer').textContent === '#{answer}'"
      )
    end

    Browser.await(browser, "return document.getElementById('acts').className === 'gone-robot'")
    assert Browser.errors(browser) == []
    Browser.close(browser)
    assert said =~ "mag1"
    Port.command(port, "quit\n")
    {_said, _status} = ending(port, "")
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

    assert said =~
             ~r/world_lost.*world_back.*start: accepted.*formed +\w+ and its 1 follower say/s

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
