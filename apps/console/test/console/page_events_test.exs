defmodule Console.PageEventsTest do
  @moduledoc "The page's lists of what happened and of what was ordered, in a real browser."
  use ExUnit.Case, async: false
  import Console.PageCase
  alias Console.{Browser, FakeLive}
  @moduletag :realtime
  @moduletag :capture_log
  @moduletag skip: why_not()

  setup do
    scene = FakeLive.of([{:mag1, {0.0, 0.0}, []}, {:min1, {2.0, 0.0}, []}])
    {live, browser} = shown(scene, [:kill])
    %{browser: browser, live: live}
  end

  defp rows(browser, body) do
    Browser.run(browser, """
    return [...document.querySelectorAll('##{body} tr')].map((tr) => [...tr.cells].map((td) => td.innerText.replaceAll('\\n', ' / ')));
    """)
  end

  test "repeats stand in one row with their count, and with what ended them", %{browser: browser} do
    assert Browser.run(browser, """
           return import("/events.js").then(({ fold }) => {
             const rows = (...events) => events.map(([time, what, text, robot, ends]) => ({ time, what, text, robot, ends }))
               .reduce(fold, []).map((r) => [r.time, r.last, r.text, r.count, r.ended?.text ?? null].join());
             return [
               rows(["1", "blocked", "by a wall", "mag1"], ["2", "state", "goto", "mag1"], ["3", "blocked", "by a wall", "mag1"]),
               // Of another robot, or by another thing, it is not the same.
               rows(["1", "blocked", "by a wall", "mag1"], ["2", "blocked", "by a wall", "min1"], ["3", "blocked", "by mag2", "mag1"]),
               // What ends it ends the newest of its robot, once.
               rows(["1", "blocked", "by a wall", "mag1"], ["2", "blocked", "its way is free", "mag1", "blocked"],
                 ["3", "blocked", "its way is free", "mag1", "blocked"]),
               rows(["1", "blocked", "by a wall", "mag1"], ["2", "blocked", "its way is free", "mag1", "blocked"],
                 ["3", "blocked", "by a wall", "mag1"]),
             ];
           });
           """) == [
             ["2,2,goto,1,", "1,3,by a wall,2,"],
             ["1,1,by a wall,1,", "2,2,by a wall,1,", "3,3,by mag2,1,"],
             ["1,1,by a wall,1,its way is free", "3,3,its way is free,1,"],
             ["1,3,by a wall,2,"]
           ]

    Browser.close(browser)
  end

  test "messages stand in rows, up to the time that is shown, all or those of the chosen robot; without them there is the reason",
       %{browser: browser, live: live} do
    say = fn n, at_s, from, to, text ->
      row = %{n: n, at_s: at_s, last_s: at_s, count: 1}
      Map.merge(row, %{from: from, to: to, kind: :round, text: text})
    end

    again = %{say.(1, 1.0, :mag1, :all, "begins") | last_s: 1.5, count: 2}
    FakeLive.say(live, {:ok, [again]})
    Browser.run(browser, "document.getElementById('tab-messages').click()")
    Browser.await(browser, "return document.querySelectorAll('#said tr').length === 1")
    assert rows(browser, "said") == [["1.0 s", "mag1 → all", "begins / 2 times, until 1.5 s"]]

    FakeLive.say(
      live,
      {:ok,
       [
         say.(1, 1.0, :mag1, :all, "begins"),
         say.(2, 2.0, :min1, [:mag2], "its report"),
         # The scene is of 12 s.
         say.(3, 12.5, :mag1, :all, "of later")
       ]}
    )

    Browser.await(browser, "return document.querySelectorAll('#said tr').length === 2")
    assert [_all, ["2.0 s", "min1 → mag2", "its report"]] = rows(browser, "said")

    # Choosing shows what is known of the robot; back here there are its own.
    Browser.run(browser, "document.querySelector('[data-id=mag1] button').click()")
    Browser.run(browser, "document.getElementById('tab-messages').click()")
    Browser.await(browser, "return document.querySelectorAll('#said tr').length === 1")
    assert rows(browser, "said") == [["1.0 s", "mag1 → all", "begins"]]
    note = "return document.getElementById('said-note').textContent"
    assert Browser.run(browser, note) =~ "from and to mag1"
    FakeLive.change(live, &%{&1 | at_ms: 13_000})
    Browser.await(browser, "return document.querySelectorAll('#said tr').length === 2")

    FakeLive.say(live, {:error, "they are elsewhere"})
    Browser.await(browser, "return document.querySelectorAll('#said tr').length === 0")
    assert Browser.run(browser, note) == "Not known here: they are elsewhere."
    assert Browser.errors(browser) == []
    Browser.close(browser)
  end

  # What a person fills in, and sends by the button.
  defp send_message(browser, fields) do
    for {selector, value} <- fields do
      Browser.run(browser, """
      const e = document.querySelector("#{selector}");
      e.value = #{inspect(value)};
      e.dispatchEvent(new Event("change"));
      """)
    end

    click(browser, "#write button")
  end

  defp written(browser),
    do: Browser.run(browser, "return document.getElementById('write-answer').innerText")

  test "a person writes a message by the fields of its table, to a robot or to all, and reads the answer",
       %{
         browser: browser,
         live: live
       } do
    FakeLive.change(live, &%{&1 | mission: "flock"})
    click(browser, "#tab-messages")
    Browser.await(browser, "return document.querySelectorAll('#write-fields input').length === 1")

    assert Browser.run(browser, "return document.querySelector('#write-fields').innerText") ==
             "leg"

    field = "return document.querySelector('#write-fields input').placeholder"
    assert Browser.run(browser, field) == "a whole number from 1 to 65"
    options = "return [...document.querySelectorAll('#write-to option')].map((o) => o.value)"
    assert Browser.run(browser, options) == ["all", "mag1", "min1"]

    send_message(browser, [{"#write-to", "min1"}, {"#write-fields input", " 3 "}])
    Browser.await(browser, "return document.getElementById('write-answer').innerText !== ''")
    assert written(browser) == "send min1 leg:leg=3: accepted"
    assert FakeLive.told(live) == [{:tell, [:min1], {:send, "leg:leg=3"}}]

    send_message(browser, [{"#write-to", "all"}, {"#write-fields input", ""}])

    Browser.await(
      browser,
      "return document.getElementById('write-answer').innerText.includes('all')"
    )

    assert List.last(FakeLive.told(live)) == {:tell, :all, {:send, "leg"}}

    # In the list of orders, as all others.
    assert [["send all leg" | _], ["send min1 leg:leg=3" | _]] =
             for([_time | row] <- Enum.sort(rows(browser, "given")), do: row) |> Enum.sort()

    # What the robots refuse stands there in one line; what is typed stays.
    FakeLive.refuse(
      live,
      "min1: message leg option leg: expected a whole number from 1 to 65, got 99"
    )

    send_message(browser, [{"#write-fields input", "99"}])
    Browser.await(browser, "return document.getElementById('write-answer').className === 'bad'")
    assert written(browser) =~ "min1: message leg option leg: expected a whole number"

    assert Browser.run(browser, "return document.querySelector('#write-fields input').value") ==
             "99"

    # Of one that is chosen it is written to first; a mission without such messages says so.
    click(browser, "[data-id=mag1] button")
    Browser.await(browser, "return document.getElementById('write-to').value === 'mag1'")
    FakeLive.change(live, &%{&1 | mission: "patrol"})
    click(browser, "#tab-messages")
    Browser.await(browser, "return !document.querySelector('#write button').checkVisibility()")
    note = Browser.run(browser, "return document.getElementById('write-note').textContent")
    assert note == "patrol hears no messages of people; these do: flock."
    assert Browser.errors(browser) == []
    Browser.close(browser)
  end

  test "a row says when, what and in words; a click chooses the robot, and the moment where there is a time line",
       %{
         browser: browser,
         live: live
       } do
    stages = [
      %{stage: :elected, at_s: 3.25, robot: :min1, epoch: 1, size_ppm: nil},
      %{stage: :estop_holds, at_s: 5.0, by: ["base"]},
      %{stage: :estop_over, at_s: 9.0}
    ]

    FakeLive.change(live, &%{&1 | stages: stages})
    Browser.run(browser, "document.getElementById('tab-events').click()")
    Browser.await(browser, "return document.querySelectorAll('#stages tr').length === 2")

    assert rows(browser, "stages") == [
             ["3.3 s", "elected", "min1 leads (epoch 1)"],
             [
               "5.0 s",
               "emergency stop",
               "emergency stop, called by base: held until a reset / until 9.0 s: no robot is held any more; they stand until a start"
             ]
           ]

    Browser.run(browser, """
    window.timeline.seek = (at_s) => (window.sought = at_s);
    document.querySelector('#stages button').click();
    """)

    Browser.await(browser, "return document.getElementById('chosen').textContent === 'min1'")
    assert Browser.run(browser, "return window.sought") == 3.25
    assert Browser.errors(browser) == []
    Browser.close(browser)
  end

  test "orders stand with their answers; a refusal stays over the map until it is closed", %{
    browser: browser
  } do
    type = fn line ->
      Browser.run(browser, """
      const l = document.getElementById('line'); l.value = '#{line}'; l.form.requestSubmit();
      """)
    end

    type.("kill mag1")

    Browser.await(
      browser,
      "return document.getElementById('answer').textContent === 'kill mag1: accepted'"
    )

    type.("formatoin wedge")
    Browser.await(browser, "return document.getElementById('answer').className === 'bad'")
    Browser.run(browser, "document.getElementById('tab-orders').click()")

    assert [[_time, "kill mag1", "kill mag1: accepted"], [_when, "formatoin wedge", refusal]] =
             rows(browser, "given")

    assert refusal =~ "did you mean formation?"

    shown? = fn ->
      Browser.run(
        browser,
        "return getComputedStyle(document.getElementById('toast')).visibility === 'visible'"
      )
    end

    assert shown?.()
    Browser.run(browser, "document.getElementById('close').click()")
    refute shown?.()
    assert Browser.errors(browser) == []
    Browser.close(browser)
  end
end
