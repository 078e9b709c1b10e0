defmodule Tools.ApiTest do
  use ExUnit.Case, async: true
  import ExUnit.CaptureIO
  alias Console.Browser
  alias Tools.Api
  alias Tools.Api.{Docs, Html, Links}
  doctest Tools.Api.Rooms
  doctest Tools.Api.Links

  @tag :tmp_dir
  test "without its program there is one line", %{tmp_dir: folder} do
    assert Api.write(folder, "no-such-cmark") ==
             {:error, "no-such-cmark is not installed (on Debian: cmark-gfm)"}

    assert File.ls!(folder) == []
  end

  test "more words than a folder are refused" do
    said =
      capture_io(:stderr, fn ->
        assert catch_exit(Mix.Tasks.Api.run(["a", "b"])) == {:shutdown, 1}
      end)

    assert said == "api: expected one folder, got a b\n"
  end

  test "names in backticks are links, where they mean something public" do
    swarm = %Docs{
      name: "Swarm",
      summary: "",
      text: "",
      entries: [entry(:function, :goto, 3, defaults: 1), entry(:type, :place, 0)]
    }

    task = %Docs{name: "Mix.Tasks.Robot.Check", summary: "", text: "", entries: []}
    links = Links.new([swarm, task])
    text = &Links.text(links, "Swarm", "<p><code>#{&1}</code></p>")

    for {name, href} <- [
          {"Swarm.goto/3", "Swarm.html#goto/3"},
          {"goto/2", "Swarm.html#goto/3"},
          {"t:Swarm.place/0", "Swarm.html#t:place/0"},
          {"t:place/0", "Swarm.html#t:place/0"},
          {"mix robot.check", "Mix.Tasks.Robot.Check.html"}
        ],
        do: assert(text.(name) == ~s(<p><a href="#{href}"><code>#{name}</code></a></p>))

    for name <- ["goto/4", "place/0", "Swarm", "Swarm.Hidden", "c:goto/3", "enp3s0"],
        do: assert(text.(name) == "<p><code>#{name}</code></p>")

    for html <- ["<pre><code>goto/3</code></pre>", ~s(<a href="x"><code>goto/3</code></a>)],
        do: assert(Links.text(links, "Swarm", html) == html)

    assert Links.code(links, "Robot", "go(Swarm.place(), place(), A.Swarm.place())") ==
             ~s[go(<a href="Swarm.html#t:place/0">Swarm.place()</a>, place(), A.Swarm.place())]
  end

  test "what is deprecated, and since when something is there, is said; text cannot become HTML" do
    entry =
      entry(:function, :go, 1,
        deprecated: "use <stop>",
        since: "0.2",
        code: ["@spec go(a) :: %{b: <<>>}"]
      )

    module = %Docs{
      name: "Robot",
      summary: "<p>Sum.</p>\n",
      text: "<p>Text.</p>\n",
      entries: [entry]
    }

    html = IO.iodata_to_binary(Html.module({:robot, "x", module}, %{}))
    assert html =~ ~s(<p class="note">Deprecated: use &lt;stop&gt;</p>)
    assert html =~ ~s(<p class="note">Since 0.2</p>)
    assert html =~ "@spec go(a) :: %{b: &lt;&lt;&gt;&gt;}"

    assert IO.iodata_to_binary(Html.index([{:robot, "x", module}])) =~
             ~s(Robot</a> <span>Sum.</span>)
  end

  defp entry(kind, name, arity, more \\ []) do
    Map.merge(
      %{
        kind: kind,
        name: name,
        arity: arity,
        defaults: 0,
        head: "#{name}",
        text: "",
        code: [],
        deprecated: nil,
        since: nil
      },
      Map.new(more)
    )
  end

  @tag :tmp_dir
  @tag skip: System.find_executable("cmark-gfm") == nil && "cmark-gfm is not installed"
  test "each link leads somewhere, only public modules have a page, and the bytes are the same again",
       %{tmp_dir: folder} do
    assert {:ok, count} = Api.write(folder)
    assert count > 300
    files = files(folder)
    assert map_size(files) == count + 3

    ids =
      for {name, html} <- files,
          [_, id] <- Regex.scan(~r/ id="([^"]+)"/, html),
          into: MapSet.new(),
          do: {name, id}

    broken =
      for {name, html} <- files,
          [_, link] <- Regex.scan(~r/ (?:href|src)="([^"]+)"/, html),
          not String.starts_with?(link, "https://"),
          not leads?(String.split(link, "#"), name, files, ids),
          uniq: true,
          do: {name, link}

    assert broken == []

    assert is_map_key(files, "Swarm.html")
    assert files["Swarm.html"] =~ ~s(<a href="Robot.Mission.html)
    assert files["Robot.Mission.html"] =~ ~s(id="c:layer/1")
    assert files["Robot.Mission.html"] =~ "<h2>Callbacks</h2>"
    # A table, and a module that is its own app's alone.
    assert files["Agents.Envelope.html"] =~ "<table>"
    refute is_map_key(files, "Console.Page.Feed.html")
    refute files["index.html"] =~ "Console.Page.Feed"
    # Modules of tests are none of the app's.
    refute files["index.html"] =~ "Console.Runs"

    [hal, swarm] =
      for app <- ["hal", "swarm"],
          do: elem(:binary.match(files["index.html"], ~s(<h2 id="#{app}">)), 0)

    assert hal < swarm

    assert Api.write(folder) == {:ok, count}
    assert files(folder) == files
  end

  @tag :tmp_dir
  @tag :realtime
  @tag skip: Browser.why_not()
  test "the index finds modules by what they are and by what they have", %{tmp_dir: folder} do
    entry = entry(:function, :goto, 2)
    swarm = %Docs{name: "Swarm", summary: "<p>Commands.</p>", text: "", entries: [entry]}
    vision = %Docs{name: "Vision", summary: "<p>Finds blobs.</p>", text: "", entries: []}

    File.write!(
      Path.join(folder, "index.html"),
      Html.index([{:swarm, "", swarm}, {:vision, "", vision}])
    )

    for name <- ["api.css", "api.js"],
        do: File.cp!(Path.join("assets", name), Path.join(folder, name))

    browser = Browser.open({1280, 800})
    Browser.go(browser, "file://#{Path.expand(folder)}/index.html")

    shown = fn typed ->
      Browser.run(browser, """
      const box = document.querySelector('#search input');
      box.value = '#{typed}';
      box.dispatchEvent(new Event('input'));
      return [...document.querySelectorAll('#index a')].filter((a) => a.checkVisibility()).map((a) => a.textContent);
      """)
    end

    assert shown.("") == ["Swarm", "Vision"]
    assert shown.("go") == ["Swarm", "goto/2"]
    assert shown.("BLOBS vis") == ["Vision"]
    assert shown.("blobs goto") == []

    assert Browser.run(browser, "return document.querySelector('#found').textContent") ==
             "0 of 2 modules"

    assert Browser.errors(browser) == []
    Browser.close(browser)
  end

  defp files(folder),
    do: for(name <- File.ls!(folder), into: %{}, do: {name, File.read!(Path.join(folder, name))})

  defp leads?([page], _from, files, _ids), do: is_map_key(files, page)
  defp leads?(["", id], from, _files, ids), do: {from, id} in ids
  defp leads?([page, id], _from, _files, ids), do: {page, id} in ids
end
