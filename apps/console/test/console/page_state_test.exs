defmodule Console.PageStateTest do
  @moduledoc "What the page shows of robots that cannot do their work, and what it offers for them, in a real browser."
  use ExUnit.Case, async: false
  import Console.PageCase
  alias Console.{Browser, FakeLive, Pace}
  @moduletag :realtime
  @moduletag :capture_log
  @moduletag skip: why_not()

  @fleet [
    {:mag1, {-3.0, 0.0}, state: :lead, leader?: true},
    {:mag2, {-2.0, 2.0}, alive: false, state: :not_heard},
    {:mag3, {-1.0, -2.0}, state: "disarmed", arming: {:disarmed, "the line is silent"}},
    {:min1, {0.0, 1.0}, state: :follow, offline: [:camera, :drive]},
    {:min2, {1.0, -1.0}, state: :idle, crashed: "(RuntimeError) boom, lib/gather.ex:42"},
    {:min3, {2.0, 1.0}, state: :unsure, says: "two places fit", uncertainty: 3.4},
    {:min4, {3.0, -1.0}, state: :follow, blocked_by: "a wall"},
    {:min5, {4.0, 1.0}, state: "line lost", arming: {:line_lost, nil}}
  ]

  defp text(browser, selector),
    do: Browser.run(browser, "return document.querySelector(\"#{selector}\").textContent")

  # What is greyed, with its reason.
  defp grey(browser, selector) do
    Browser.run(browser, """
    const e = document.querySelector("#{selector}");
    return e.ariaDisabled === "true" ? e.title : null;
    """)
  end

  defp hidden?(browser, selector),
    do:
      Browser.run(
        browser,
        "return !document.querySelector(\"#{selector}\").checkVisibility()"
      )

  defp stopped(scene) do
    robots = for r <- scene.robots, do: if(r.alive, do: %{r | state: :estop}, else: r)
    held = for %{alive: true, id: id} <- robots, do: id
    stop = %{held: held, of: length(held), since_ms: scene.at_ms - 5_000, by: ["base"]}
    %{scene | robots: robots, estop: stop}
  end

  test "what is wrong with a robot stands in the list, with why where it is chosen" do
    {_live, browser} = shown(FakeLive.of(@fleet), [:arm])

    badges =
      Browser.run(browser, """
      return [...document.querySelectorAll('#robots tr')].map((tr) =>
        [tr.dataset.id, ...[...tr.querySelectorAll('.badge')].map((b) => b.textContent)].join(' '));
      """)

    assert badges == [
             "mag1",
             "mag2 not heard",
             "mag3 disarmed",
             "min1 offline",
             "min2 crashed",
             "min3 not sure",
             "min4 blocked",
             "min5 line lost"
           ]

    for {id, why} <- [
          mag3: "disarmed the line is silent",
          min1: "offline camera, drive",
          min2: "crashed (RuntimeError) boom, lib/gather.ex:42",
          min3: "not sure two places fit",
          min4: "blocked by a wall"
        ] do
      click(browser, "[data-id=#{id}] button")
      assert text(browser, "#badges") == why
    end

    assert Browser.errors(browser) == []
    Browser.close(browser)
  end

  test "what cannot be done now is grey and says why; a stop never is" do
    {live, browser} = shown(FakeLive.of(@fleet), [:arm])
    choose = &click(browser, "[data-id=#{&1}] button")

    choose.(:mag1)
    assert grey(browser, "[data-one=start]") == nil
    assert grey(browser, "[data-one=arm]") == "the wheels of mag1 may turn already"
    assert hidden?(browser, "[data-one=acknowledge]")

    choose.(:mag3)
    assert grey(browser, "[data-one=start]") == "mag3 cannot move: disarmed: arm it first"
    assert grey(browser, "#drive") == "mag3 cannot move: disarmed: arm it first"
    assert grey(browser, "[data-one=arm]") == nil

    choose.(:min5)
    assert grey(browser, "[data-one=arm]") == "acknowledge first that its line was lost"
    refute hidden?(browser, "[data-one=acknowledge]")

    choose.(:min1)
    assert grey(browser, "[data-one=start]") == "min1 cannot move: the drive is offline"

    # Of one that is not heard only a stop is tried.
    choose.(:mag2)
    assert hidden?(browser, "[data-one=start]")
    refute hidden?(browser, "[data-one=stop]")

    # A grey control gives no order, and shows its reason where the keyboard comes to it.
    choose.(:mag3)
    Browser.run(browser, "document.getElementById('line').focus()")
    click(browser, "[data-one=start]")
    assert text(browser, "#answer") =~ "disarmed: arm it first"
    assert FakeLive.told(live) == []

    Browser.press(browser, [:tab])

    Browser.run(browser, """
    document.querySelector("[data-one=start]").focus({ focusVisible: true });
    """)

    Browser.await(browser, "return document.getElementById('why').checkVisibility()")
    assert text(browser, "#why") == "mag3 cannot move: disarmed: arm it first"

    for stop <- ["#estop", "[data-line=stop]", "[data-one=stop]", "[data-one=disarm]"],
        do: assert(grey(browser, stop) == nil)

    assert Browser.errors(browser) == []
    Browser.close(browser)
  end

  test "while an emergency stop holds, a bar says so, with its reset, which asks in its place" do
    {live, browser} = shown(FakeLive.of(@fleet), [:arm], {390, 844})
    assert hidden?(browser, "#stop")
    assert grey(browser, "#start") == nil
    FakeLive.change(live, &stopped/1)
    Browser.await(browser, "return document.getElementById('stop').checkVisibility()")

    assert text(browser, "#held") ==
             "EMERGENCY STOP for 5 s, called by base: 7 of 7 robots held; reset frees them"

    Browser.await(
      browser,
      "return document.querySelectorAll('#robots .badge.stop').length === 7"
    )

    assert grey(browser, "#start") =~ "held by the emergency stop until a reset"
    assert grey(browser, "[data-line=stop]") == nil

    click(browser, "#reset")

    assert text(browser, ".asked") ==
             "Robots may move again when they are started.Reset nowCancel"

    # Cancelled, and asked again.
    Browser.press(browser, [:tab, :enter])
    refute hidden?(browser, "#reset")
    assert FakeLive.told(live) == []
    click(browser, "#reset")
    Browser.press(browser, [:f8, :enter])

    Browser.await(
      browser,
      "return document.querySelector('#answer').textContent === 'reset: accepted'"
    )

    assert FakeLive.told(live) == [:estop, :reset]
    assert Browser.errors(browser) == []
    Browser.close(browser)
  end

  test "controls show what is in force until a person changes them, and again when that was ordered" do
    scene = FakeLive.of(@fleet, mission: "patrol")
    {live, browser} = shown(scene, [:kill, :landmark])
    FakeLive.paced(live, Pace.new(2.0))

    values = fn ->
      Browser.run(
        browser,
        "return ['mission', 'shape', 'spacing', 'speed'].map((id) => document.getElementById(id).value)"
      )
    end

    Browser.await(browser, "return document.getElementById('speed').value === '2'")
    assert values.() == ["patrol", "wedge", "1.2", "2"]

    # What goes on is not started by its name, which would lose its options.
    click(browser, "#start")

    Browser.run(browser, """
    const shape = document.getElementById('shape');
    shape.value = 'circle';
    shape.dispatchEvent(new Event('input', { bubbles: true }));
    """)

    FakeLive.change(live, &%{&1 | mission: "flock", formation: {:line, 0.9}})
    Browser.await(browser, "return document.getElementById('mission').value === 'flock'")
    assert ["flock", "circle", "0.9", "2"] = values.()
    click(browser, "#form")
    Browser.await(browser, "return document.getElementById('shape').value === 'line'")
    assert FakeLive.told(live) == [{:tell, :all, :start}, {:formation, {:circle, 0.9}}]

    # Paused: what was done already is grey.
    assert grey(browser, "[data-line=resume]") == "it is not paused"
    {:ok, paused} = Pace.command(Pace.new(2.0), :pause)
    FakeLive.paced(live, paused)
    Browser.await(browser, "return document.querySelector('[data-line=pause]').ariaDisabled")
    assert grey(browser, "[data-line=resume]") == nil
    Browser.close(browser)
  end
end
