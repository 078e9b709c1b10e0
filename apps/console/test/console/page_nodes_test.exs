defmodule Console.PageNodesTest do
  @moduledoc "The nodes of a fleet and their programs on the page, in a browser, with robots that are processes."
  use ExUnit.Case, async: false
  import Console.PageCase
  alias Console.{Browser, FakeLive, Live, Options, PageCase}
  @moduletag :realtime
  @moduletag :capture_log
  @moduletag skip: PageCase.why_not() || false

  defp fleet(line) do
    options = options(line)
    start = {Live.Fleet, :start_link, [Options.trial(options)]}
    {options, start_supervised!(%{id: :fleet, start: start})}
  end

  defp text(browser),
    do: Browser.run(browser, "return document.getElementById('nodes').innerText")

  test "a program starts and ends there; a wrong word is refused by the robot" do
    {options, live} = fleet("--robots 2 --seed 4 --blobs direct")
    {_page, url} = page(options, Live.Fleet, live)
    browser = open(url)
    Browser.await(browser, "return document.querySelectorAll('#robots tr').length === 2")
    click(browser, "#tab-nodes")
    Browser.await(browser, "return document.querySelectorAll('#nodes button').length === 2")
    assert text(browser) =~ "#{node()}"
    assert text(browser) =~ "this node"

    click(browser, "[data-program='min1 battery']")

    Browser.await(
      browser,
      "return document.querySelector(\"[data-program='min1 battery']\").textContent === 'End'"
    )

    assert {:min1, [:battery, :programs]} in Swarm.Directory.services()

    assert Browser.run(browser, "return document.getElementById('answer').textContent") =~
             "program min1 start battery: battery runs on min1"

    assert [row] = Console.Nodes.look([:min1])

    assert %{id: :min1, why: nil, programs: [%{name: "battery", runs: true, ours: true}]} =
             hd(row.robots)

    assert Live.Fleet.command(live, {:program, :min1, :start, "batery"}) ==
             {:error, ~s(min1 has no program "batery"; it has battery; did you mean battery?)}

    assert {:error, "mag9 takes no programs" <> _} = Console.Nodes.order(:mag9, :end, "battery")

    click(browser, "[data-program='min1 battery']")

    Browser.await(
      browser,
      "return document.querySelector(\"[data-program='min1 battery']\").textContent === 'Start'"
    )

    refute {:min1, [:battery, :programs]} in Swarm.Directory.services()

    # A robot that dies is no more on its node.
    {:ok, _done} = Live.Fleet.command(live, {:kill, :min1})
    Browser.await(browser, "return document.querySelectorAll('#nodes button').length === 1")
    assert Browser.errors(browser) == []
    Browser.close(browser)
  end

  test "a button keeps the focus when what is shown is told anew, whatever its program is called" do
    {live, browser} = shown(FakeLive.of([{:mag1, {0.0, 0.0}, []}]), [])

    place = fn runs? ->
      program = %{name: "a\\\"b", runs: runs?, ours: true}
      robot = %{id: :mag1, why: nil, programs: [program]}
      node = %{node: "one@desk", state: "this node", robots: [robot]}
      FakeLive.place(live, {:ok, [node]})
    end

    place.(true)
    click(browser, "#tab-nodes")
    Browser.await(browser, "return document.querySelectorAll('#nodes button').length === 1")
    Browser.run(browser, "document.querySelector('#nodes button').focus()")
    place.(false)
    Browser.await(browser, "return document.activeElement.textContent === 'Start'")
    assert Browser.errors(browser) == []
    Browser.close(browser)
  end

  test "a run in lockstep says why it has none" do
    {options, live} = trial("--robots 2 --seed 2 --blobs direct")
    assert {:error, line} = Live.Trial.command(live, {:program, :mag1, :start, "battery"})
    assert line =~ "lockstep"
    {_page, url} = page(options, Live.Trial, live)
    browser = open(url)
    Browser.await(browser, "return document.querySelectorAll('#robots tr').length === 2")
    click(browser, "#tab-nodes")

    Browser.await(
      browser,
      "return document.getElementById('nodes-note').textContent.includes('lockstep')"
    )

    assert Browser.errors(browser) == []
    Browser.close(browser)
  end
end
