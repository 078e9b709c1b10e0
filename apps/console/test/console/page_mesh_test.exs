defmodule Console.PageMeshTest do
  @moduledoc """
  The page of robots that somebody else has started, reached by `Swarm` alone. What it commands, all robots of this VM
  obey: no other test runs meanwhile.
  """
  use ExUnit.Case, async: false
  alias Console.Cli.Format
  alias Console.{Browser, Live, Page}
  alias Console.Live.Mesh.{Frames, Notice, View}
  alias Swarm.Status
  @moduletag :capture_log

  doctest Frames
  doctest Notice
  doctest View

  test "a robot is shown from when it is heard, keeps its place in the list, and what changes is told" do
    at = fn view, second, statuses ->
      View.update(view, statuses, "14:00:0#{second}", second * 1_000)
    end

    mag2 = %Status{robot: :mag2, state: :follow, leader: :mag1}
    view = View.new() |> at.(0, [mag2])
    mag1 = %Status{robot: :mag1, state: "lead", leader: :mag1, estop: true, estop_by: ["base"]}
    view = view |> at.(1, [mag1, mag2]) |> at.(2, [mag1, mag2])

    scene = View.scene(view, 2_500)
    assert [%{id: :mag2}, %{id: :mag1, state: :estop, leader?: true}] = scene.robots

    assert Format.estop(scene) ==
             "EMERGENCY STOP for 1 s, called by base: 1 of 2 robots held (not mag2); reset frees them"

    assert View.scene(view, 0).leader == :mag1

    view =
      at.(view, 3, [
        %{mag1 | estop: false, arming: :disarmed},
        %Status{robot: :mag2, state: :no_answer}
      ])

    assert Format.estop(View.scene(view, 3_000)) == nil

    assert Enum.map(view.stages, &{&1.clock, &1.line}) == [
             {"14:00:00", "mag2 is heard"},
             {"14:00:00", "mag2: follow, leader mag1"},
             {"14:00:01", "mag1 is heard"},
             {"14:00:01", "mag1: lead"},
             {"14:00:01", "mag1 is held by the emergency stop"},
             {"14:00:03", "mag1 is released from the emergency stop"},
             {"14:00:03", "mag1: DISARMED"},
             {"14:00:03", "mag2: does not answer"}
           ]

    # Old lines are forgotten, and are not told again.
    full = Enum.reduce(1..300, view, &at.(&2, 4, [%{mag1 | fault: "fault #{&1}"}, mag2]))
    assert length(full.stages) == 200
    assert List.last(full.stages).n == full.told
  end

  test "the mission of most and the shape of the leader are in force, as far as robots tell" do
    status = &struct!(%Status{robot: &1, state: :follow}, &2)
    lead = status.(:mag1, state: :lead, mission: "landmark", formation: {:wedge, 1.2})
    others = [status.(:mag2, mission: "landmark"), status.(:min1, mission: "patrol")]
    scene = fn view -> view |> View.scene(0) |> Map.take([:mission, :formation]) end
    view = View.update(View.new(), [lead | others], "14:00:00", 0)
    assert scene.(view) == %{mission: "landmark", formation: {:wedge, 1.2}}

    # Who has gone leads in no shape, and does nothing.
    view = View.update(view, tl(others), "14:00:01", 1_000)
    assert scene.(view) == %{mission: "patrol", formation: nil}
    assert scene.(View.new()) == %{mission: nil, formation: nil}
  end

  test "only robots of one frame have the same number" do
    status = fn id, within, own, x ->
      frame = %Status.Frame{within: within, own: own, start: {x, 0.0}}
      %Status{robot: id, state: :follow, frame: frame}
    end

    # mag1 led mag2, and has gone; mag3 leads now: mag2 is still in the frame of mag1, which mag3 was in, too.
    old = {:mag1, 7}
    mag1 = %{status.(:mag1, :start, 7, 0.0) | state: :not_heard}
    mag2 = status.(:mag2, old, 8, 0.0)
    mag3 = %{status.(:mag3, old, 9, 0.0) | state: "lead"}
    min1 = status.(:min1, {:mag3, 9}, 3, 0.0)
    # That of a former life of mag3 is another frame.
    min2 = status.(:min2, {:mag3, 4}, 3, 0.0)
    lost = %{status.(:min3, :start, 1, 9.0) | frame: :lost}
    old = %{lost | robot: :min4, frame: nil}
    far = status.(:min5, :start, 2, 20.0)
    near = status.(:min6, :start, 2, 25.0)

    places = Frames.places([lost, far, mag1, mag2, min1, old, mag3, min2, near])
    assert for({id, {0, nil}} <- places, do: id) |> Enum.sort() == [:mag1, :mag2, :mag3, :min1]
    assert {1, "it has met none of the others"} = places.min5
    assert places.min6 == places.min5
    assert {_own, "it was started again on its way, and is lost"} = places.min3
    assert {_own, "it does not say in which frame it is"} = places.min4
    assert {_own, "it follows mag3"} = places.min2
    assert places |> Map.values() |> Enum.uniq() |> length() == 5
  end

  test "other secrets are told of while they are heard, and only where no robot is" do
    seen = %{robots: 0, nodes: [], unsigned: 1, fault: nil}
    notice = Notice.look(Notice.new("mag1@convoy"), seen, 0)
    assert notice.line =~ "another secret"
    assert Notice.look(notice, seen, 20_000).line =~ "mag1@convoy is not heard, nor"
    heard = %{seen | robots: 1, nodes: ["mag2@convoy"], unsigned: 2}

    assert Notice.look(notice, heard, 0).line ==
             "mag1@convoy is not heard; it is shown as soon as it is"

    assert Notice.look(notice, %{heard | nodes: ["mag1@convoy"]}, 0).line == nil

    assert Notice.look(notice, %{heard | fault: "wlan0 is gone"}, 0).line ==
             "no network: wlan0 is gone"
  end

  describe "in a browser" do
    @describetag :realtime
    @describetag skip:
                   (case Application.ensure_all_started(:mochiweb) do
                      {:ok, _apps} -> Browser.why_not()
                      _absent -> "erlang-mochiweb is not installed"
                    end)

    test "robots come by themselves; armed, driven, stopped there; nothing of a simulation is offered" do
      # Those of the tests before are heard for a while.
      until(fn -> Swarm.status() == [] end)
      {:ok, live} = Live.Mesh.start_link()
      robots = fn -> Live.Mesh.robots(live) end
      {:ok, _page, url} = Page.start_link(module: Live.Mesh, live: live, robots: robots)
      browser = Browser.open({1280, 800})
      Browser.go(browser, url)
      Browser.await(browser, "return window.floor.scene?.robots.length === 0")
      assert text(browser, "fleet") =~ "no robot is heard"

      {:ok, fleet} = Lab.Fleet.start_link(robots: [:mag41, :min41], mission: false)
      Browser.await(browser, "return document.querySelectorAll('#robots tr').length === 2")
      Browser.await(browser, "return window.floor.scene.robots.every((r) => r.x !== null)")
      Browser.await(browser, "return document.getElementById('fleet').className === ''")
      assert shown(browser, "[data-line='kill leader'], [data-one='kill'], #pace") == 0
      assert shown(browser, "[data-line='disarm all']") == 1

      Browser.run(browser, "document.querySelector('#robots button').click()")

      Browser.await(
        browser,
        "return document.getElementById('about').textContent.includes('m/s')"
      )

      Browser.run(browser, "document.querySelector('[data-one=disarm]').click()")
      Browser.await(browser, "return window.floor.scene.robots[0].state === 'disarmed'")
      assert {:error, _disarmed} = Swarm.tell(:mag41, "move:0.2:0")

      # It asks in its place.
      Browser.run(browser, "document.querySelector('[data-one=arm]').click()")
      assert Browser.run(browser, "return document.querySelector('.asked').textContent") =~ "turn"
      Browser.run(browser, "document.querySelector('.asked button').click()")

      Browser.await(browser, "return window.floor.scene.robots[0].state === 'idle'")

      Browser.run(browser, "document.getElementById('drive').click()")
      Browser.key(browser, :keyDown, "w")
      Browser.await(browser, "return window.floor.scene.robots[0].state === 'move'")
      Browser.key(browser, :keyUp, "w")
      Browser.await(browser, "return window.floor.scene.robots[0].state === 'done'")

      Browser.run(browser, "document.getElementById('estop').click()")

      Browser.await(
        browser,
        "return window.floor.scene.robots.every((r) => r.state === 'E-STOP')"
      )

      # A second person sees it, too, and why all stand.
      Browser.await(
        browser,
        "return /EMERGENCY STOP for \\d+ s, called (by .+|here): 2 of 2 robots held;/.test(document.getElementById('held').innerText)"
      )

      assert Swarm.status(:min41).estop
      Browser.run(browser, "document.getElementById('reset').click()")
      assert Swarm.status(:min41).estop
      Browser.run(browser, "document.querySelector('.asked button').click()")

      Browser.await(
        browser,
        "return window.floor.scene.robots.every((r) => r.state !== 'E-STOP')"
      )

      Lab.Fleet.stop(fleet)
      Browser.await(browser, "return document.querySelectorAll('tr.dead').length === 2")
      assert text(browser, "robots") =~ "not heard"
      assert text(browser, "stages") =~ "mag41 is no longer heard"
      assert Browser.errors(browser) == []
      Browser.close(browser)
    end

    test "robots whose places to each other are not known are not drawn together" do
      until(fn -> Swarm.status() == [] end)
      {:ok, live} = Live.Mesh.start_link()
      robots = fn -> Live.Mesh.robots(live) end
      {:ok, _page, url} = Page.start_link(module: Live.Mesh, live: live, robots: robots)
      {:ok, fleet} = Lab.Fleet.start_link(robots: [:mag42, :min42], start: :same, mission: false)
      browser = Browser.open({1280, 800})
      Browser.go(browser, url)

      Browser.await(
        browser,
        "return window.floor.scene?.robots.filter((r) => r.x !== null).length === 2"
      )

      here = fn id ->
        Browser.await(browser, "return window.floor.here().map((r) => r.id).join() === '#{id}'")
      end

      here.("mag42")
      assert text(browser, "apart") =~ "min42"
      Browser.run(browser, "document.querySelector('[data-id=min42] button').click()")
      here.("min42")
      assert text(browser, "doing") =~ "it was started again on its way, and is lost"
      assert Browser.errors(browser) == []
      Browser.close(browser)
      Lab.Fleet.stop(fleet)
    end

    test "the mission in force is shown, and what it draws, which only a robot that is looked at is asked for" do
      until(fn -> Swarm.status() == [] end)
      {:ok, live} = Live.Mesh.start_link()
      robots = fn -> Live.Mesh.robots(live) end
      {:ok, _page, url} = Page.start_link(module: Live.Mesh, live: live, robots: robots)

      patrol = [
        robots: [:mag43, :min43],
        landmark: :none,
        mission: {Missions.Patrol, loop: :line}
      ]

      {:ok, fleet} = Lab.Fleet.start_link(patrol)
      browser = Browser.open({1280, 800})
      Browser.go(browser, url)

      Browser.await(browser, "return document.getElementById('mission').value === 'patrol'")
      assert text(browser, "fleet") =~ "patrol"
      shape = "const shape = document.getElementById('shape'); return "
      assert Browser.run(browser, shape <> "shape.selectedOptions[0].text") == "not known"
      assert Browser.run(browser, "return document.getElementById('spacing').value") == ""
      # Nothing can be formed by that.
      Browser.run(browser, "document.getElementById('form').click()")
      assert text(browser, "answer") == "choose a shape first"

      assert :sys.get_state(live).layers == %{}
      Browser.run(browser, "document.querySelector('[data-id=min43] button').click()")

      Browser.await(
        browser,
        "const points = window.floor.about?.layer[0]?.points; return points?.length === 5 && /^1: /.test(points[0][2])"
      )

      assert Map.keys(:sys.get_state(live).layers) == [:min43]
      # The line is along x, where no robot is.
      Browser.await(browser, "return window.floor.floor[0] <= -4 && window.floor.floor[1] <= -2")
      Browser.run(browser, "document.querySelector('[data-fit=all]').click()")
      Browser.await(browser, "return window.floor.view.holds([-2, 0])")
      # A shape that is chosen can be ordered, and is refused by those that have none.
      Browser.run(browser, """
      const shape = document.getElementById('shape');
      shape.value = 'line';
      shape.dispatchEvent(new Event('input'));
      """)

      Browser.await(browser, "return document.getElementById('form').ariaDisabled === null")
      Browser.run(browser, "document.getElementById('form').click()")

      Browser.await(
        browser,
        "return /no robot is on a mission that has a formation/.test(document.getElementById('answer').textContent)"
      )

      Browser.await(browser, shape <> "shape.value === ''")
      assert Browser.errors(browser) == []
      Browser.close(browser)
      Lab.Fleet.stop(fleet)
    end

    defp until(true?, left \\ 100) do
      cond do
        true?.() -> :ok
        left == 0 -> flunk("in vain")
        true -> receive(do: (:never -> :ok), after: (50 -> until(true?, left - 1)))
      end
    end

    defp text(browser, id),
      do: Browser.run(browser, "return document.getElementById('#{id}').textContent")

    defp shown(browser, selector) do
      Browser.run(
        browser,
        "return [...document.querySelectorAll(\"#{selector}\")].filter((e) => e.checkVisibility()).length"
      )
    end
  end
end
