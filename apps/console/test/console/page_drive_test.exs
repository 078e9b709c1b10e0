defmodule Console.PageDriveTest do
  @moduledoc "What keys and pointers say to the page whose end is not told, in a real browser."
  use ExUnit.Case, async: false
  alias Console.{Browser, Live, Options, Page}
  @moduletag :realtime
  @moduletag :capture_log
  @moduletag timeout: 180_000

  @server (case Application.ensure_all_started(:mochiweb) do
             {:ok, _apps} -> nil
             _absent -> "erlang-mochiweb is not installed"
           end)
  @moduletag skip: @server || Browser.why_not()

  # One robot, chosen on the page, to be driven by keys.
  setup do
    {:ok, options} = "--robots 1 --landmark none" |> OptionParser.split() |> Options.parse()
    {:ok, live} = Live.Fleet.start_link(Options.trial(options))
    {:ok, _page, url} = Page.start_link(module: Live.Fleet, live: live, robots: options.robots)
    browser = Browser.open({1280, 800})
    Browser.go(browser, url)
    Browser.await(browser, "return document.querySelectorAll('#robots tr').length === 1")
    Browser.run(browser, "document.querySelector('#robots button').click()")
    [%{id: id}] = Live.Fleet.scene(live).robots
    %{browser: browser, id: id, live: live}
  end

  # What a key held down says again and again.
  defp repeat(browser, code, key),
    do: Browser.keyboard(browser, :down, code: code, key: key, autoRepeat: true)

  defp answer(browser),
    do: Browser.run(browser, "return document.getElementById('answer').textContent")

  test "whatever takes a key's release away ends driving, although the key repeats", %{
    browser: browser,
    id: id,
    live: live
  } do
    Browser.run(browser, "document.getElementById('drive').click()")
    driven? = fn -> Swarm.status(id).by == :move end

    endings = [
      "a release by another name": fn ->
        Browser.keyboard(browser, :up, code: "KeyD", key: "ð")
      end,
      AltGr: fn -> Browser.keyboard(browser, :down, code: "AltRight", key: "AltGraph") end,
      Meta: fn ->
        Browser.keyboard(browser, :down, code: "MetaLeft", key: "Meta", modifiers: 4)
      end,
      "a repeat with Ctrl": fn ->
        Browser.keyboard(browser, :down, code: "KeyD", key: "d", autoRepeat: true, modifiers: 2)
      end,
      "a dialog": fn ->
        Browser.run(browser, "setTimeout(() => alert('of the browser'))")
        Swarm.Case.eventually(fn -> dismissed?(browser) end)
      end,
      "the focus elsewhere": fn ->
        Browser.run(browser, "document.getElementById('spacing').focus()")
        Browser.run(browser, "document.activeElement.blur()")
      end,
      "another tab": fn -> Browser.elsewhere(browser) end
    ]

    for {name, ending} <- endings do
      Browser.keyboard(browser, :down, code: "KeyD", key: "d")

      Swarm.Case.eventually(fn ->
        repeat(browser, "KeyD", "d")
        driven?.()
      end)

      ending.()

      ended? = fn ->
        repeat(browser, "KeyD", "d")
        not driven?.()
      end

      assert Enum.any?(1..100, fn _try -> ended?.() or pause() end), "#{name} does not end it"

      assert Browser.run(browser, "return document.getElementById('drive').ariaPressed") == "true"
      Browser.keyboard(browser, :up, code: "KeyD", key: "d")
    end

    assert Browser.errors(browser) == []
    Browser.close(browser)
    Live.Fleet.stop(live)
  end

  test "silence ends it, with a word why; a repeat of any held key speaks for all; only a new press drives again",
       %{
         browser: browser,
         id: id,
         live: live
       } do
    Browser.run(browser, "document.getElementById('drive').click()")
    driven? = fn -> Swarm.status(id).by == :move end
    press = &Browser.keyboard(browser, :down, code: &1, key: &2)
    press.("KeyW", "w")
    Swarm.Case.eventually(driven?)
    # Nothing more is told of it.
    Swarm.Case.eventually(fn -> not driven?.() end)

    Swarm.Case.eventually(fn ->
      answer(browser) =~ "#{id} stands: nothing was heard of the keys"
    end)

    for _again <- 1..20, do: pause() || repeat(browser, "KeyW", "w")
    refute driven?.()

    # Ahead and to the left; the system repeats the second key only.
    press.("KeyW", "w")
    press.("ArrowLeft", "ArrowLeft")

    Swarm.Case.eventually(fn ->
      repeat(browser, "ArrowLeft", "ArrowLeft")
      Swarm.status(id).speed > 0.4
    end)

    for _again <- 1..20, do: pause() || repeat(browser, "ArrowLeft", "ArrowLeft")
    assert Swarm.status(id).speed > 0.4
    Swarm.Case.eventually(fn -> Swarm.status(id).speed == 0.0 end)
    Browser.close(browser)
    Live.Fleet.stop(live)
  end

  test "the rule, by the times of its events", %{browser: browser, live: live} do
    assert Browser.run(browser, """
           return import("/keys.js").then(({ HeldKeys }) => {
             const event = (code, timeStamp, more = {}) => ({ code, timeStamp, repeat: false, getModifierState: () => false, ...more });
             const after = (...events) => {
               const held = new HeldKeys();
               for (const [kind, ...of] of events) held[kind](event(...of));
               return held;
             };
             const again = { repeat: true };
             const d = ["down", "KeyD", 0];
             const say = (held, ...times) => times.map((t) => String(held.way(t)) + (held.silent ? " silent" : ""));
             return [
               // The first repeat may take longer than those after it.
               say(after(d), 800, 801),
               say(after(d, ["down", "KeyD", 660, again]), 1160, 1161),
               // A repeat that comes when it has ended is no press; nor is one whose press was not told.
               say(after(d, ["down", "KeyD", 801, again]), 801),
               say(after(["down", "KeyD", 0, again]), 0),
               // A release ends its own key, a modifier all.
               say(after(d, ["down", "KeyW", 100], ["up", "KeyD", 200]), 300),
               say(after(d, ["down", "KeyW", 100], ["down", "AltRight", 200]), 200),
               say(after(["down", "KeyD", 0, { ctrlKey: true }]), 0),
             ];
           });
           """) == [
             ["0,-1", "null silent"],
             ["0,-1", "null silent"],
             ["null silent"],
             ["null"],
             ["1,0"],
             ["null"],
             ["null"]
           ]

    Browser.close(browser)
    Live.Fleet.stop(live)
  end

  test "a drag whose end is lost, a right click, two fingers and a key that repeats give no order",
       %{
         browser: browser,
         id: id,
         live: live
       } do
    answers = fn ->
      Browser.run(browser, """
      window.heard ??= [];
      window.watch ??= new MutationObserver(() => window.heard.push(document.getElementById('answer').textContent));
      window.watch.observe(document.getElementById('answer'), { childList: true });
      return window.heard;
      """)
    end

    [] = answers.()

    # Towards the middle of the hall, where nothing stands.
    [x, y] =
      Browser.run(browser, """
      const box = document.getElementById('map').getBoundingClientRect(), [r] = window.floor.scene.robots;
      const [x, y] = window.floor.toPixel(0.7 * r.x, 0.7 * r.y);
      return [Math.round(x + box.left), Math.round(y + box.top)];
      """)

    at = fn type, x, y, more -> Browser.mouse(browser, type, [x: x, y: y] ++ more) end
    left = [button: "left", buttons: 1, clickCount: 1]
    at.("mousePressed", x, y, button: "right", buttons: 2, clickCount: 1)
    at.("mouseReleased", x, y, button: "right", clickCount: 1)
    # The release was outside of what the page is told.
    at.("mousePressed", x, y + 10, left)
    Browser.run(browser, "window.dispatchEvent(new Event('blur'))")
    at.("mouseReleased", x, y + 10, button: "left", clickCount: 1)
    at.("mousePressed", x, y + 20, left)

    Browser.run(browser, """
    const finger = (type, id) => document.getElementById('map').dispatchEvent(new PointerEvent(type,
      { pointerId: id, pointerType: "touch", isPrimary: id === 7, buttons: 1, clientX: 200, clientY: 200 }));
    for (const type of ["pointerdown", "pointerup"]) finger(type, 8);
    """)

    at.("mouseReleased", x, y + 20, button: "left", clickCount: 1)
    # Then one that is whole.
    at.("mousePressed", x, y + 30, left)
    at.("mouseReleased", x, y + 30, button: "left", clickCount: 1)
    Swarm.Case.eventually(fn -> answers.() != [] end)
    assert [line] = answers.()
    assert line =~ "goto #{id}"

    Browser.run(browser, "document.getElementById('map').focus()")
    enter = [code: "Enter", key: "Enter", windowsVirtualKeyCode: 13]
    Browser.keyboard(browser, :down, [modifiers: 2] ++ enter)

    for again <- [false, true, true],
        do: Browser.keyboard(browser, :down, [autoRepeat: again] ++ enter)

    Browser.keyboard(browser, :up, enter)
    Browser.run(browser, "document.querySelector('[data-one=stop]').click()")
    Swarm.Case.eventually(fn -> List.last(answers.()) =~ "stop" end)
    assert [^line, _one_more, _stop] = answers.()
    assert Browser.errors(browser) == []
    Browser.close(browser)
    Live.Fleet.stop(live)
  end

  test "a tap with two fingers gives no order, in whatever order they come and go; one with a finger does",
       %{browser: browser, id: id, live: live} do
    Browser.run(browser, """
    window.heard = [];
    const send = WebSocket.prototype.send;
    WebSocket.prototype.send = function (line) { window.heard.push(line); return send.call(this, line); };
    """)

    # That a person sees the page is no order.
    said = fn ->
      Browser.run(browser, "return window.heard.filter((line) => !line.endsWith(' present'))")
    end

    [left, right] = [{1, 200, 300}, {2, 260, 320}]
    # Beside the map, where nothing is to be pressed.
    [x, y] =
      Browser.run(browser, """
      const box = document.getElementById('leads').getBoundingClientRect();
      return [box.left + 5, box.top + 5];
      """)

    for {first, second, last} <- [
          {left, right, right},
          {left, right, left},
          {right, left, left},
          {left, {2, x, y}, left},
          {left, {2, x, y}, {2, x, y}},
          {{1, x, y}, {2, 260, 320}, {2, 260, 320}}
        ] do
      Browser.touch(browser, "touchStart", [first])
      Browser.touch(browser, "touchStart", [first, second])
      Browser.touch(browser, "touchEnd", [last])
      Browser.touch(browser, "touchEnd", [])
      assert said.() == [], inspect({first, second, last})
    end

    Browser.touch(browser, "touchStart", [left, right])
    Browser.touch(browser, "touchEnd", [])
    assert said.() == []

    Browser.touch(browser, "touchStart", [left])
    Browser.touch(browser, "touchEnd", [])
    Swarm.Case.eventually(fn -> said.() != [] end)
    assert [line] = said.()
    assert line =~ "goto #{id}"
    assert Browser.errors(browser) == []
    Browser.close(browser)
    Live.Fleet.stop(live)
  end

  defp pause, do: receive(do: (:never -> true), after: (50 -> false))

  defp dismissed?(browser) do
    Browser.dialog(browser, :dismiss) == nil
  rescue
    # Not there yet.
    _error in RuntimeError -> false
  end
end
