defmodule Console.PageLinkTest do
  @moduledoc "What the page and its robots do when the connection stands still, is lost, or comes back, in a real browser."
  use ExUnit.Case, async: false
  import Console.PageCase
  import Swarm.Case, only: [eventually: 1]
  import Console.Wire, only: [ask: 2]
  alias Console.{Browser, Live, Options, Page}
  alias Console.Page.Client
  @moduletag :realtime
  @moduletag :capture_log
  @moduletag skip: why_not()

  test "one click stops all; a page that is loaded again, or whose server was away, goes on" do
    {options, live} = trial("--robots 2 --seed 2 --blobs direct")
    {page, url} = page(options, Live.Trial, live)
    browser = open(url, {390, 844})
    Browser.await(browser, "return document.querySelectorAll('#robots tr').length === 2")
    Browser.run(browser, "document.getElementById('estop').click()")

    Browser.await(
      browser,
      "return document.getElementById('answer').textContent === 'estop: accepted'"
    )

    Browser.await(
      browser,
      "const s = window.floor.scene; return s.robots.every((r) => r.state === 'E-STOP') && document.getElementById('held').innerText.includes('called by demo: 2 of 2 robots held')"
    )

    Browser.run(browser, "location.reload()")
    Browser.await(browser, "return document.querySelectorAll('#robots tr').length === 2")

    # Nobody tells the page anything: it must not pass for the present.
    :sys.suspend(Page.Feed.of(page))
    Browser.await(browser, "return document.getElementById('fleet').className === 'lost'")
    :sys.resume(Page.Feed.of(page))
    Browser.await(browser, "return document.getElementById('fleet').className === ''")
    Process.exit(Page.Feed.of(page), :kill)

    Browser.await(
      browser,
      "const was = window.was ??= window.floor.scene.at_s; return window.floor.scene.at_s > was + 20"
    )

    Process.unlink(page)
    :ok = Supervisor.stop(page)
    Browser.await(browser, "return document.getElementById('fleet').className === 'lost'")
    %URI{port: port} = URI.parse(url)
    {_page, ^url} = page(options, Live.Trial, live, port: port)
    Browser.await(browser, "return document.getElementById('fleet').className === ''")
    Browser.close(browser)
  end

  test "a robot that is driven stands soon after the key was let go, and when the page is gone" do
    options = options("--robots 1 --landmark none")
    {:ok, live} = Live.Fleet.start_link(Options.trial(options))
    {_page, url} = page(options, Live.Fleet, live)
    browser = open(url)
    Browser.await(browser, "return document.querySelectorAll('#robots tr').length === 1")

    Browser.run(
      browser,
      "document.querySelector('#robots button').click(); document.getElementById('drive').click()"
    )

    [%{id: id}] = Live.Fleet.scene(live).robots

    # What it does, and what its camera sees; the blobs in it are drawn on the page.
    Browser.await(
      browser,
      "return document.getElementById('about').textContent.includes('m/s')"
    )

    assert {200, _head, <<0xFF, 0xD8, _jpeg::binary>>} = ask(url, "GET /camera/#{id}")
    assert {404, _head, _line} = ask(url, "GET /camera/mag99")

    for ending <- [
          fn -> Browser.key(browser, :keyUp, "w") end,
          fn -> Browser.close(browser) end
        ] do
      Browser.key(browser, :keyDown, "w")
      eventually(fn -> repeat(browser) && Swarm.status(id).speed > 0.1 end)
      ending.()
      eventually(fn -> Swarm.status(id).speed == 0.0 end)
    end

    Live.Fleet.stop(live)
  end

  test "what was clicked before the link stood still is not carried out after it; a silent page sends stops alone" do
    options = options("--robots 1 --landmark none")
    {:ok, live} = Live.Fleet.start_link(Map.put(Options.trial(options), :mission, false))
    {page, url} = page(options, Live.Fleet, live)
    browser = open(url)
    [%{id: id}] = Live.Fleet.scene(live).robots
    Browser.await(browser, "return document.querySelectorAll('#robots tr').length === 1")
    click = &Browser.run(browser, "document.querySelector('#{&1}').click()")

    answered = fn text ->
      Browser.await(
        browser,
        "return document.getElementById('answer').textContent.includes('#{text}')"
      )
    end

    # It is heard a second late, and the scenes come all the while.
    hearer = connection(live)
    true = :erlang.suspend_process(hearer)
    click.("#start")
    Browser.run(browser, "window.clicked = performance.now()")
    Browser.await(browser, "return performance.now() - window.clicked > 1000")
    true = :erlang.resume_process(hearer)
    answered.("and not carried out: at most 0.5 s")
    assert %{state: :idle} = Swarm.status(id)

    # Words of driving, too: the robot does not move after the hand has let go.
    click.("#robots button")
    click.("#drive")
    true = :erlang.suspend_process(hearer)
    Browser.key(browser, :keyDown, "w")
    Browser.run(browser, "window.clicked = performance.now()")
    Browser.await(browser, "return performance.now() - window.clicked > 400")
    Browser.key(browser, :keyUp, "w")
    Browser.run(browser, "window.clicked = performance.now()")
    Browser.await(browser, "return performance.now() - window.clicked > 400")
    true = :erlang.resume_process(hearer)
    click.("#start")
    answered.("start: accepted")
    assert %{by: by} = Swarm.status(id)
    refute by == :move

    # Nothing is heard: the page says so, and holds nothing back for later.
    feed = Page.Feed.of(page)
    :ok = :sys.suspend(feed)
    Browser.await(browser, "return document.getElementById('fleet').className === 'lost'")
    click.("#start")
    answered.("not sent, because the fleet is not heard: start")
    click.("#estop")
    answered.("estop: accepted")
    eventually(fn -> Swarm.status(id).estop end)
    :ok = :sys.resume(feed)
    Browser.await(browser, "return document.getElementById('fleet').className === ''")
    assert :ok = Swarm.Case.order(&Swarm.reset/0)
    assert Browser.errors(browser) == []
    Browser.close(browser)
    Live.Fleet.stop(live)
  end

  test "a client that is killed while a key is held stops the robot, and the page connects again" do
    options = options("--robots 1 --landmark none")
    {:ok, live} = Live.Fleet.start_link(Options.trial(options))
    {_page, url} = page(options, Live.Fleet, live)
    browser = open(url)
    Browser.await(browser, "return document.querySelectorAll('#robots tr').length === 1")

    Browser.run(
      browser,
      "document.querySelector('#robots button').click(); document.getElementById('drive').click()"
    )

    [%{id: id}] = Live.Fleet.scene(live).robots
    Browser.key(browser, :keyDown, "w")
    eventually(fn -> repeat(browser) && Swarm.status(id).speed > 0.1 end)
    [client] = clients(live)
    Process.exit(client, :kill)
    killed_ms = System.monotonic_time(:millisecond)
    # From then on it brakes, as hard as its base does.
    eventually(fn -> Swarm.status(id).by != :move end)
    assert System.monotonic_time(:millisecond) - killed_ms < 1_000
    eventually(fn -> Swarm.status(id).speed == 0.0 end)
    eventually(fn -> match?([other] when other != client, clients(live)) end)
    Browser.await(browser, "return document.getElementById('fleet').className === ''")
    assert Swarm.status(id).speed == 0.0
    Browser.close(browser)
    Live.Fleet.stop(live)
  end

  # The process that hears what the page says.
  defp connection(live) do
    [client] = clients(live)
    {:links, links} = Process.info(client, :links)
    [hearer] = for pid <- links, is_pid(pid), do: pid
    hearer
  end

  defp clients(live) do
    for pid <- Process.list(),
        {:dictionary, about} <- [Process.info(pid, :dictionary)],
        about[:"$initial_call"] == {Client, :init, 1},
        :sys.get_state(pid).live == live,
        do: pid
  end
end
