defmodule Console.PageTimeTest do
  @moduledoc "The strip of time under the map, in a real browser."
  use ExUnit.Case, async: true
  alias Console.{Browser, Live, Options, Page}
  @moduletag :realtime
  @moduletag :capture_log
  @moduletag skip: Browser.why_not()

  test "one drags back to see the fleet as it was; a stop is of now, all the same" do
    {:ok, options} = Options.parse(~w(--robots 3 --seed 4 --blobs direct))
    {:ok, live} = Live.Trial.start_link(Lab.Trial, Options.trial(options), Console.Pace.new(8.0))

    {:ok, _page, url} = Page.start_link(module: Live.Trial, live: live, robots: options.robots)

    browser = Browser.open({1280, 800})
    Browser.go(browser, url)
    Browser.await(browser, "return timeline.scenes.length > 60 && timeline.events.length > 1")
    assert Browser.run(browser, "return document.getElementById('time-now').hidden")

    [x, y, width] =
      Browser.run(
        browser,
        "const b = document.getElementById('strip').getBoundingClientRect(); return [b.left, b.top + b.height / 2, b.width]"
      )

    Browser.drag(browser, [{x + width / 2, y}, {x + width / 4, y}])

    Browser.await(
      browser,
      "return document.getElementById('at').textContent.endsWith('the past')"
    )

    # It stays there, though the fleet goes on.
    then_s = Browser.run(browser, "return floor.scene.at_s")
    Browser.await(browser, "return timeline.newest.at_s > #{then_s} + 20")
    assert then_s == Browser.run(browser, "return floor.scene.at_s")

    # By keys, a scene and an event at a time.
    Browser.run(browser, "document.getElementById('strip').focus()")
    Browser.press(browser, [:left])
    Browser.await(browser, "return floor.scene.at_s < #{then_s}")

    stages =
      Browser.run(
        browser,
        "document.getElementById('time-next').click(); return timeline.events.map((e) => e.at_s)"
      )

    assert Enum.any?(stages, &(abs(&1 - Browser.run(browser, "return timeline.past")) < 0.06))

    # No robot is sent anywhere by a picture of the past, and a stop acts now.
    Browser.run(browser, "floor.on.send(0, 0)")

    Browser.await(
      browser,
      "return document.getElementById('answer').textContent.includes('press Now first')"
    )

    Browser.press(browser, [:f8])

    Browser.await(
      browser,
      "return document.getElementById('held').innerText.includes('3 of 3 robots held')"
    )

    assert Live.Trial.scene(live).estop

    Browser.run(browser, "document.getElementById('time-now').click()")

    Browser.await(
      browser,
      "return floor.scene.at_s === timeline.newest.at_s && floor.scene.estop !== null"
    )

    assert [] == Browser.errors(browser)
    Browser.close(browser)
  end
end
