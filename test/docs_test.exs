for file <- ~w(reader.exs shown.exs sandbox.exs looked_at.exs),
    do: Code.require_file("docs/" <> file, __DIR__)

defmodule System.DocsTest do
  @moduledoc """
  What README and docs/ tell people to type is typed, and what they show for an answer must come.
  `Docs.Reader` has the conventions.

  Each document has a copy of the project to itself, where its commands run in their order, and then one VM for
  its `iex>` lines. A command that needs what is not here, or takes long, is listed below with the reason; of such a one
  only words and options are compared with what its program knows. A new line is thus run unless somebody says why not.
  Nothing that a reader types may change a file that came along.
  """
  use ExUnit.Case, async: true

  alias Docs.{LookedAt, Reader, Sandbox, Shown}

  @moduletag timeout: 180_000
  @root Path.expand("..", __DIR__)
  @documents ["README.md" | @root |> Path.join("docs/*.md") |> Path.wildcard()]
             |> Enum.map(&Path.relative_to(&1, @root))

  @live "it goes on until somebody ends it"
  @tests "it is the tests"
  @long "it takes longer than 10 s"
  @robot "it needs a robot"
  @release "it needs a release, which test/release_test.exs builds, and runs"
  @device "it needs a camera"
  @ssh "it needs another machine"
  @system "it changes this system"
  @node "its iex> lines run in such a node"

  # Commands that are not run, and why not.
  @not_run %{
    "bin/demo" => @live,
    "bin/test" => @tests,
    "bin/test-on bookworm --fresh" => @tests,
    "bin/test-on trixie --fresh" => @tests,
    "bin/setup" => @system,
    "bin/demo --nodes" => @live,
    "bin/demo --nodes --robots 4" => @live,
    "bin/demo --map floor.png:16x12 --landmark 2,1" => @live,
    "bin/demo --hardware 1" => @live,
    "bin/demo --hardware mag:1,min:1" => @live,
    "bin/node mag1" => @node,
    "bin/node mag2" => @node,
    "mix demo --headless --hardware mag:1,min:1 --seed 1" => @long,
    "mix bench demo --seeds 1-10 --maps hall --cases six,move,kill-leader" => @long,
    "mix bench demo --seeds 1-40 --maps hall,hospital --markdown table.md" => @long,
    "mix bench demo --seeds 1-40 --maps hall --cases six,exact,move,kill-leader,kill-middle,loss,slip,one,two,three,twelve" =>
      @long,
    "mix bench demo --seeds 1-20 --maps hall --cases slip,same,chain,twelve-chain,line,wedge,triangle,diamond,circle" =>
      @long,
    "mix bench swarm --nodes 3,10 --robots-in-one-node 100" => @long,
    "mix bench swarm --nodes 30 --robots-in-one-node 0" => @long,
    "mix blobs /dev/video0 --colours landmark.txt --picture out.png" => @device,
    "mix calibrate colour /dev/video0 --box 140,90,40,60 --name YellowLandmark --picture look.png" =>
      @device,
    "mix calibrate colour /dev/video0 --box 140,90,40,60 --name YellowLandmark --colours config/robots/landmark.txt" =>
      @device,
    "mix calibrate odometry config/robots/mag1.exs" => @robot,
    "MIX_ENV=prod mix release robot" => @release,
    "MIX_ENV=prod mix release fleet" => @release,
    "MIX_TARGET=robot mix deps.get" => "it needs Hex",
    "MIX_TARGET=robot MIX_ENV=prod mix release robot" => "it needs Hex",
    "ROBOT=base CONVOY_SECRET_FILE=$PWD/convoy.secret _build/prod/rel/fleet/bin/fleet start_iex" =>
      @release,
    "ROBOT=mag1 bin/robot check" => @release,
    "ROBOT=mag1 CONVOY_ROBOT_FILE=config/robots/mag1.exs bin/robot daemon" => @release,
    "ROBOT=mag1 CONVOY_ROBOT_FILE=config/robots/mag1.exs bin/robot rpc 'Swarm.arm(:mag1)'" =>
      @release,
    "ROBOT=mag1 bin/robot start" => @release,
    "ROBOT=mag1 bin/robot rpc 'Swarm.status()'" => @release,
    "ROBOT=mag1 bin/robot remote" => @release,
    "rel/deploy root@10.0.0.11 mag1" => @ssh,
    "rel/deploy --dry-run root@10.0.0.11 mag2" => @release,
    "rel/deploy root@10.0.0.11 mag2" => @ssh,
    "rel/deploy --back root@10.0.0.11" => @ssh,
    "rel/deploy --release _build/robot_prod/rel/robot root@10.0.0.11 mag1" => @ssh,
    "ssh -t root@10.0.0.11 robot remote" => @ssh,
    "scp -p convoy.secret root@mag1:/etc/convoy/secret" => @ssh,
    "scp -pr certs/mag1 root@mag1:/etc/convoy/certs/" => @ssh,
    "apt-get install --no-install-recommends openssh-server ffmpeg" => @system,
    "(umask 077; mkdir -p /etc/convoy; head -c 32 /dev/urandom | base64 > /etc/convoy/secret)" =>
      @system,
    "nft add rule inet filter input ip saddr != 10.0.0.0/24 tcp dport 9101-9303 drop" => @system,
    "nft add rule inet filter input ip saddr != 10.0.0.0/24 udp dport 4370-4371 drop" => @system,
    "erl … -proto_dist inet_tls -ssl_dist_optfile certs/mag1/ssl_dist.conf" =>
      "it is a part of a command; apps/mesh/test/mesh/distribution/connection_log_test.exs runs such nodes",
    ~S(iex --sname rem-1@lab --hidden --cookie "$COOKIE" --remsh mag1@lab --erl "-start_epmd false -kernel net_ticktime 8 -epmd_module Elixir.Mesh.Distribution.Epmd -pa _build/dev/lib/mesh/ebin") =>
      @robot
  }

  # And what others need.
  @programs [{"mix fleet.certs", "openssl"}]

  # How blocks begin that nobody types.
  @shown [
    "console -> sim -> missions -> swarm",
    "console --> sim --> missions --> swarm",
    "Swarm.Supervisor (rest_for_one",
    "camera -> Hal.Device",
    "idle -> search -> agree",
    "Comms --Transport",
    "camera          Hal.Device      BlobDetector",
    "caller             Comms of mag1",
    "caller                EStop of each robot",
    # One line of a status.
    "#min1 follow (1.20",
    "#mag1 follow (-4.69",
    # Flags and settings.
    "-kernel prevent_overlapping_partitions",
    "config :swarm, mesh: [multicast",
    "-pa _build/dev/lib/mesh/ebin",
    # What programs print that are not run here.
    "Active: active (running)",
    "Now 3.00 m straight ahead.",
    "distance     1.0240",
    "sample   784 pixels",
    "Assumed; check whether",
    "config/robots/mag1.exs:7: limits.max_liner",
    "refused mag3 at",
    "mag1  pid 3308",
    "mag1 has real drivers",
    # Files.
    "#!/bin/sh",
    "[Colors]"
  ]

  setup_all do
    Sandbox.remove()
    on_exit(&Sandbox.remove/0)
    Sandbox.prepare(@root)
    :ok
  end

  for document <- @documents do
    @document document
    test "#{document} tells no lie" do
      items = Reader.items(File.read!(Path.join(@root, @document)))
      assert unknown(items) == []
      folder = Sandbox.create(@root, @document)
      wrong = commands(items, folder) ++ mentions(items, folder)
      assert wrong ++ Sandbox.session(@document, items, folder) == []
      assert Sandbox.changed(@root, folder) == []
    end
  end

  test "a lie is seen" do
    lies = """
    Say `mix robot.chek`, `bin/demo --nods`, `Swarm.stopp()`, `Swarm.Mash` or `robot stat`.

        mix robot.check config/robots/mag9.exs
        mix robot.check config/robots/min1.exs

        config/robots/min1.exs: ill…

    As typed:

        iex> 1 + 1
        3
        iex> Swarm.stop(:nobody)
        iex> Swarm.stopp()
        iex> [1, 2]
        […, 2]
        iex> %{y: 1.0, x: {2, %{b: 3, a: "four"}}}
        %{x: {2, %{a: "f…", b: …}}, y: 1.0}
        iex> send(self(), %{y: 1, x: 2, z: 3})
        iex> flush()
        %{z: 3, x: 2, …}
        :ok
        iex> %{y: 1.0, x: 2.0}
        %{x: 2.0, y: 1.5}
        iex> %{y: 1.0, x: 2.0}
        %{x: 2.0, z: …, …}

    > go

        > kil leader
    """

    items = Reader.items(lies)
    folder = Sandbox.create(@root, "none")
    commands = commands(items, folder)
    assert [nowhere, ill, prompt] = commands
    assert nowhere =~ "line 3: mix robot.check config/robots/mag9.exs: status 1"
    assert ill =~ "line 4: mix robot.check config/robots/min1.exs: printed instead"
    assert prompt =~ "did you mean kill?"
    assert [task, option, function, module, word] = mentions(items, folder)
    assert task =~ "there is no mix robot.chek"
    assert option =~ "did you mean --nodes?"
    assert function =~ "Swarm.stopp(): there is no such function"
    assert module =~ "there is no Swarm.Mash"
    assert word =~ "there is no stat"
    session = Sandbox.session("none", items, folder, 0)
    assert [sum, nobody, raised, value, key] = session
    assert sum =~ "line 10: printed instead: 2"
    assert nobody =~ "line 12: answered {:error, \"no robot"
    assert raised =~ "line 13: raised: function Swarm.stopp/0 is undefined"
    assert value =~ "line 22: printed instead: %{"
    assert key =~ "line 24: printed instead: %{"

    assert Sandbox.changed(@root, folder) == []
    copy = Reader.items("    cp config/robots/template.exs config/robots/mag1.exs")
    assert commands(copy, folder) == []
    assert Sandbox.changed(@root, folder) == ["config/robots/mag1.exs"]

    assert [strange] = unknown(Reader.items("    mixx robot.check"))
    assert strange =~ "mixx robot.check: is this typed?"
  end

  test "files of Elixir in a document are formatted, and stand there once" do
    files =
      for document <- @documents,
          {:file, n, path, text} <- Reader.items(File.read!(Path.join(@root, document))),
          do: {"#{document}:#{n}", path, text}

    assert files != []
    paths = for {_at, path, _text} <- files, do: path
    assert paths == Enum.uniq(paths)

    for {at, path, text} <- files, Path.extname(path) in [".ex", ".exs"] do
      assert text == IO.iodata_to_binary([Code.format_string!(text), "\n"]), at
    end
  end

  test "an answer may show a map in any order, and all else in its own" do
    printed = "{:ok, %{open: true, at: {1.5, \"a, b}\"}, by: %Hal.Pose{y: 2, x: 1}}, [1, 2, 3]}"

    for shown <- [
          printed,
          "{:ok, %{at: {1.5, \"a, b}\"}, by: %Hal.Pose{x: 1, y: 2}, open: true}, [1, 2, 3]}",
          "{:ok, %{by: …, at: {1.…, …}, …}, [1, …, 3]}",
          "{:ok, %{…}, […]}",
          "{:ok, …}",
          "{:ok, %{…, open: true}, [1, …]}",
          "…"
        ],
        do: assert(Shown.like?(shown, printed), shown)

    for lie <- [
          "{:ok, %{open: true, at: {1.5, \"a, b}\"}, by: %Hal.Pose{y: 2, x: 1}}, [1, 3, 2]}",
          "{%{by: …, at: {1.…, …}, …}, :ok, [1, …, 3]}",
          # A value, a key, one too few, one too many, and none left for the `…`.
          "{:ok, %{open: false, …}, […]}",
          "{:ok, %{opened: true, …}, […]}",
          "{:ok, %{open: true, at: …}, […]}",
          "{:ok, %{open: …, at: …, by: …, to: …}, […]}",
          "{:ok, %{open: …, at: …, by: …, …}, […]}",
          "{:ok, %{open: true, open: true, …}, […]}",
          "{:ok, {…}, […]}",
          "{:ok, %{by: %Hal.Speed{…}, …}, […]}",
          "{:ok, %{at: {1.5, \"a…c\"}, …}, […]}",
          "{:ok, %{…}, [1, …, 2, 3]}",
          "{:ok, %{…}, [1, 2, 3, …]}",
          "{:ok, %{…}}",
          "{:ok, %{…}, [1, 2, 3]"
        ],
        do: refute(Shown.like?(lie, printed), lie)

    # What has brackets without partners is text.
    assert Shown.like?("#Port<0.…> a) {:ok, …", "#Port<0.5> a) {:ok, 1}, 2")
    refute Shown.like?("a) {:ok, …", "a) {:error, 1}, 2")
    assert Shown.like?("%{pid: #Top<#PID<…>>, …}", "%{ref: 1, pid: #Top<#PID<0.1.0>>}")
    refute Shown.like?("%{pid: #Top<#PID<…>>, …}", "%{ref: 1, pid: #Top<#Port<0.1>>}")
  end

  test "all that is listed here still stands in a document" do
    items =
      for document <- @documents,
          item <- Reader.items(File.read!(Path.join(@root, document))),
          do: item

    commands = for {:shell, _n, text, _answer} <- items, do: command(text)
    shown = for {:shown, _n, text, _answer} <- items, do: text
    assert Map.keys(@not_run) -- commands == []

    assert Enum.reject(@shown, fn begin -> Enum.any?(shown, &String.starts_with?(&1, begin)) end) ==
             []
  end

  # As it is typed, without the remark.
  defp command(text) do
    text
    |> String.replace(~r/\\\n\s*/, "")
    |> String.replace(~r/\s+# .*$/, "")
  end

  defp unknown(items) do
    for {kind, n, text, answer} <- items, strange?(kind, text, answer) do
      "line #{n}: #{text}: is this typed? Docs.Reader does not see it; what is only shown is listed in this test"
    end
  end

  defp strange?(:shown, text, _answer), do: not Enum.any?(@shown, &String.starts_with?(text, &1))
  defp strange?(:shell, text, answer), do: answer != "" and is_map_key(@not_run, command(text))
  defp strange?(_kind, _text, _answer), do: false

  defp commands(items, folder) do
    for {kind, n, text, answer} <- items,
        kind in [:shell, :prompt, :file],
        wrong = wrong(kind, text, answer, folder),
        do: "line #{n}: #{text}: #{wrong}"
  end

  defp wrong(:prompt, text, _answer, _folder), do: LookedAt.prompt(text)
  defp wrong(:file, path, text, folder), do: Sandbox.write(path, text, folder)

  defp wrong(:shell, text, answer, folder) do
    if is_map_key(@not_run, command(text)) or lacking(text) != nil,
      do: LookedAt.command(Reader.words(text), folder),
      else: Sandbox.run(text, answer, folder)
  end

  # Programs that a machine may do without (bin/setup).
  defp lacking(text) do
    with {_command, program} <- Enum.find(@programs, &String.starts_with?(text, elem(&1, 0))),
         nil <- System.find_executable(program) do
      IO.puts("not run, as #{program} is not here: #{text}")
      program
    else
      _there_or_not_needed -> nil
    end
  end

  # A sentence may say anything; but a command or a function that it names must be there.
  defp mentions(items, folder) do
    for {:mention, n, text, _answer} <- items,
        wrong = LookedAt.mention(text, folder),
        do: "line #{n}: #{text}: #{wrong}"
  end

  describe "the tables of the user guide" do
    defp rows(title) do
      guide = File.read!(Path.join(@root, "docs/user-guide.md"))
      [_before, section] = String.split(guide, "\n#{title}\n", parts: 2)
      [section | _rest] = String.split(section, ~r/\n##+ /)

      for [_row, first] <- Regex.scan(~r/^\| (`.*?) \| /m, section),
          do: String.replace(first, "\\|", "|")
    end

    defp codes(cell), do: for([_all, code] <- Regex.scan(~r/`([^`]+)`/, cell), do: code)

    test "all text commands are there, as the robots take them" do
      forms = Enum.flat_map(rows("### Text commands"), &codes/1)
      words = Enum.map(forms, &hd(String.split(&1, ":")))
      assert Enum.sort(Enum.uniq(words)) == Enum.sort(Robot.Command.keywords())

      for form <- forms do
        text = form |> String.replace("NAME", "mag1") |> String.replace("COLOUR", "Red")
        text = String.replace(text, ~r/\b[A-Z]+\b(?<!Red)/, "1")
        assert {:ok, _command} = Robot.Command.parse(text, [:mag1]), form
      end
    end

    test "the commands of the prompt are there, and taken" do
      for cell <- rows("## 2. Commands while it runs"),
          code <- codes(cell),
          do: assert(LookedAt.prompt(code) == nil)
    end

    test "what an answer of the door is worth stands there, of every function" do
      told = for cell <- rows("### What an answer is worth"), code <- codes(cell), do: code
      functions = for {name, _arity} <- Swarm.__info__(:functions), name != :ask, do: name
      missing = Enum.reject(Enum.uniq(functions), &("Swarm.#{&1}" in told))
      assert missing == []
    end

    test "the options of the demo are all there, and no others" do
      told =
        for cell <- rows("## 3. Options"), [option] <- Regex.scan(~r/--[a-z-]+/, cell), do: option

      known =
        for [option] <-
              Regex.scan(~r/^ +(--[a-z-]+)/m, Console.Options.help(), capture: :all_but_first),
            do: option

      assert Enum.sort(told) == Enum.sort(known -- ["--help"])
    end
  end
end
