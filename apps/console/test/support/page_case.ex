defmodule Console.PageCase do
  @moduledoc "What tests of the page in a browser share."
  import ExUnit.Callbacks, only: [start_supervised!: 1]
  alias Console.{Browser, FakeLive, Live, Options, Page}

  @doc "Why there is no page here, or no browser; `nil` if there are both."
  @spec why_not() :: String.t() | nil
  def why_not, do: no_server() || Browser.why_not()

  @doc "Why there is no page here, or `nil`."
  @spec no_server() :: String.t() | nil
  def no_server do
    case Application.ensure_all_started(:mochiweb) do
      {:ok, _apps} -> nil
      _absent -> "erlang-mochiweb is not installed"
    end
  end

  @doc "The options of a demo, as they are typed; a list of words where one is a path."
  def options(line) when is_binary(line), do: line |> OptionParser.split() |> options()

  def options(words) do
    {:ok, options} = Options.parse(words)
    options
  end

  @doc "A run in lockstep that goes as fast as it can, with its options."
  def trial(line \\ "--robots 3 --seed 4 --blobs direct") do
    options = options(line)
    start = {Live.Trial, :start_link, [Lab.Trial, Options.trial(options), Console.Pace.new(:max)]}
    {options, start_supervised!(%{id: make_ref(), start: start})}
  end

  @doc "Serves the page of a fleet; returns it and its address."
  def page(options, module, live, more \\ []) do
    {:ok, page, url} =
      Page.start_link([module: module, live: live, robots: options.robots] ++ more)

    {page, url}
  end

  @doc "A browser with the page."
  def open(url, size \\ {1280, 800}) do
    browser = Browser.open(size)
    Browser.go(browser, url)
    browser
  end

  @doc "A fleet that is as the scene says, and a browser that shows it."
  def shown(scene, offers, size \\ {1280, 800}) do
    {:ok, live} = FakeLive.start_link(scene, offers)
    robots = for robot <- scene.robots, do: robot.id
    {_page, url} = page(%{robots: robots}, FakeLive, live)
    browser = open(url, size)
    Browser.await(browser, "return window.floor.scene && window.floor.view.blind === false")
    {live, browser}
  end

  @doc "Clicks on what a selector finds."
  def click(browser, selector),
    do: Browser.run(browser, "document.querySelector(\"#{selector}\").click()")

  @doc "What a keyboard says again and again of a W that is held."
  def repeat(browser),
    do: Browser.keyboard(browser, :down, code: "KeyW", key: "w", autoRepeat: true)

  @doc "Where a place of the map is in the window, in pixels."
  def pixel(browser, {x, y}) do
    [px, py] =
      Browser.run(browser, """
      const box = document.getElementById('map').getBoundingClientRect();
      const [x, y] = window.floor.toPixel(#{x}, #{y});
      return [x + box.left, y + box.top];
      """)

    {px, py}
  end
end
