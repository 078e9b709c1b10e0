defmodule System.NodesTest do
  @moduledoc """
  `bin/demo --nodes` from outside: its processes are killed as a person would, by their numbers.

  A port mapper of its own keeps it apart from other fleets on the machine.
  """
  use ExUnit.Case, async: true

  @moduletag timeout: 120_000
  @root Path.expand("..", __DIR__)

  setup do
    port = free_port()
    environment = [{"ERL_EPMD_PORT", "#{port}"}, {"ERL_EPMD_ADDRESS", "127.0.0.1"}]
    on_exit(fn -> System.cmd("epmd", ["-kill"], env: environment, stderr_to_stdout: true) end)
    %{environment: environment}
  end

  # None of those that the system hands out by itself, to another test perhaps.
  defp free_port do
    port = 20_000 + :rand.uniform(10_000)

    case :gen_tcp.listen(port, ip: {127, 0, 0, 1}) do
      {:ok, socket} ->
        :gen_tcp.close(socket)
        port

      {:error, :eaddrinuse} ->
        free_port()
    end
  end

  defp start(line, environment) do
    arguments = OptionParser.split("--nodes --headless --blobs direct --json - " <> line)
    environment = for {name, value} <- environment, do: {to_charlist(name), to_charlist(value)}
    options = [:binary, :exit_status, :stderr_to_stdout, args: arguments, env: environment]
    port = Port.open({:spawn_executable, Path.join(@root, "bin/demo")}, options)
    {:os_pid, pid} = Port.info(port, :os_pid)
    on_exit(fn -> System.cmd("kill", ["#{pid}"], stderr_to_stdout: true) end)
    port
  end

  defp await(port, pattern, said \\ "") do
    if said =~ pattern do
      said
    else
      assert_receive {^port, {:data, more}}, 60_000, "nothing more after: " <> said
      await(port, pattern, said <> more)
    end
  end

  defp ending(port, said) do
    receive do
      {^port, {:data, more}} -> ending(port, said <> more)
      {^port, {:exit_status, status}} -> {said, status}
    after
      60_000 -> flunk("the demo goes on: " <> said)
    end
  end

  defp pid(said, name) do
    [_line, pid] = Regex.run(~r/^#{name} +pid (\d+) node #{name}@/m, said)
    pid
  end

  defp kill(pid), do: {_text, 0} = System.cmd("kill", ["-KILL", pid])
  defp there?(pid), do: match?({_, 0}, System.cmd("kill", ["-0", pid], stderr_to_stdout: true))

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

  test "kill -9 of the world's process: it comes back, and robots go on", %{environment: env} do
    port = start("--robots 2 --duration 45", env)
    said = await(port, ~r/elected +\w+ leads/)
    kill(pid(said, "world"))
    said = await(port, "world_back", said)
    {said, status} = ending(port, said)
    assert status in [0, 2]
    assert said =~ ~r/world_lost.*world_back.*formed/s
    assert said =~ ~r/"name":"mag1","alive":true/
    assert said =~ ~r/"name":"min1","alive":true/
  end

  test "kill -9 of what was started: all that it started ends with it", %{environment: env} do
    if match?({_, 0}, System.cmd("sh", ["-c", "setpriv --pdeathsig TERM true 2>&1"])) do
      port = start("--robots 2 --duration 45", env)
      said = await(port, ~r/elected +\w+ leads/)
      processes = for name <- ["mag1", "min1", "world"], do: pid(said, name)
      {:os_pid, script} = Port.info(port, :os_pid)
      kill("#{script}")
      deadline = System.monotonic_time(:millisecond) + 15_000
      ended(processes, deadline)
      unmapped(env, deadline)
    end
  end

  # Whether the port mapper that the run started is still there.
  defp mapped?(env),
    do: match?({_, 0}, System.cmd("epmd", ["-names"], env: env, stderr_to_stdout: true))

  defp unmapped(env, deadline) do
    if mapped?(env) do
      assert System.monotonic_time(:millisecond) < deadline, "its epmd goes on"
      unmapped(env, deadline)
    end
  end

  defp ended(processes, deadline) do
    case Enum.filter(processes, &there?/1) do
      [] ->
        :ok

      left ->
        if(System.monotonic_time(:millisecond) > deadline,
          do: flunk("#{inspect(left)} go on"),
          else: ended(left, deadline)
        )
    end
  end
end
