defmodule ConsoleCommandTest do
  @moduledoc "bin/console beside a node of a mesh, in a real browser, and where it cannot be."
  use ExUnit.Case, async: true
  alias Console.Browser
  @moduletag :tmp_dir
  @moduletag :realtime
  @moduletag skip: Browser.why_not()

  @root Path.expand("..", __DIR__)
  @robots """
  Logger.configure(level: :none)
  {:ok, _fleet} = Lab.Fleet.start_link(robots: [:mag1, :min1], mission: false)
  receive(do: (:never -> :ok))
  """

  # A fleet of their own, on ports of their own, that others of this machine do not hear.
  setup %{tmp_dir: folder} do
    [here, there] = udp_ports()
    secret = Path.join(folder, "convoy.secret")
    {_, 0} = System.cmd("mix", ["fleet.secret", secret], cd: @root, stderr_to_stdout: true)
    File.write!(Path.join(folder, "robots.exs"), @robots)

    environment = [
      {"MIX_ENV", "#{Mix.env()}"},
      {"CONVOY_SECRET_FILE", secret},
      {"CONVOY_INTERFACE", "127.0.0.1"},
      {"CONVOY_HOST", "h#{:erlang.unique_integer([:positive])}"},
      {"CONVOY_UDP_PEERS", "127.0.0.1:#{here} 127.0.0.1:#{there}"}
    ]

    %{environment: environment, here: here, there: there}
  end

  test "it says whom it does not hear, shows robots when they come, and stops them",
       context do
    host = Map.new(context.environment)["CONVOY_HOST"]
    console = program(~w(bin/console --connect mag1@#{host}), context, context.here)

    [_all, url] =
      told(console, ~r"Page:  (http://\S+)\nmag1@#{host} is not heard, nor is any other")

    robots =
      program(
        ["bin/node", "mag1", Path.join(context.tmp_dir, "robots.exs")],
        context,
        context.there
      )

    browser = Browser.open({1280, 800})
    Browser.go(browser, url)
    Browser.await(browser, "return document.querySelectorAll('#robots tr').length === 2", 600)
    told(console, ~r/heard: mag1, min1/)

    # Of a robot elsewhere its sonars are shown, where its camera looks, and why there are no pictures.
    Browser.run(browser, "document.querySelector('[data-id=mag1] button').click()")
    Browser.await(browser, "return window.floor.about?.sonar.length === 16")
    Browser.await(browser, "return !document.getElementById('sonar').hidden")

    Browser.await(
      browser,
      "return /looks at -?\\d+, -?\\d+ deg \\(zoom \\d+ deg\\), sees .*do not leave mag1@#{host}: look from there/s" <>
        ".test(document.getElementById('about').innerText)"
    )

    assert Browser.run(browser, """
           const camera = document.getElementById('camera');
           return !camera.hidden && camera.disabled && camera.title.includes('look from there');
           """)

    Browser.run(browser, "document.getElementById('estop').click()")

    Browser.await(
      browser,
      "return document.getElementById('answer').textContent === 'estop: accepted'"
    )

    Browser.await(browser, "return window.floor.scene.robots.every((r) => r.state === 'E-STOP')")
    assert Browser.errors(browser) == []
    Browser.close(browser)
    Port.close(robots)
    told(console, ~r/mag1@#{host} is not heard, nor is any other node/)
    Port.close(console)
  end

  test "two on one machine have a name and a page each", context do
    # By the ports of their names, and any for datagrams.
    pages =
      for _two <- 1..2 do
        console = start(["bin/console"], context.environment)
        [_all, url] = told(console, ~r"Page:  (http://\S+)\n")
        {console, url}
      end

    assert [{_one, url}, {_two, other}] = pages
    assert url != other
    for {console, _url} <- pages, do: Port.close(console)
  end

  test "what is wrong is one line", context do
    {:ok, held} = :gen_tcp.listen(0, reuseaddr: true)
    {:ok, port} = :inet.port(held)

    for program <- [["bin/console"], ~w(bin/node mag1)] do
      environment = [{"CONVOY_DIST_PORT", "#{port}"} | context.environment]
      options = [cd: @root, env: environment, stderr_to_stdout: true]
      [name | arguments] = program
      assert {said, 1} = System.cmd(Path.join(@root, name), arguments, options)
      assert [line] = String.split(said, "\n", trim: true)
      assert line =~ ~r/^bin\/node: TCP port #{port} of (base|mag1) is in use\. If /
    end

    for {arguments, line} <- [
          {~w(--connect mag1), ~s(--connect: expected a node such as mag1@convoy, got "mag1")},
          {~w(--page 70000), ~s(--page: expected a port from 0 to 65535, got "70000")},
          {~w(--page-address 0.0.0.0), "--page-address of other machines needs --page-token-file"}
        ] do
      environment = [{"CONVOY_DIST_PORT", "#{tcp_port()}"} | context.environment]
      options = [cd: @root, env: environment, stderr_to_stdout: true]
      assert {said, 1} = System.cmd(Path.join(@root, "bin/console"), arguments, options)
      assert said =~ "console: " <> line
    end
  end

  defp program(words, context, udp) do
    environment = [
      {"CONVOY_UDP_PORT", "#{udp}"},
      {"CONVOY_DIST_PORT", "#{tcp_port()}"} | context.environment
    ]

    start(words, environment)
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
        ~s("$@" </dev/null & p=$!; read _end; kill $p),
        "sh",
        Path.join(@root, name) | arguments
      ]
    ])
  end

  defp told(port, pattern, said \\ "") do
    case Regex.run(pattern, said) do
      nil ->
        receive do
          {^port, {:data, more}} -> told(port, pattern, said <> more)
        after
          30_000 -> flunk("in vain: #{inspect(pattern)} in #{said}")
        end

      found ->
        found
    end
  end

  defp udp_ports do
    sockets = for _two <- 1..2, do: elem({:ok, _} = :gen_udp.open(0), 1)
    ports = for socket <- sockets, do: elem({:ok, _} = :inet.port(socket), 1)
    Enum.each(sockets, &:gen_udp.close/1)
    ports
  end

  defp tcp_port do
    {:ok, socket} = :gen_tcp.listen(0, [])
    {:ok, port} = :inet.port(socket)
    :gen_tcp.close(socket)
    port
  end
end
