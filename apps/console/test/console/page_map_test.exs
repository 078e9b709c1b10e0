defmodule Console.PageMapTest do
  @moduledoc "What the map shows of the floor, and what pointers and fingers do to it, in a real browser."
  use ExUnit.Case, async: false
  import Console.PageCase
  alias Console.{Browser, FakeLive}
  @moduletag :realtime
  @moduletag :capture_log
  @moduletag skip: why_not()

  @pair [{:mag1, {3.0, 2.0}, []}, {:min1, {4.0, 3.0}, []}]

  # A place of the window on the floor.
  defp place(browser, {px, py}) do
    [x, y] =
      Browser.run(browser, """
      const box = document.getElementById('map').getBoundingClientRect();
      return window.floor.view.toFloor(#{px} - box.left, #{py} - box.top);
      """)

    {x, y}
  end

  defp scale(browser), do: Browser.run(browser, "return window.floor.view.at.scale")

  defp press(browser, {x, y}) do
    at = [x: x, y: y, button: "left", clickCount: 1]
    Browser.mouse(browser, "mousePressed", at ++ [buttons: 1])
    Browser.mouse(browser, "mouseReleased", at)
  end

  defp near(a, b, within), do: Hal.Pose.distance(a, b) < within

  test "it begins with the fleet, brings back what drives out of it, and shows all where that is asked" do
    {live, browser} = shown(FakeLive.of(@pair), [:kill])
    fleet = scale(browser)
    {x, y} = place(browser, {464.0, 350.0})
    assert near({x, y}, {3.5, 2.5}, 1.0)

    # One that drives out of the picture.
    FakeLive.change(live, fn scene ->
      [first, second] = scene.robots
      %{scene | robots: [first, %{second | pose: Hal.Pose.new(-7.0, -4.0)}]}
    end)

    Browser.await(browser, "return window.floor.scene.robots[1].x < 0")
    Browser.await(browser, "return window.floor.view.holds([-7, -4])")
    assert scale(browser) < fleet

    # What a person has chosen stays.
    Browser.run(browser, "document.querySelector('[data-zoom=\"1.3\"]').click()")
    mine = scale(browser)
    FakeLive.change(live, &%{&1 | at_ms: 20_000})
    Browser.await(browser, "return window.floor.scene.at_s === 20")
    assert scale(browser) == mine
    Browser.run(browser, "document.querySelector('[data-fit=all]').click()")

    Browser.await(
      browser,
      "return window.floor.view.holds([7.5, 5.5]) && window.floor.view.holds([-7.5, -5.5])"
    )

    assert Browser.errors(browser) == []
    Browser.close(browser)
  end

  test "what the pointer is on stays under it while the wheel or two fingers zoom, and its place is told" do
    {live, browser} = shown(FakeLive.of(@pair), [:kill])
    at = {300.0, 420.0}
    {x, y} = place(browser, at)
    before = scale(browser)
    Browser.mouse(browser, "mouseMoved", x: 300, y: 420)
    told = "x #{Float.round(x, 2)}"

    Browser.await(
      browser,
      "return document.getElementById('coords').textContent.startsWith('#{told}')"
    )

    Browser.mouse(browser, "mouseWheel", x: 300, y: 420, deltaX: 0, deltaY: -100)
    Browser.await(browser, "return window.floor.view.at.scale > #{before} * 1.1")
    assert near(place(browser, at), {x, y}, 0.01)

    # Fingers 100 pixels apart go 200 apart: twice as large.
    Browser.run(
      browser,
      "document.querySelector('[data-one=start]'); document.querySelector('[data-id=mag1] button').click()"
    )

    one = scale(browser)
    middle = place(browser, {400.0, 400.0})
    Browser.touch(browser, "touchStart", [{1, 350, 400}])
    Browser.touch(browser, "touchStart", [{1, 350, 400}, {2, 450, 400}])
    Browser.touch(browser, "touchMove", [{1, 300, 400}, {2, 500, 400}])
    Browser.await(browser, "return window.floor.view.at.scale > #{one} * 1.5")
    Browser.touch(browser, "touchEnd", [{2, 500, 400}])
    Browser.touch(browser, "touchEnd", [])
    assert_in_delta scale(browser), 2 * one, 0.05 * one
    assert near(place(browser, {400.0, 400.0}), middle, 0.05)
    assert FakeLive.told(live) == []
    assert Browser.errors(browser) == []
    Browser.close(browser)
  end

  test "a simulated robot goes where a click says, and its goal is shown at once; for a real one a second click is needed" do
    for {offers, asks?} <- [{[:kill], false}, {[:arm], true}] do
      {live, browser} = shown(FakeLive.of(@pair), offers)
      Browser.run(browser, "document.querySelector('[data-id=mag1] button').click()")
      goal = {2.0, 3.0}
      press(browser, pixel(browser, goal))
      Browser.await(browser, "return window.floor.ghost?.id === 'mag1'")
      [x, y] = Browser.run(browser, "return [window.floor.ghost.x, window.floor.ghost.y]")
      assert near({x, y}, goal, 0.05)

      if asks? do
        assert FakeLive.told(live) == []
        # Cancelled, there is no goal, and no order.
        Browser.run(browser, "[...document.querySelectorAll('#confirm button')][1].click()")
        assert Browser.run(browser, "return window.floor.ghost") == nil
        press(browser, pixel(browser, goal))
        Browser.await(browser, "return document.getElementById('confirm').checkVisibility()")
        Browser.run(browser, "document.querySelector('#confirm button').click()")
      end

      Browser.await(
        browser,
        "return document.getElementById('answer').textContent.startsWith('goto mag1')"
      )

      assert [{:tell, [:mag1], {:goto, gx, gy, nil}}] = FakeLive.told(live)
      assert near({gx, gy}, goal, 0.05)
      assert Browser.errors(browser) == []
      Browser.close(browser)
    end
  end

  test "a finger that stays sends the chosen robot there; one that moves, or is joined by another, does not" do
    # Near enough to the other robot that a tap would choose that one.
    {live, browser} = shown(FakeLive.of(@pair), [:kill])
    Browser.run(browser, "document.querySelector('[data-id=mag1] button').click()")
    {x, y} = pixel(browser, {4.0, 3.0})
    {x, y} = {x + 14, y}
    goal = place(browser, {x, y})
    chosen = "return document.querySelector('tr.chosen').dataset.id"

    Browser.touch(browser, "touchStart", [{1, x, y}])
    Browser.await(browser, "return window.floor.ghost?.id === 'mag1'")
    Browser.touch(browser, "touchEnd", [])
    assert Browser.run(browser, chosen) == "mag1"

    Browser.await(
      browser,
      "return document.getElementById('answer').textContent.startsWith('goto mag1')"
    )

    assert [{:tell, [:mag1], {:goto, gx, gy, nil}}] = FakeLive.told(live)
    assert near({gx, gy}, goal, 0.05)

    # What is waited for is longer than a press.
    wait =
      "const begun = window.began ??= performance.now(); return performance.now() - begun > 700"

    Browser.touch(browser, "touchStart", [{1, 200, 500}])
    Browser.touch(browser, "touchMove", [{1, 230, 500}])
    Browser.await(browser, wait)
    Browser.touch(browser, "touchEnd", [])
    Browser.run(browser, "window.began = undefined")
    Browser.touch(browser, "touchStart", [{1, 200, 500}])
    Browser.touch(browser, "touchStart", [{1, 200, 500}, {2, 300, 500}])
    Browser.await(browser, wait)
    Browser.touch(browser, "touchEnd", [])
    assert length(FakeLive.told(live)) == 1

    # A tap chooses what is there.
    Browser.touch(browser, "touchStart", [{1, x, y}])
    Browser.touch(browser, "touchEnd", [])
    Browser.await(browser, "return document.querySelector('tr.chosen')?.dataset.id === 'min1'")
    assert length(FakeLive.told(live)) == 1
    assert Browser.errors(browser) == []
    Browser.close(browser)
  end

  test "what the mission draws is drawn: its points where they are, and their labels" do
    layer = [
      {:polyline, "course", [{2.0, 1.0}, {5.0, 4.0}]},
      {:points, "points", [{5.0, 4.0, "2: 7 s ago"}]}
    ]

    {_live, browser} = shown(FakeLive.of(@pair, layer: layer), [:kill])

    assert Browser.run(browser, """
           const c = window.floor.canvas.getContext("2d"), words = [], to = [];
           const fillText = c.fillText, arc = c.arc;
           c.fillText = function (text, ...at) { words.push(text); return fillText.call(this, text, ...at); };
           c.arc = function (x, y, ...more) { to.push(window.floor.view.toFloor(x, y).map((m) => m.toFixed(2)).join()); return arc.call(this, x, y, ...more); };
           window.floor.paint();
           return [words.includes("2: 7 s ago"), to.includes("5.00,4.00")];
           """) == [true, true]

    assert Browser.errors(browser) == []
    Browser.close(browser)
  end

  test "a robot that cannot move is not sent, and the page says why" do
    held = [{:mag1, {3.0, 2.0}, state: "disarmed", arming: {:disarmed, nil}}]
    {live, browser} = shown(FakeLive.of(held), [:arm])
    Browser.run(browser, "document.querySelector('[data-id=mag1] button').click()")
    press(browser, pixel(browser, {2.0, 3.0}))

    Browser.await(
      browser,
      "return document.getElementById('answer').textContent === 'mag1 cannot move: disarmed: arm it first'"
    )

    assert Browser.run(browser, "return window.floor.ghost") == nil
    assert FakeLive.told(live) == []
    Browser.close(browser)
  end
end
