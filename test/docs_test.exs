for file <- ~w(lines docs/reader docs/shown docs/sandbox docs/looked_at docs/checks),
    do: Code.require_file("#{file}.exs", __DIR__)

defmodule Docs.Case do
  @moduledoc """
  What README and docs/ tell people to type is typed, and what they show for an answer must come.
  `Docs.Reader` has the conventions, `Docs.Checks` what is not typed, and why not.

  Each document has a copy of the project to itself, where its commands run in their order, and then one VM for
  its `iex>` lines. Nothing that a reader types may change a file that came along. The modules that use this run side by
  side, each in a place of its own; the documents of one run one after the other.

  `bin/test` types what the README says; what the other documents say is typed in `bin/test long`, and only looked at
  else.
  """
  use ExUnit.CaseTemplate
  alias Docs.{Checks, Reader, Sandbox}

  @root Path.expand("..", __DIR__)

  using options do
    quote do
      alias Docs.{Checks, LookedAt, Reader, Sandbox, Shown}
      # Each of its commands has a minute.
      @moduletag unquote(options[:tags] || [])

      for document <- unquote(options[:documents]) do
        @document document
        test("#{document} tells no lie", %{place: place}, do: Docs.Case.check(@document, place))
      end
    end
  end

  setup_all context do
    place = inspect(context.module)
    on_exit(fn -> Sandbox.remove(place) end)
    Sandbox.prepare(@root, place)
    %{place: place}
  end

  @doc "All documents."
  def documents,
    do: [
      "README.md"
      | @root
        |> Path.join("docs/*.md")
        |> Path.wildcard()
        |> Enum.map(&Path.relative_to(&1, @root))
    ]

  @doc "What was measured, on its day: its commands are looked at, and not typed again."
  def reports do
    @root
    |> Path.join("docs/reports/*.md")
    |> Path.wildcard()
    |> Enum.map(&Path.relative_to(&1, @root))
  end

  @doc "All in the document is known; commands that nobody types have the words and options of their programs."
  def look(document) do
    items = Reader.items(File.read!(Path.join(@root, document)))
    assert Checks.unknown(items) == []
    assert Checks.looked_at(items, @root) ++ Checks.mentions(items, @root) == []
  end

  @doc "All is as the document says."
  def check(document, place) do
    items = Reader.items(File.read!(Path.join(@root, document)))
    assert Checks.unknown(items) == []
    folder = Sandbox.create(@root, place, document)
    wrong = Checks.commands(items, folder) ++ Checks.mentions(items, folder)
    assert wrong ++ Sandbox.session(document, items, folder) == []
    assert Sandbox.changed(@root, folder) == []
  end
end

# Those with the most to type are on their own.
defmodule System.DocsReadmeTest do
  use Docs.Case, async: true, documents: ["README.md"]
end

defmodule System.DocsExtendingTest do
  use Docs.Case, async: true, documents: ["docs/extending.md"], tags: [long: true]
end

defmodule System.DocsTypedTest do
  use Docs.Case,
    async: true,
    documents: Docs.Case.documents() -- ["README.md", "docs/extending.md"],
    tags: [long: true]
end

defmodule System.DocsTest do
  use Docs.Case, async: true, documents: []

  @root Path.expand("..", __DIR__)
  @documents Docs.Case.documents() ++ Docs.Case.reports()

  for document <- @documents do
    @document document
    test("#{document} says nothing unknown", do: Docs.Case.look(@document))
  end

  test "a lie is seen", %{place: place} do
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
    folder = Sandbox.create(@root, place, "none")
    commands = Checks.commands(items, folder)
    assert [nowhere, ill, prompt] = commands
    assert nowhere =~ "line 3: mix robot.check config/robots/mag9.exs: status 1"
    assert ill =~ "line 4: mix robot.check config/robots/min1.exs: printed instead"
    assert prompt =~ "did you mean kill?"
    assert [task, option, function, module, word] = Checks.mentions(items, folder)
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
    assert Checks.commands(copy, folder) == []
    assert Sandbox.changed(@root, folder) == ["config/robots/mag1.exs"]

    assert [strange] = Checks.unknown(Reader.items("    mixx robot.check"))
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

    commands = for {:shell, _n, text, _answer} <- items, do: Checks.command(text)
    shown = for {:shown, _n, text, _answer} <- items, do: text
    assert Checks.not_run() -- commands == []

    assert Enum.reject(Checks.shown(), fn begin ->
             Enum.any?(shown, &String.starts_with?(&1, begin))
           end) ==
             []
  end

  describe "the tables of user guide and reference" do
    defp rows(title, document \\ "user-guide.md") do
      guide = File.read!(Path.join([@root, "docs", document]))
      [_before, section] = String.split(guide, "\n#{title}\n", parts: 2)
      [section | _rest] = String.split(section, ~r/\n##+ /)

      for [_row, first] <- Regex.scan(~r/^\| (`.*?) \| /m, section),
          do: String.replace(first, "\\|", "|")
    end

    defp codes(cell), do: for([_all, code] <- Regex.scan(~r/`([^`]+)`/, cell), do: code)

    test "all text commands are there, as the robots take them" do
      forms = Enum.flat_map(rows("## Text commands", "reference.md"), &codes/1)
      words = Enum.map(forms, &hd(String.split(&1, ":")))
      assert Enum.sort(Enum.uniq(words)) == Enum.sort(Robot.Command.keywords())

      for form <- forms do
        text = form |> String.replace("NAME", "mag1") |> String.replace("COLOUR", "Red")
        text = String.replace(text, ~r/\b[A-Z]+\b(?<!Red)/, "1")
        assert {:ok, _command} = Robot.Command.parse(text, [:mag1]), form
      end
    end

    test "all behaviours of Robot.Behaviour are there" do
      told =
        for cell <- rows("## Behaviours that can be goals", "reference.md"), do: hd(codes(cell))

      known =
        for module <- Application.spec(:robot, :modules),
            String.starts_with?(inspect(module), "Robot.Behaviour."),
            {:module, _} = Code.ensure_loaded(module),
            [Robot.Behaviour] in Keyword.get_values(module.__info__(:attributes), :behaviour),
            do: inspect(module)

      assert Enum.sort(told) == Enum.sort(known)
    end

    test "all events are there, as Hal.Event has them" do
      {:docs_v1, _, _, _, %{"en" => told}, _, _} = Code.fetch_docs(Hal.Event)
      table = for line <- String.split(told, "\n"), String.starts_with?(line, "|"), do: line
      reference = File.read!(Path.join(@root, "docs/reference.md"))
      assert reference =~ Enum.join(table, "\n")
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
