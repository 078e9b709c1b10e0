defmodule Console.PageDoorTest do
  @moduledoc "Connections that say nothing, or the wrong thing, keep nobody out."
  use ExUnit.Case, async: false
  import ExUnit.CaptureLog
  import Console.Wire
  alias Console.{Browser, Live, Options, Page}
  alias Console.Page.{Connections, Guesses}
  @moduletag :realtime
  @moduletag timeout: 180_000

  doctest Guesses

  @server (case Application.ensure_all_started(:mochiweb) do
             {:ok, _apps} -> nil
             _absent -> "erlang-mochiweb is not installed"
           end)

  describe "who stays" do
    # So many of an address in a state, since these times; processes are named by numbers.
    defp all(connections \\ %Connections{}, address, state, times) do
      Enum.reduce(times, connections, fn ms, connections ->
        pid = :erlang.list_to_pid(~c"<0.#{map_size(connections.all) + 1}.#{address}>")
        {connections, []} = Connections.add(connections, pid, {10, 0, 0, address}, ms)
        {connections, []} = Connections.note(connections, pid, state, ms)
        connections
      end)
    end

    defp state(connections, pid),
      do: with({_address, state, since_ms} <- connections.all[pid], do: {state, since_ms})

    test "a stranger has 2 s for a whole request, a request 30, a pause 15, a WebSocket 20 for its next word" do
      for {state, ms} <- [stranger: 2_000, busy: 30_000, idle: 15_000, live: 20_000] do
        connections = all(7, state, [0])
        assert {^connections, []} = Connections.overdue(connections, ms)
        assert {%{all: none}, [_pid]} = Connections.overdue(connections, ms + 1)
        assert none == %{}
      end
    end

    test "the newest is let in: of too many strangers the oldest goes, of the address that has most" do
      one = self()
      connections = all(7, :stranger, 100..298) |> all(8, :stranger, [0])
      assert {connections, [gone]} = Connections.add(connections, one, {10, 0, 0, 8}, 200)
      assert {state(connections, one), state(connections, gone)} == {{:stranger, 200}, nil}

      assert Enum.frequencies_by(Map.values(connections.all), &elem(&1, 0)) == %{
               {10, 0, 0, 7} => 198,
               {10, 0, 0, 8} => 2
             }
    end

    test "strangers end none that is known; of too many that are, first one that waits, then the most silent page" do
      live = all(7, :live, 1..198) |> all(8, :idle, [999]) |> all(9, :busy, [0])

      many =
        Enum.reduce(1..500, live, fn ms, many ->
          pid = :erlang.list_to_pid(~c"<0.#{1_000 + ms}.0>")
          many |> Connections.add(pid, {10, 0, 0, 66}, ms) |> elem(0)
        end)

      assert Map.take(many.all, Map.keys(live.all)) == live.all
      assert map_size(many.all) == map_size(live.all) + 200

      {known, []} = Connections.add(live, self(), {10, 0, 0, 10}, 1_000)
      assert {known, [idle]} = Connections.note(known, self(), :busy, 1_000)
      assert {_address, :idle, 999} = live.all[idle]
      {known, []} = Connections.note(known, self(), :live, 1_000)
      [other | _] = Map.keys(many.all) -- Map.keys(live.all)
      {known, []} = Connections.add(known, other, {10, 0, 0, 10}, 1_001)
      assert {_known, [silent]} = Connections.note(known, other, :busy, 1_001)
      assert {_address, :live, 1} = live.all[silent]
    end

    test "what has ended comes back by no late note" do
      assert {%{all: none}, []} = Connections.note(%Connections{}, self(), :live, 0)
      assert none == %{}
    end
  end

  describe "a page" do
    @describetag skip: @server

    setup do
      {:ok, options} =
        "--robots 2 --seed 4 --blobs direct" |> OptionParser.split() |> Options.parse()

      start =
        {Live.Trial, :start_link, [Lab.Trial, Options.trial(options), Console.Pace.new(:max)]}

      live = start_supervised!(%{id: :live, start: start})
      %{source: [module: Live.Trial, live: live, robots: options.robots]}
    end

    defp stands(browser) do
      Browser.await(browser, "return document.querySelectorAll('#robots tr').length === 2")
      Browser.run(browser, "document.getElementById('estop').click()")
      said = "return document.getElementById('answer').textContent === 'estop: accepted'"
      Browser.await(browser, said)
    end

    @tag skip: @server || Browser.why_not()
    test "is opened beside 250 connections that say nothing, or half a request, and ends by none of them",
         %{source: source} do
      {:ok, _page, url} = Page.start_link(source)
      open = Browser.open({1280, 800})
      Browser.go(open, url)
      stands(open)

      Browser.run(open, """
      window.losses = 0;
      new MutationObserver(() => (window.losses += document.getElementById("fleet").className === "lost"))
        .observe(document.getElementById("fleet"), { attributes: true });
      """)

      browser = Browser.open({1280, 800})

      for said <- ["", "GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Slow: "] do
        sockets = for _nth <- 1..250, do: connect(url, said)
        Browser.go(browser, url)
        stands(browser)
        # Each of them is ended, without a word of its own.
        for socket <- sockets, do: assert(until_closed(socket) == :closed)
      end

      assert Browser.run(open, "return window.losses") == 0
      stands(open)
      for browser <- [open, browser], do: Browser.close(browser)
    end

    test "is where it was after its door has crashed", %{source: source} do
      {:ok, page, url} = Page.start_link(source)
      door = fn -> List.keyfind(Supervisor.which_children(page), Page.Door, 0) |> elem(1) end
      was = door.()
      socket = websocket(url)
      Process.exit(was, :kill)
      assert until_closed(socket) == :closed
      Swarm.Case.eventually(fn -> is_pid(door.()) and door.() != was end)
      assert {200, _, _} = ask(url, "GET /")
    end

    test "asks each WebSocket for a sign of life", %{source: source} do
      {:ok, _page, url} = Page.start_link(source)
      assert {:ping, _socket} = heard(websocket(url))
    end

    @tag long: true, realtime: :long
    test "ends a WebSocket that gives none", %{source: source} do
      {:ok, _page, url} = Page.start_link(source)
      socket = websocket(url)
      began_ms = Hal.Clock.now_ms()
      assert until_closed(socket) == :closed
      assert Hal.Clock.now_ms() - began_ms >= 20_000
    end

    # The frames of scenes, up to a ping.
    defp heard(socket, bytes \\ "") do
      case frames(bytes) do
        {:ping, _rest} ->
          {:ping, socket}

        {:more, rest} ->
          {:ok, more} = :gen_tcp.recv(socket, 0, 20_000)
          heard(socket, rest <> more)
      end
    end

    defp frames("HTTP/1.1 101" <> _ = bytes) do
      case String.split(bytes, "\r\n\r\n", parts: 2) do
        [_head, rest] -> frames(rest)
        [_part] -> {:more, bytes}
      end
    end

    defp frames(<<0x89, 0, rest::binary>>), do: {:ping, rest}
    defp frames(<<0x81, 127, size::64, _text::binary-size(size), rest::binary>>), do: frames(rest)
    defp frames(<<0x81, 126, size::16, _text::binary-size(size), rest::binary>>), do: frames(rest)

    defp frames(<<0x81, size, _text::binary-size(size), rest::binary>>) when size < 126,
      do: frames(rest)

    defp frames(part), do: {:more, part}

    defp until_closed(socket) do
      with {:ok, _bytes} <- :gen_tcp.recv(socket, 0, 60_000),
           do: until_closed(socket),
           else: ({:error, _} -> :closed)
    end

    test "looks at a few wrong tokens a second only, says so in the log, and keeps out nobody who is in",
         %{source: source} do
      log =
        capture_log(fn ->
          {:ok, _page, url} = Page.start_link(source ++ [token: "a-secret-token"])
          assert {200, head, _} = ask(url, "GET /?token=a-secret-token")
          [_all, cookie] = Regex.run(~r/Set-Cookie: (convoy_\d+=\S+);/, head)

          began_ms = Hal.Clock.now_ms()
          statuses = for _nth <- 1..100, do: url |> ask("GET /?token=another-token") |> elem(0)
          seconds = div(Hal.Clock.now_ms() - began_ms, 1_000) + 1
          assert Enum.uniq(statuses) == [401, 429]
          assert Enum.count(statuses, &(&1 == 401)) in 5..(5 + 2 * seconds)

          # Who said the right one before is in.
          assert {200, _, _} = ask(url, "GET /", [{"Cookie", cookie}])
          assert {426, _, _} = ask(url, "GET /live?token=another-token", [{"Cookie", cookie}])
          assert {401, _, _} = ask(url, "GET /", [{"Cookie", "convoy_1=x"}])

          Swarm.Case.eventually(fn ->
            match?({200, _, _}, ask(url, "GET /?token=a-secret-token"))
          end)
        end)

      assert [line] = log |> String.split("\n") |> Enum.filter(&(&1 =~ "token"))
      assert line =~ "the page was asked with a wrong token by 127.0.0.1"
    end
  end
end
