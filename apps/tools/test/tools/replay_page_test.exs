defmodule Tools.ReplayPageTest do
  @moduledoc "A recording on the page, in a real browser."
  use ExUnit.Case, async: true
  alias Console.{Browser, Demo, Page, Runs}
  alias Tools.Replay
  @moduletag :realtime
  @moduletag :tmp_dir
  @moduletag skip: Browser.why_not()

  defp record(folder, name, line) do
    path = Path.join(folder, name)
    options = Runs.options("--headless --robots 3 --blobs direct " <> line, ["--record", path])
    {_status, _text} = ExUnit.CaptureIO.with_io(fn -> Demo.run(options, Lab.Trial) end)
    {:ok, recording} = Replay.Recording.open(path)
    recording
  end

  test "a recording is played, stopped and searched; two are shown side by side", %{
    tmp_dir: folder
  } do
    one = record(folder, "one.mcap", "--kill leader@15 --duration 20")
    other = record(folder, "other.mcap", "--seed 2 --duration 18")

    live =
      :proc_lib.spawn_link(fn ->
        Replay.Live.loop(Replay.Live.new([one, other], 0, {0, "they begin differently"}))
      end)

    robots = for robot <- one.file.setup.robots, do: robot.id
    {:ok, _page, url} = Page.start_link(module: Replay.Live, live: live, robots: robots)
    browser = Browser.open({1280, 800})
    Browser.go(browser, url)
    Browser.await(browser, "return timeline.run?.known_s === 20")

    # Nothing in it can be told anything.
    assert Browser.run(
             browser,
             "return ['estop', 'orders'].every((id) => getComputedStyle(document.getElementById(id)).display === 'none')"
           )

    # To the kill by its buttons, and the reasons of the robot that died, from before it did.
    Browser.run(browser, "timeline.seek(14)")
    Browser.await(browser, "return floor.scene?.at_s === 14")
    leader = Browser.run(browser, "return floor.scene.leader")

    Browser.run(browser, "document.querySelector('tr[data-id=#{leader}] button').click()")

    Browser.await(
      browser,
      "return document.getElementById('reasons').textContent.startsWith('#{leader} at 13.9 s')"
    )

    Browser.run(browser, "document.getElementById('time-next').click()")

    Browser.await(
      browser,
      "return floor.scene.robots.find((r) => r.id === '#{leader}').alive === false"
    )

    # Both at one time, by their names.
    assert Browser.run(browser, "return floor.scene.beside.at_s === floor.scene.at_s")

    assert ["one.mcap", "other.mcap"] ==
             Browser.run(
               browser,
               "return [...document.querySelectorAll('.run')].map((p) => p.textContent)"
             )

    # What the robots said until then.
    Browser.run(browser, "document.getElementById('tab-messages').click()")
    Browser.await(browser, "return document.querySelectorAll('#said tr').length > 0")

    assert Browser.run(browser, "return document.getElementById('said').innerText") =~
             ", 3 robots: "

    # It plays to its end, and stands there.
    Browser.run(
      browser,
      "const s = document.getElementById('time-speed'); s.value = '8'; s.onchange(); document.getElementById('time-play').click()"
    )

    Browser.await(browser, "return floor.scene.at_s === 20 && floor.scene.paused")

    Browser.await(
      browser,
      "return document.getElementById('at').textContent === '20.0 s of 20.0 s'"
    )

    assert [] == Browser.errors(browser)
    Browser.close(browser)
    Replay.Live.close(live)
  end
end
