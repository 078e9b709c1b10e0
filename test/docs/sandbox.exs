defmodule Docs.Sandbox do
  @moduledoc """
  A copy of the project for the commands of one document, and the shells in which its `iex>` lines are typed.

  The copies of a place are made one after the other, with what was built, which is copied and brought up to date
  once, before the first document: what the project itself goes on with stays as it is.
  """
  alias Docs.Reader

  @left_out ~w(_build deps tmp .git convoy.secret certs)
  # Nothing here meets another fleet of this machine, nor finds a camera.
  @environment [{"CONVOY_INTERFACE", "127.0.0.1"}]
  # The Mix tasks that leave all else of their VM as it is.
  @tasks ~w(blobs calibrate chaos demo fleet.certs fleet.secret replay robot.check scenario)

  @doc "Makes the folder, with what was built in it. Where Mix builds all again, this takes as long as that."
  @spec prepare(Path.t(), String.t()) :: Path.t()
  def prepare(root, place), do: create(root, place, "none")

  @doc "The folder, with what the document takes for granted."
  @spec create(Path.t(), String.t(), String.t()) :: Path.t()
  def create(root, place, document) do
    folder = folder(place)
    File.mkdir_p!(folder)

    for name <- File.ls!(folder), name != "_build", do: File.rm_rf!(Path.join(folder, name))

    copy(root, folder, File.ls!(root) -- ["apps" | @left_out])
    for app <- File.ls!(Path.join(root, "apps")), do: copy_folder(root, folder, "apps/#{app}")
    same_time(root, folder, "apps")
    built(root, folder)
    given(document, folder)
    folder
  end

  @doc "Takes the folder away, and what was built."
  @spec remove(String.t()) :: :ok
  def remove(place) do
    File.rm_rf!(folder(place))
    :ok
  end

  defp folder(place), do: Path.join(System.tmp_dir!(), "convoy-docs-#{System.pid()}-#{place}")

  # That of these tests; what else was built is not changed by a document.
  defp built(root, folder) do
    [from, to] = for top <- [root, folder], do: Path.join(top, "_build")
    mine = to_string(Mix.env())

    unless File.exists?(to) do
      File.mkdir_p!(Path.join([to, mine, "lib"]))
      copy(Path.join(from, mine), Path.join(to, mine), File.ls!(Path.join(from, mine)) -- ["lib"])

      # The suites of the apps, which may run beside this one, write their protocols meanwhile.
      for app <- File.ls!(Path.join([from, mine, "lib"])) do
        [app_from, app_to] = for top <- [from, to], do: Path.join([top, mine, "lib", app])
        File.mkdir_p!(app_to)
        copy(app_from, app_to, File.ls!(app_from) -- ["consolidated"])
      end

      for name <- File.ls!(from),
          name != mine,
          do: File.ln_s!(Path.join(from, name), Path.join(to, name))

      # Newer Mix builds all again in another folder: no command of a document has to wait for that.
      {printed, status} = System.cmd(Path.join(folder, "bin/build"), [], stderr_to_stdout: true)
      status == 0 || raise "bin/build in #{folder}: status #{status}: #{printed}"
    end
  end

  # Without what the tests of an app have in their folder for temporary files: it comes and goes meanwhile, and is more
  # than all the rest.
  defp copy_folder(root, folder, name) do
    [from, to] = for top <- [root, folder], do: Path.join(top, name)
    File.mkdir_p!(to)
    copy(from, to, File.ls!(from) -- @left_out)
    same_time(root, folder, name)
  end

  defp same_time(root, folder, name) do
    [from, to] = for top <- [root, folder], do: Path.join(top, name)
    {_, 0} = System.cmd("touch", ["-r", from, to])
  end

  # With their times, so that nothing is built again.
  defp copy(from, to, names) do
    {_, 0} = System.cmd("cp", ["-a" | Enum.map(names, &Path.join(from, &1))] ++ [to])
  end

  # A picture with two colours, and the colour file that the page shows.
  defp given("docs/user-guide.md", folder) do
    {_, 0} =
      System.cmd("ffmpeg", ~w(-v error -f lavfi -i color=c=blue:s=640x480 -frames:v 1 photo.jpg),
        cd: folder
      )

    items = Reader.items(File.read!(Path.join(folder, "docs/user-guide.md")))
    {:shown, _n, first, rest} = Enum.find(items, &match?({:shown, _, "[Colors]", _}, &1))
    File.write!(Path.join(folder, "sweets.txt"), first <> "\n" <> rest <> "\n")
  end

  defp given("docs/robots.md", folder) do
    File.mkdir_p!(Path.join(folder, "old"))

    File.write!(Path.join(folder, "old/mag3.cfg"), """
    driver ( name "rflex" provides ["odometry:::position2d:0" "sonar:0"] rflex_serial_port "/dev/ttyR0"
      m_length 0.4 m_width 0.4 odo_distance_conversion 31387 odo_angle_conversion 4654.2
      range_distance_conversion 1.474 )
    driver ( name "sicklms200" provides ["laser:0"] )
    """)
  end

  # The pages that go on from a secret tell how it is made.
  defp given(_document, _folder), do: :ok

  @doc "Writes a file as the reader does, whose folder must be there."
  @spec write(Path.t(), String.t(), Path.t()) :: String.t() | nil
  def write(path, text, folder) do
    with {:error, reason} <- File.write(Path.join(folder, path), text),
         do: "#{:file.format_error(reason)}",
         else: (:ok -> nil)
  end

  @doc """
  Runs lines in the folder's shell, one after the other; of each, `nil`, or what is wrong with what came. Where several
  tasks of Mix come one behind the other, they share a VM.
  """
  @spec run([{line :: String.t(), answer :: String.t()}], Path.t()) :: [String.t() | nil]
  def run(lines, folder) do
    lines
    |> Enum.chunk_by(fn {line, _answer} -> shared?(line) end)
    |> Enum.flat_map(fn chunk ->
      Enum.zip(chunk, answers(Enum.map(chunk, &elem(&1, 0)), folder))
    end)
    |> Enum.map(fn {{line, answer}, came} -> wrong(line, answer, came) end)
  end

  defp answers(lines, folder) do
    if Enum.count(lines, &task?/1) > 1,
      do: together(lines, folder),
      else: Enum.map(lines, &command(&1, folder))
  end

  defp together(lines, folder) do
    options = [cd: folder, env: @environment, stderr_to_stdout: true]

    for {printed, "", status} <- Lines.run(Enum.map(lines, &words/1), options),
        do: {printed, status}
  end

  # Our tasks, without anything that only a shell understands, and what is not a program of ours.
  defp shared?(line), do: task?(line) or not (line =~ ~r/\b(mix|bin)\b/)

  defp task?(line) do
    case Regex.run(~r/^mix ([a-z.]+)[^;|&<>$`'"]*$/, plain(line)) do
      [_all, task] -> task in @tasks
      nil -> false
    end
  end

  defp words(line) do
    if task?(line), do: line |> plain() |> OptionParser.split() |> tl(), else: line
  end

  # Without the remark.
  defp plain(line), do: line |> String.replace("\\\n", " ") |> String.replace(~r/\s#.*$/, "")

  defp wrong(line, answer, {printed, status}) do
    # A remark such as `# 2: no landmark` behind `echo $?` tells the status.
    told = with [_all, told] <- Regex.run(~r/echo \$\?\s+# (\d+):/, line), do: told

    cond do
      status != 0 -> "status #{status}: #{printed}"
      told && List.last(String.split(printed)) != told -> "printed #{printed}"
      answer != "" and not Reader.like?(answer, printed) -> "printed instead: #{printed}"
      true -> nil
    end
  end

  @doc "The files of the project that are not as they came."
  @spec changed(Path.t(), Path.t()) :: [Path.t()]
  def changed(root, folder) do
    for path <- Path.wildcard(Path.join(root, "{bin,config,docs,rel}/**")),
        File.regular?(path),
        name = Path.relative_to(path, root),
        File.read(path) != File.read(Path.join(folder, name)),
        do: name
  end

  @doc "What a command prints, on both ways, and its status."
  @spec command(String.t(), Path.t()) :: {String.t(), non_neg_integer()}
  def command(line, folder) do
    options = [cd: folder, stderr_to_stdout: true, env: @environment]
    # Without an input to wait for.
    System.cmd("timeout", ["60", "sh", "-c", "exec </dev/null\n" <> line], options)
  end

  @doc "Types the document's lines of Elixir; what is wrong with them, a line each."
  @spec session(String.t(), [Reader.item()], Path.t(), non_neg_integer()) :: [String.t()]
  def session(document, items, folder, patience_ms \\ 10_000) do
    case lines(items) do
      [] -> []
      lines -> type(document, lines, folder, patience_ms)
    end
  end

  defp lines(items) do
    Enum.flat_map(items, fn
      {:iex, n, code, shown} -> [{n, code, shown}]
      {:elixir, n, code, _none} -> expressions(code, n)
      _other -> []
    end)
  end

  # An expression, and the remarks below it, which say its value.
  defp expressions(code, first) do
    {:ok, tree} = Code.string_to_quoted(code)

    starts =
      for {_, meta, _} = expression <- block(tree), line = start(expression, meta), do: line

    lines = String.split(code, "\n")

    for {from, to} <- Enum.zip(starts, tl(starts) ++ [length(lines) + 1]) do
      part = Enum.slice(lines, (from - 1)..(to - 2)//1)

      {value, code} =
        part
        |> Enum.reverse()
        |> Enum.drop_while(&(&1 == ""))
        |> Enum.split_while(&(&1 =~ ~r/^# /))

      value = value |> Enum.reverse() |> Enum.map_join("\n", &String.replace_prefix(&1, "# ", ""))
      {first + from - 1, code |> Enum.reverse() |> Enum.join("\n"), value}
    end
  end

  defp block({:__block__, _meta, expressions}), do: expressions
  defp block(expression), do: [expression]

  # That of a call with a dot is where the dot is.
  defp start(expression, meta) do
    {_tree, first} =
      Macro.prewalk(expression, meta[:line], fn
        {_, [_ | _] = meta, _} = node, first -> {node, min(first, meta[:line] || first)}
        node, first -> {node, first}
      end)

    first
  end

  defp type(document, lines, folder, patience_ms) do
    [asked, told] = for name <- ["asked", "told"], do: Path.join(folder, "docs-" <> name)
    File.write!(asked, :erlang.term_to_binary({before(document), lines, patience_ms}))
    environment = [{"DOCS_LINES", asked}, {"DOCS_TOLD", told} | @environment]
    {printed, status} = shell(document, folder, environment)

    case File.read(told) do
      {:ok, answers} ->
        for {n, answer} <- :erlang.binary_to_term(answers),
            answer != :ok,
            do: "line #{n}: #{said(answer)}"

      {:error, _none} ->
        ["its shell ended with status #{status}: #{printed}"]
    end
  end

  defp said({:printed, printed}), do: "printed instead: #{printed}"
  defp said({:raised, line}), do: "raised: #{line}"
  defp said({:refused, answer}), do: "answered #{answer}"

  # Two nodes, as the page has them, in a fleet of their own.
  defp shell("docs/networking.md", folder, environment) do
    {_, 0} = command("test -e convoy.secret || mix fleet.secret", folder)
    ports = [first, second | _] = free_ports()
    peers = Enum.map_join(Enum.take(ports, 2), ",", &"127.0.0.1:#{&1}")
    common = [{"CONVOY_UDP_PEERS", peers} | environment]
    [_, _, third, fourth] = ports

    other = [{"CONVOY_UDP_PORT", "#{second}"}, {"CONVOY_DIST_PORT", "#{fourth}"} | common]
    port = node("bin/node mag2", folder, other)
    mine = [{"CONVOY_UDP_PORT", "#{first}"}, {"CONVOY_DIST_PORT", "#{third}"} | common]
    options = [cd: folder, env: mine, stderr_to_stdout: true]

    answer =
      System.cmd(
        "sh",
        ["-c", "exec </dev/null; exec timeout 60 bin/node mag1 test/docs/session.exs"],
        options
      )

    Port.close(port)
    answer
  end

  defp shell(_document, folder, environment) do
    options = [cd: folder, env: environment, stderr_to_stdout: true]
    System.cmd("timeout", ~w(60 mix run test/docs/session.exs), options)
  end

  # A shell that waits for what is typed, and ends when its input does.
  defp node(line, folder, environment) do
    environment = for {name, value} <- environment, do: {to_charlist(name), to_charlist(value)}
    sh = System.find_executable("sh")

    Port.open({:spawn_executable, sh}, [
      :binary,
      :hide,
      :stderr_to_stdout,
      cd: folder,
      env: environment,
      args: ["-c", "exec " <> line]
    ])
  end

  defp free_ports do
    opened =
      for kind <- [:udp, :udp, :tcp, :tcp] do
        {:ok, socket} = if kind == :udp, do: :gen_udp.open(0), else: :gen_tcp.listen(0, [])
        {kind, socket}
      end

    for {kind, socket} <- opened do
      {:ok, port} = :inet.port(socket)
      if kind == :udp, do: :gen_udp.close(socket), else: :gen_tcp.close(socket)
      port
    end
  end

  # What the page takes for granted: here a robot of its file, on an emulated base.
  defp before("docs/robots.md") do
    """
    alias Hal.{Pose, Profile}
    link = Path.join(File.cwd!(), "base")
    {:ok, map} = Sim.Floorplan.open("hall", 1)
    body = %{id: :mag2, profile: Profile.magellan(), pose: Pose.new(-4, 0, 0), infrared: true}
    world = Sim.World.new!(map: map, robots: [body], noise: :off)
    drive = {Sim.Device.Drive, world: :docs, robot: :mag2}
    base = [core: {Sim.Emulator.RFlexController, []}, link: link, body: drive]
    parts = [Sim.World.Directory, {Sim.World.Server, name: :docs, world: world}, {Sim.Emulator, base}]
    {:ok, _} = Supervisor.start_link(parts, strategy: :one_for_one)
    path = "config/robots/mag2.exs"
    text = String.replace(File.read!(path), ~r/# (distance: |angle: |ir_a: )/, "\\\\1")
    File.write!(path, String.replace(text, "/dev/ttyUSB0", link))
    {:ok, file} = Swarm.MemberSpec.load(path)
    {:ok, config} = Swarm.MemberSpec.config(file)
    {:ok, _} = Robot.Fleet.start_robot(Robot.Fleet, config, :permanent)
    """
  end

  defp before(_document), do: ""
end
