defmodule Console.PageProxyTest do
  @moduledoc "The page where its script or its connection is missing, and behind a proxy, in a real browser."
  use ExUnit.Case, async: false
  alias Console.{Browser, HttpsProxy, Live, Options, Page}
  @moduletag :realtime
  @moduletag :capture_log
  @moduletag timeout: 180_000

  @server (case Application.ensure_all_started(:mochiweb) do
             {:ok, _apps} -> nil
             _absent -> "erlang-mochiweb is not installed"
           end)
  @moduletag skip: @server || Browser.why_not()

  @name "robots.lab.example"
  @flags ["--ignore-certificate-errors", "--host-resolver-rules=MAP #{@name} 127.0.0.1"]

  setup do
    {:ok, options} =
      "--robots 2 --seed 4 --blobs direct" |> OptionParser.split() |> Options.parse()

    start = {Live.Trial, :start_link, [Lab.Trial, Options.trial(options), Console.Pace.new(:max)]}

    live = start_supervised!(%{id: :live, start: start})
    %{source: [module: Live.Trial, live: live, robots: options.robots]}
  end

  defp page(source, options \\ []) do
    {:ok, page, url} = Page.start_link(source ++ options)
    {page, URI.parse(url).port}
  end

  # What a person sees of all buttons, and of that of the emergency stop.
  defp dead(browser) do
    Browser.run(browser, """
    const all = [...document.querySelectorAll("button, input, select")], stop = document.getElementById("estop");
    return [all.every((e) => e.matches(":disabled")), stop.matches(":disabled"), stop.querySelector("s") !== null,
      document.getElementById("fleet").textContent];
    """)
  end

  defp live(browser) do
    Browser.await(browser, "return document.querySelectorAll('#robots tr').length === 2")
    Browser.run(browser, "document.getElementById('estop').click()")
    said = "return document.getElementById('answer').textContent === 'estop: accepted'"
    Browser.await(browser, said)
  end

  test "the emergency stop looks dead from the first byte, and whenever there is no connection",
       %{
         source: source
       } do
    {page, port} = page(source)
    browser = Browser.open({1280, 800})
    Browser.block(browser, ["*/page.js", "*/page.css"])
    Browser.go(browser, "http://127.0.0.1:#{port}/")

    assert [true, true, true, "Nothing on this page works yet, not even the emergency stop." <> _] =
             dead(browser)

    Browser.block(browser, [])
    Browser.go(browser, "http://127.0.0.1:#{port}/")
    live(browser)
    assert [false, false, false, _fleet] = dead(browser)

    # The connection stands, and nothing comes: a stop may still arrive.
    crossed = fn selector ->
      Browser.run(browser, """
      return getComputedStyle(document.querySelector('#{selector}')).textDecorationLine === 'line-through';
      """)
    end

    :sys.suspend(Page.Feed.of(page))
    Browser.await(browser, "return document.getElementById('fleet').className === 'lost'")
    assert [false, false, false, _fleet] = dead(browser)

    assert Enum.map(["#estop", "[data-line=stop]", "#start", "#reset"], crossed) == [
             false,
             false,
             true,
             true
           ]

    :sys.resume(Page.Feed.of(page))
    Browser.await(browser, "return document.getElementById('fleet').className === ''")
    refute crossed.("#start")

    Process.unlink(page)
    :ok = Supervisor.stop(page)
    Browser.await(browser, "return document.getElementById('estop').matches(':disabled')")
    assert [true, true, true, "No connection" <> _] = dead(browser)
    {_page, ^port} = page(source, port: port)
    Browser.await(browser, "return !document.getElementById('estop').matches(':disabled')")
    live(browser)
    Browser.close(browser)
  end

  test "behind a proxy it works if it is told so, with any Host, and with a prefix of the path",
       %{
         source: source
       } do
    for options <- [[], [host: "127.0.0.1"], [prefix: "/fleet"]] do
      # The proxy needs the page's port, and the page that of the proxy.
      {:ok, held} = :gen_tcp.listen(0, ip: {127, 0, 0, 1}, reuseaddr: true)
      {:ok, port} = :inet.port(held)
      :gen_tcp.close(held)
      origin = "https://#{@name}:#{HttpsProxy.start(port, options)}"
      {_page, ^port} = page(source, port: port, origin: origin, token: "a-secret-token")
      browser = Browser.open({1280, 800}, @flags)
      Browser.go(browser, "#{origin}#{options[:prefix]}/?token=a-secret-token")
      live(browser)
      assert Browser.errors(browser) == []
      Browser.close(browser)
    end
  end

  test "behind a proxy of which it was not told, nothing looks alive, and the page says what to do",
       %{
         source: source
       } do
    {_page, port} = page(source)
    origin = "https://#{@name}:#{HttpsProxy.start(port, host: "127.0.0.1")}"
    browser = Browser.open({1280, 800}, @flags)
    Browser.go(browser, origin <> "/")

    Browser.await(
      browser,
      "return document.getElementById('fleet').textContent.includes('--page-origin')"
    )

    assert [true, true, true, _fleet] = dead(browser)
    assert Enum.any?(Browser.errors(browser), &(&1 =~ "403"))
    Browser.close(browser)
  end
end
