defmodule LivebookTest do
  @moduledoc """
  What docs/fleet.livemd does without Livebook's own parts: its lines run in a VM that has none of our code, and reach a node
  with a robot by what bin/livebook prints.
  """
  use ExUnit.Case, async: true
  @moduletag :tmp_dir
  @moduletag :realtime

  @root Path.expand("..", __DIR__)
  @notebook Path.join(@root, "docs/fleet.livemd")
  @robots """
  Logger.configure(level: :none)
  {:ok, _fleet} = Lab.Fleet.start_link(robots: [:mag1], mission: false)
  handler = fn _event, _measurements, about, _config -> IO.puts("\#{about.order}, by \#{about.by}") end
  :ok = Hal.Event.attach(:told, [:swarm, :comms, :ordered], handler, nil)
  IO.puts("there")
  receive(do: (:never -> :ok))
  """

  # In the stranger's VM, behind the notebook's own lines.
  @asked """
  [_robot] = statuses.()
  :ok = order.(:goto, [:mag1, {0.5, 0.5}])
  :ok = order.(:estop, [])
  [status] = statuses.()
  ours = for path <- :code.get_path(), "\#{path}" =~ "_build", do: path
  IO.inspect({:loaded, Code.ensure_loaded?(Swarm), :peer.call(door, :code, :which, [Swarm]), ours})
  IO.inspect({:processes, elem(System.cmd("ps", ["axww", "-o", "args"]), 0) =~ cookie})
  IO.puts(Fleet.svg([status]))
  IO.inspect(Fleet.row(status))
  """

  # The cells of the notebook that use nothing of Livebook's.
  defp cells do
    for [_all, cell] <- Regex.scan(~r/^```elixir\n(.*?)^```$/ms, File.read!(@notebook)),
        not (cell =~ ~r/Kino|Mix\.install/),
        do: cell
  end

  test "a VM without our code reaches a running fleet by the notebook's lines", %{tmp_dir: folder} do
    for host <- ["h#{System.unique_integer([:positive])}", "fleet.lan"] do
      secret = Path.join(folder, "#{host}.secret")
      {_, 0} = System.cmd("mix", ["fleet.secret", secret], cd: @root, stderr_to_stdout: true)
      robots = Path.join(folder, "robots.exs")
      File.write!(robots, @robots)

      environment = [
        {"MIX_ENV", "#{Mix.env()}"},
        {"CONVOY_SECRET_FILE", secret},
        {"CONVOY_INTERFACE", "127.0.0.1"},
        {"CONVOY_HOST", host},
        {"CONVOY_UDP_PORT", "#{udp_port()}"},
        {"CONVOY_UDP_PEERS", "127.0.0.1:#{udp_port()}"},
        {"CONVOY_DIST_PORT", "#{tcp_port()}"}
      ]

      node = start(["bin/node", "mag1", robots], environment)
      told(node, ~r/there\n/)

      options = [env: environment, stderr_to_stdout: true]
      assert {lines, 0} = System.cmd(Path.join(@root, "bin/livebook"), ["mag1"], options)

      settings =
        for [_all, key, value] <- Regex.scan(~r/^export (\w+)=(.+)$/m, lines), do: {key, value}

      assert {"LB_CONVOY_NODE", "mag1@#{host}"} in settings

      # It knows what was printed, and not what the fleet's nodes know.
      script = Path.join(folder, "cells.exs")
      File.write!(script, Enum.join(cells(), "\n") <> @asked)
      hidden = for {key, _value} <- environment, do: {key, nil}

      stranger = [
        cd: folder,
        env: hidden ++ settings ++ [{"USER", "ann"}],
        stderr_to_stdout: true
      ]

      assert {said, 0} = System.cmd("elixir", [script], stranger)

      assert said =~ "{:loaded, false, :non_existing, []}"
      assert said =~ "{:processes, false}"
      assert said =~ ~r/<circle cx="-?\d/
      assert said =~ ~s(reason: "E-STOP by mag1")
      told(node, ~r/goto 0.5 0.5, by livebook of ann\n.*estop, by livebook of ann\n/s)
      Port.close(node)
    end
  end

  test "what is wrong is one line, and no cookie", %{tmp_dir: folder} do
    for {arguments, line} <- [
          {["Mag 1"],
           "Mag 1 is not a name of a node; small letters, digits and _ are allowed, as in mag1"},
          {["mag1@a b"], "a b is not a host; letters, digits, . and - are allowed"},
          {[], "there is no secret #{folder}/none; run this where the fleet's secret is"}
        ] do
      options = [env: [{"CONVOY_SECRET_FILE", Path.join(folder, "none")}], stderr_to_stdout: true]
      assert {said, 1} = System.cmd(Path.join(@root, "bin/livebook"), arguments, options)
      assert said == "bin/livebook: #{line}\n"
    end
  end

  # It ends with its input.
  defp start([name | arguments], environment) do
    Port.open({:spawn_executable, "/bin/sh"}, [
      :binary,
      :stderr_to_stdout,
      cd: @root,
      env: for({key, value} <- environment, do: {to_charlist(key), to_charlist(value)}),
      args: [
        "-c",
        ~s("$@" & node=$!; cat > /dev/null; kill $node),
        "sh",
        Path.join(@root, name) | arguments
      ]
    ])
  end

  defp told(port, pattern, said \\ "") do
    if said =~ pattern do
      said
    else
      receive do
        {^port, {:data, more}} -> told(port, pattern, said <> more)
      after
        30_000 -> flunk("in vain: #{inspect(pattern)} in #{said}")
      end
    end
  end

  defp udp_port do
    {:ok, socket} = :gen_udp.open(0)
    {:ok, port} = :inet.port(socket)
    :gen_udp.close(socket)
    port
  end

  defp tcp_port do
    {:ok, socket} = :gen_tcp.listen(0, [])
    {:ok, port} = :inet.port(socket)
    :gen_tcp.close(socket)
    port
  end
end
