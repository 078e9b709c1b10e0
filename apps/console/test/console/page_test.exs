defmodule Console.PageTest do
  @moduledoc "The page as browsers and strangers see it; with a real browser, where there is one."
  use ExUnit.Case, async: true
  import Console.PageCase
  import Swarm.Case, only: [eventually: 1]
  import Console.Wire, only: [ask: 2, ask: 3]
  alias Console.{Browser, Live, Options, Page}
  alias Console.Page.{Changes, State}
  @moduletag :realtime
  @moduletag :capture_log

  doctest Page.Access
  doctest Changes
  doctest State
  doctest Console.Cli.Condition

  @moduletag skip: no_server()

  describe "requests" do
    setup do
      {options, live} = trial()
      {_page, url} = page(options, Live.Trial, live)
      %{url: url, options: options, live: live}
    end

    test "the files of the page, and nothing else; whatever else is asked is refused in a line",
         %{
           url: url
         } do
      assert {200, head, "<!doctype html>" <> _} = ask(url, "GET /")
      assert head =~ "Content-Security-Policy: default-src 'self'"
      assert {200, _head, _body} = ask(url, "GET /map.js")

      for {request, status} <- [
            {"GET /../mix.exs", 404},
            {"GET /%2e%2e/%2e%2e/mix.exs", 404},
            {"GET /nope", 404},
            {"GET /live", 426},
            {"POST /", 405},
            {"DELETE /live", 405}
          ] do
        assert {^status, _head, line} = ask(url, request)
        assert [_one_line] = String.split(line, "\n", trim: true)
      end
    end

    test "pages and names of others are refused", %{url: url} do
      "http://" <> here = String.trim_trailing(url, "/")
      assert {200, _, _} = ask(url, "GET /", [{"Origin", "http://" <> here}])
      assert {403, _, line} = ask(url, "GET /live", [{"Origin", "http://evil.example"}])
      assert line =~ "evil.example may not use this one"
      assert {403, _, _} = ask(url, "GET /", [{"Host", "rebound.example"}])
      assert {400, _, _} = ask(url, "GET /", [{"Host", nil}])
    end

    test "a token is demanded, and kept in a cookie", %{options: options, live: live} do
      {_page, url} = page(options, Live.Trial, live, token: "a-secret-token")
      assert {401, _, "a token is needed" <> _} = ask(url, "GET /")
      assert {401, _, _} = ask(url, "GET /?token=another-token")
      assert {200, head, _} = ask(url, "GET /?token=a-secret-token")

      assert [_all, name, secret] =
               Regex.run(~r/Set-Cookie: (\w+)=(\S+); HttpOnly; SameSite=Strict; Path=/, head)

      # It is no token, so nothing that is kept in a browser opens another page.
      refute head =~ "a-secret-token"
      assert {426, _, _} = ask(url, "GET /live", [{"Cookie", "#{name}=#{secret}"}])
      assert {401, _, _} = ask(url, "GET /live", [{"Cookie", "#{name}=other"}])
      assert {401, _, _} = ask(url, "GET /live", [{"Cookie", "#{name}=a-secret-token"}])
      assert {401, _, _} = ask(url, "GET /?token=#{secret}")
    end

    test "a port that is taken is said in a line; so is an address without a token", %{
      url: url,
      options: options,
      live: live
    } do
      source = [module: Live.Trial, live: live, robots: options.robots]
      %URI{port: port} = URI.parse(url)
      assert {:error, line} = Page.start_link(source ++ [port: port])
      assert line == "no page on 127.0.0.1:#{port}: address already in use"
      assert {:error, line} = Page.start_link(source ++ [address: {0, 0, 0, 0}])
      assert line =~ "it needs a token"
      assert {:error, [line]} = Options.parse(~w(--page-address 0.0.0.0))
      assert line =~ "--page-token-file"
    end
  end

  test "it is told the corners of boxes, and none of round bodies" do
    {:ok, trial} = Lab.Trial.new(%{robots: [:mag1, :burger1], seed: 1})
    json = trial |> Lab.Trial.scene() |> Page.State.scene(nil, nil, 0)
    assert json =~ ~s("box":[],)
    assert json =~ ~s("box":[[0.037)
  end

  describe "in a browser" do
    @describetag skip: why_not()

    defp fleet(browser),
      do: Browser.run(browser, "return document.getElementById('fleet').textContent")

    test "it shows the fleet without an error; the landmark is dragged; a killed leader is followed by another" do
      {options, live} = trial()
      {_page, url} = page(options, Live.Trial, live)
      browser = open(url)
      Browser.await(browser, "return document.querySelectorAll('#robots tr').length === 3")

      Browser.await(
        browser,
        "return document.getElementById('fleet').textContent.includes('formed')"
      )

      # Of all of the floor, so that the landmark's new place is in sight.
      Browser.run(browser, "document.querySelector('[data-fit=all]').click()")
      Browser.await(browser, "return floor.view.at !== null")
      {x, y} = Live.Trial.scene(live).landmark

      Browser.drag(browser, [
        pixel(browser, {x, y}),
        pixel(browser, {x + 0.5, y}),
        pixel(browser, {x + 2.0, y + 1.0})
      ])

      Browser.await(
        browser,
        "return document.getElementById('answer').textContent.startsWith('landmark ')"
      )

      Browser.await(
        browser,
        "return Math.hypot(window.floor.scene.landmark[0] - #{x + 2.0}, window.floor.scene.landmark[1] - #{y + 1.0}) < 0.1"
      )

      leader = Live.Trial.scene(live).leader
      Browser.run(browser, "document.querySelector('[data-line=\"kill leader\"]').click()")

      Browser.await(
        browser,
        "return document.querySelector('tr.dead')?.dataset.id === '#{leader}'"
      )

      Browser.await(
        browser,
        "const s = window.floor.scene; return s.leader && s.leader !== '#{leader}' && s.formed"
      )

      # Which election that was is said below, where one who asks for it looks.
      refute fleet(browser) =~ "epoch"

      assert Browser.run(browser, "return document.getElementById('leads').textContent") =~
               "epoch"

      # What is typed is answered, good or bad.
      type =
        "const l = document.getElementById('line'); l.value = arguments0; l.form.requestSubmit();"

      Browser.run(browser, String.replace(type, "arguments0", "'formatoin wedge'"))

      Browser.await(
        browser,
        "return document.getElementById('answer').textContent.includes('did you mean formation?')"
      )

      assert Browser.errors(browser) == []
      Browser.close(browser)
    end

    test "robots and balls are dragged in the simulation; where there is no room, they stay, and a line says so" do
      world = Path.expand("../../../../examples/stage/yard.world", __DIR__)
      {options, live} = trial(["--world", world | ~w(--mission teleop --blobs direct)])
      {_page, url} = page(options, Live.Trial, live)
      browser = open(url)
      Browser.await(browser, "return document.querySelectorAll('#robots tr').length === 4")
      Browser.run(browser, "document.querySelector('[data-fit=all]').click()")
      Browser.await(browser, "return floor.view.at !== null && floor.scene.objects.length === 2")

      drag = fn from, {x, y} ->
        places = [from, {x - 0.5, y}, {x, y}]
        Browser.drag(browser, Enum.map(places, &pixel(browser, &1)))
      end

      robot = "floor.scene.robots.find((r) => r.id === 'r1')"
      drag.({-4.0, 0.0}, {-1.0, -2.5})
      Browser.await(browser, "return Math.hypot(#{robot}.x + 1, #{robot}.y + 2.5) < 0.1")
      drag.({-4.5, -2.5}, {-3.5, -3.0})
      ball = "floor.scene.objects[0].at"
      Browser.await(browser, "return Math.hypot(#{ball}[0] + 3.5, #{ball}[1] + 3) < 0.1")

      # Onto the landmark.
      drag.({-1.0, -2.5}, {0.5, 0.0})

      Browser.await(
        browser,
        "return document.getElementById('answer').textContent.includes('there is no room')"
      )

      assert Browser.run(browser, "return Math.hypot(#{robot}.x + 1, #{robot}.y + 2.5) < 0.1")
      # A click chooses it, as before.
      {x, y} = pixel(browser, {-1.0, -2.5})
      Browser.drag(browser, [{x, y}, {x, y}])
      Browser.await(browser, "return window.floor.chosen === 'r1'")
      assert Browser.errors(browser) == []
      Browser.close(browser)
    end

    test "of the chosen robot it shows all who wished, its way and what it did; and who leads" do
      for {line, module, start} <- [
            {"--robots 3 --seed 4 --blobs direct", Live.Trial, &slow/1},
            {"--robots 3 --seed 4", Live.Fleet, &Live.Fleet.start_link(Options.trial(&1))}
          ] do
        options = options(line)
        {:ok, live} = start.(options)
        {_page, url} = page(options, module, live)
        browser = open(url)

        Browser.await(
          browser,
          "return / leads epoch 1; \\w+, \\w+ follow\\./.test(document.getElementById('leads').textContent)"
        )

        following = fn -> Enum.find(module.scene(live).robots, &(&1.state == :follow)) end
        eventually(following)
        follower = following.()
        choose = "document.querySelector('[data-id=#{follower.id}] button').click()"
        Browser.run(browser, choose)
        # A follower on its way: it would also rest, if it had nothing to do.
        Browser.await(
          browser,
          "return /wishesfollow \\d\\.\\d\\d, rest \\d\\.\\d\\dway\\d/.test(document.getElementById('about').textContent)"
        )

        Browser.await(browser, "return window.floor.about.way.length > 0")

        Browser.await(
          browser,
          "return /cameralooks at -?\\d+, -?\\d+ deg \\(zoom \\d+ deg\\), sees /.test(document.getElementById('about').textContent)"
        )

        Browser.await(
          browser,
          "return /\\d s  agree.*\\d s  follow/.test(document.getElementById('events').textContent)"
        )

        assert Browser.errors(browser) == []
        Browser.close(browser)
        module.stop(live)
      end
    end

    # In lockstep, in real time.
    defp slow(options),
      do: Live.Trial.start_link(Lab.Trial, Options.trial(options), Console.Pace.new(1.0))

    test "while it is seen it says that a person is there" do
      options = options("--robots 1 --landmark none")
      {:ok, live} = Live.Fleet.start_link(Options.trial(options))
      {_page, url} = page(options, Live.Fleet, live)
      browser = open(url)
      Browser.await(browser, "return document.querySelectorAll('#robots tr').length === 1")

      Browser.run(browser, """
      const send = WebSocket.prototype.send;
      window.said = [];
      WebSocket.prototype.send = function (line) { window.said.push(line); send.call(this, line); };
      """)

      Browser.await(
        browser,
        "return window.said.filter((line) => /^@-?\\d+ present$/.test(line)).length >= 3"
      )

      refute Browser.run(browser, "return document.getElementById('answer').textContent") =~
               "present"

      assert Browser.errors(browser) == []
      Browser.close(browser)
      Live.Fleet.stop(live)
    end

    test "by keyboard alone one comes to everything in order, and can do all of it" do
      options = options("--robots 2 --landmark none")
      {:ok, live} = Live.Fleet.start_link(Options.trial(options))
      {_page, url} = page(options, Live.Fleet, live)
      browser = open(url)
      Browser.await(browser, "return document.querySelectorAll('#robots tr').length === 2")

      Browser.await(browser, "return !document.getElementById('time').hidden")

      # From the top of the page to its end; each that has the focus shows it.
      order =
        for _stop <- 1..25 do
          Browser.press(browser, [:tab])

          Browser.run(browser, """
          const e = document.activeElement, ring = getComputedStyle(e).outlineStyle;
          return (ring === 'solid' ? '' : 'no ring: ') + (e.id || e.dataset.zoom || e.dataset.fit || e.dataset.line || e.textContent);
          """)
        end

      assert order ==
               ~w(estop mission start stop shape spacing form) ++
                 ["kill leader"] ++
                 ~w(map 1.3 0.77 fleet all follow trails Legend) ++
                 ~w(time-previous time-back time-forward time-next strip line Send mag1 tab-robot)

      answered = fn text ->
        Browser.await(
          browser,
          "return document.getElementById('answer').textContent.startsWith('#{text}')"
        )
      end

      # Chosen, then sent to where the cross is.
      to = fn selector ->
        Browser.run(browser, "document.activeElement.blur()")

        Enum.find(1..60, fn _press ->
          Browser.press(browser, [:tab])
          Browser.run(browser, "return document.activeElement.matches(\"#{selector}\")")
        end) || flunk("no way to #{selector}")
      end

      # Tab comes to the list, the arrows go through it.
      to.("#robots button")
      Browser.press(browser, [:down, :enter])
      Browser.await(browser, "return document.getElementById('chosen').textContent === 'min1'")
      to.("#map")
      Browser.press(browser, [:left, :down, :enter])
      answered.("goto min1 -")
      eventually(fn -> Swarm.status(:min1).state == :goto end)

      to.("[data-one=stop]")
      Browser.press(browser, [" "])
      answered.("stop min1: accepted")
      eventually(fn -> Swarm.status(:min1).state != :goto end)
      to.("#mission")
      Browser.press(browser, ["p"])
      to.("#start")
      Browser.press(browser, [:enter])
      answered.("start patrol: accepted")
      eventually(fn -> Swarm.status(:mag1).state in [:watch, :visit] end)
      to.("[data-line=stop]")
      Browser.press(browser, [:enter])
      answered.("stop: accepted")

      to.("#drive")
      Browser.press(browser, [:enter])
      Browser.key(browser, :keyDown, "w")
      eventually(fn -> repeat(browser) && Swarm.status(:min1).by == :move end)

      # Wherever the focus is, also where text is typed.
      to.("#line")
      Browser.press(browser, [:f8])
      eventually(fn -> Swarm.status(:min1).estop and Swarm.status(:mag1).estop end)
      Browser.await(browser, "return document.getElementById('drive').ariaPressed === 'false'")
      Browser.key(browser, :keyUp, "w")
      # What asks first does so in its place, and the emergency stop works meanwhile.
      to.("#reset")
      Browser.press(browser, [:enter])
      # The answer to the stop before stands there still.
      Browser.run(browser, "document.getElementById('answer').textContent = ''")
      Browser.press(browser, [:f8])
      answered.("estop: accepted")
      Browser.press(browser, [:enter])
      answered.("reset: accepted")
      to.("#line")
      Browser.press(browser, String.graphemes("status mag1") ++ [:enter])
      answered.("mag1")
      assert Browser.errors(browser) == []
      Browser.close(browser)
      Live.Fleet.stop(live)
    end
  end
end
