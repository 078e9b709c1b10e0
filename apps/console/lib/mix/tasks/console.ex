defmodule Mix.Tasks.Console do
  @shortdoc "Shows and commands the robots of a running mesh, in the browser"
  @moduledoc """
  Serves the page for a mesh that is running; `bin/console` starts a node of the mesh for it, with what a Mix task cannot
  set itself. `bin/console --help` lists the options.

  Exit status: 1 if the input was wrong, or there can be no page.
  """
  use Mix.Task
  alias Console.{Live, Orders, Page}
  alias Console.Terminal.Tty
  alias Swarm.Directory

  @look_ms 500

  @impl Mix.Task
  def run(arguments) do
    with {:ok, pairs} <- Hal.Cli.Arguments.parse(arguments, table()) do
      options = Map.merge(%{"page-address" => {127, 0, 0, 1}}, Map.new(pairs))

      if options["help"],
        do: Hal.Cli.Command.guard("console", fn -> IO.write(help()) end),
        else: options |> serve() |> refused()
    else
      {:error, lines} -> refused({:error, lines ++ ["--help lists all options"]})
    end
  end

  defp table do
    [
      {"connect", "NAME@HOST", &connect/1,
       "the node that must be heard, such as mag1@convoy; or its machine,\nwhere multicast is blocked: mag1@10.0.0.7 (all that are heard)"},
      {"presence", nil, nil,
       "each key pressed here says that a person looks after the robots\nwhose files ask for that; q ends it (bin/presence)"},
      {"page", "PORT", &Console.Options.Page.port/1, "the port of the page (any that is free)"}
    ] ++
      Console.Options.Page.table(System.get_env("CONVOY_FROM", ".")) ++
      Console.Options.Page.services()
  end

  defp help do
    """
    Shows the robots of a running mesh in the browser, and commands them.

      bin/console [options]

    #{Hal.Cli.Arguments.help(table())}

    The fleet's secret is read from CONVOY_SECRET_FILE (convoy.secret); bin/node --help lists more.
    """
  end

  # A name is compared only: no text becomes an atom.
  defp connect(text) do
    if text =~ ~r/\A[a-z0-9_]+@[A-Za-z0-9.-]+(:\d+)?\z/,
      do: {:ok, text},
      else: {:error, "a node such as mag1@convoy"}
  end

  defp serve(options) do
    Mix.Task.run("app.start", ["--no-compile"])

    with :ok <- allowed(options),
         :ok <- mesh(),
         {:ok, live} <- Live.Mesh.start_link(connect: expected(options["connect"])),
         {:ok, _page, url} <- Page.start_link(page(options, live)) do
      IO.puts("Page:  " <> url)
      options |> services() |> Page.Service.start(page(options, live)) |> Enum.each(&IO.puts/1)
      person(options["presence"], live)
    end
  end

  defp allowed(options),
    do:
      Console.Options.Page.check(
        options["page-address"],
        options["page-token-file"],
        options["page-origin"]
      )

  defp page(options, live) do
    [
      module: Live.Mesh,
      live: live,
      robots: fn -> Live.Mesh.robots(live) end,
      port: Map.get(options, "page", 0),
      address: options["page-address"],
      token: options["page-token-file"],
      origin: options["page-origin"]
    ]
  end

  defp services(options) do
    for {name, _what} <- Page.Service.all(), port = options["#{name}"], do: {name, port}
  end

  defp mesh do
    if Node.alive?() and Mesh.running?(),
      do: :ok,
      else: {:error, "this is no node of a mesh; bin/console starts one"}
  end

  # Given by the address of its machine, it has the fleet's host in its name.
  defp expected(nil), do: nil

  defp expected(connect) do
    [name, host] = String.split(connect, "@")
    [_own, fleet] = String.split(Atom.to_string(node()), "@")
    if host =~ ~r/\A\d+\.\d+\.\d+\.\d+(:\d+)?\z/, do: "#{name}@#{fleet}", else: connect
  end

  defp person(nil, live), do: watch(live, nil)

  # The keys are read here, and the notices come beside them.
  defp person(true, live) do
    case Tty.open() do
      {:ok, saved} ->
        {:ok, orders} = Orders.start_link("presence of #{node()}", fn _line, _answer -> :ok end)
        _notices = spawn_link(fn -> watch(live, nil) end)
        heard = spawn_link(fn -> heard(nil) end)
        IO.puts("Hold any key while you look after the robots; q ends this program.")
        keys(orders, heard)
        Tty.close(saved)

      :error ->
        {:error, "presence is said by the keys of a terminal, and this is none"}
    end
  end

  # Ctrl-C and Ctrl-D are keys, too; a terminal that is gone says nothing more.
  defp keys(orders, heard) do
    case IO.getn("", 1) do
      key when key in ["q", <<3>>, <<4>>, :eof] ->
        :ok

      {:error, _gone} ->
        :ok

      _key ->
        said = Orders.of_presence(System.monotonic_time(:microsecond))
        Orders.give(orders, %{said | run: &send(heard, {:answered, said.run.(&1)})})
        keys(orders, heard)
    end
  end

  # What becomes of the words, whenever that changes.
  defp heard(told) do
    receive do
      {:answered, answer} ->
        line = line(answer, Directory.attended())
        if line != told, do: IO.puts(line)
        heard(line)
    end
  end

  defp line(_answer, []), do: "no robot that is heard asks for the presence of a person"
  defp line({:ok, _said}, robots), do: "heard by #{Enum.join(robots, ", ")}"
  defp line({:error, line}, _robots), do: line

  # The page goes on until a person ends this program.
  defp watch(live, told) do
    notice = Live.Mesh.notice(live)

    if notice != told,
      do: IO.puts(notice || "heard: #{Enum.join(Live.Mesh.robots(live), ", ")}")

    receive do
    after
      @look_ms -> watch(live, notice)
    end
  end

  defp refused(:ok), do: :ok
  defp refused({:error, lines}), do: Hal.Cli.Command.refuse("console", List.wrap(lines))
end
