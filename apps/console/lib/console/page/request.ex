defmodule Console.Page.Request do
  @moduledoc false
  # Answers the requests of browsers: the files of the page, `/metrics` for Prometheus, and `/live`, a WebSocket on which the page gets the map and the
  # scenes as JSON and says its lines (`Console.Page.Line`). Runs in mochiweb's processes, one a connection.
  # Debian's package; without it there is no page.
  @compile {:no_warn_undefined, [:mochiweb_socket, :mochiweb_websocket]}
  import Console.Page.Http
  alias Console.Page
  alias Console.Page.{Client, Door, Feed, Line, State}
  alias Console.About
  alias Console.{Metrics, Orders, Prompt}

  @folder Path.expand("../../../priv/page", __DIR__)
  @types %{
    ".html" => "text/html; charset=utf-8",
    ".js" => "text/javascript",
    ".css" => "text/css",
    ".svg" => "image/svg+xml"
  }

  @files for path <- Path.wildcard(Path.join(@folder, "*")),
             into: %{},
             do: {"/" <> Path.basename(path), path}
  for {_name, path} <- @files, do: @external_resource(path)

  @bodies Map.new(@files, fn {name, path} ->
            {name, {@types[Path.extname(path)], File.read!(path)}}
          end)

  # How often a browser is asked for a sign of life, which it gives by itself: an empty ping.
  @ping_ms 5_000
  @ping <<0x89, 0>>

  @doc "Answers one request; `page` has the robots, the door and what guards it (`t:Console.Page.Access.guard/0`)."
  @spec answer(term(), map()) :: term()
  def answer({:mochiweb_request, _state} = request, page) do
    case admitted(request, page) do
      :ok ->
        Door.note(page.door, :busy)
        request |> get(:path) |> List.to_string() |> serve(request, page)
        Door.note(page.door, :idle)

      {status, line} ->
        say(request, status, line)
    end
  end

  defp serve("/live", request, page) do
    if header(request, "Sec-WebSocket-Key"),
      do: live(request, page),
      else: say(request, 426, "a WebSocket lives here")
  end

  defp serve("/metrics", request, page) do
    {module, live} = page.page |> Feed.of() |> Feed.source()

    if function_exported?(module, :statuses, 1) do
      robots = page.robots.()
      text = Metrics.text(robots, module.statuses(live), Metrics.node())
      respond(request, 200, [{"Content-Type", Metrics.content_type()}], text)
    else
      say(request, 404, "metrics are of robots that are processes; a run in lockstep has none")
    end
  end

  defp serve("/camera/" <> name, request, page) do
    case Enum.find(page.robots.(), &(Atom.to_string(&1) == name)) do
      nil -> say(request, 404, "there is no robot #{inspect(name)}")
      robot -> picture(About.picture(robot), request)
    end
  end

  defp serve(path, request, page) do
    name = if path == "/", do: "/index.html", else: path

    case @bodies[name] do
      nil ->
        say(request, 404, "there is no such page; the page is /")

      {type, body} ->
        respond(request, 200, [{"Content-Type", type} | entered(request, page)], body)
    end
  end

  defp picture({:ok, jpeg}, request),
    do: respond(request, 200, [{"Content-Type", "image/jpeg"}], jpeg)

  defp picture({:error, line}, request), do: say(request, 503, line)

  # The token in the address is needed once.
  defp entered(_request, %{token: nil}), do: []

  defp entered(request, page) do
    if query(request, "token"),
      do: [
        {"Set-Cookie",
         "#{cookie_name(page)}=#{page.session}; HttpOnly; SameSite=Strict; Path=/" <>
           secure(request, page)}
      ],
      else: []
  end

  # A cookie of HTTPS does not go over the line in the clear.
  defp secure(request, %{origin: "https:" <> _ = origin}),
    do: if(Page.Access.proxy?(header(request, "Host") || "", origin), do: "; Secure", else: "")

  defp secure(_request, _page), do: ""

  defp live(request, %{page: page, robots: robots, door: door}) do
    feed = Feed.of(page)
    socket = get(request, :socket)
    {reentry, reply} = :mochiweb_websocket.upgrade_connection(request, &hear/3)
    Door.note(door, :live)
    reply.(Feed.map(feed))
    {:ok, client} = Client.start_link(feed, reply)
    {:ok, orders} = Orders.start_link("page #{peer(socket)}", &reply.(State.answer(&1, &2)))
    ping = fn -> :mochiweb_socket.send(socket, @ping) end
    _pusher = spawn_link(fn -> push(feed, reply, ping) end)
    source = Feed.source(feed)
    reentry.(%{client: client, orders: orders, robots: robots, source: source, door: door})
  end

  # Ends with the connection, and the connection with the feed: the page then says that what it shows is old, and asks
  # again.
  defp push(feed, reply, ping) do
    _ref = Process.monitor(feed)
    :ok = Feed.next(feed)
    pushed(feed, reply, ping, Hal.Clock.now_ms() + @ping_ms)
  end

  defp pushed(feed, reply, ping, due_ms) do
    receive do
      {:scene, json} ->
        written(reply.(json))
        :ok = Feed.next(feed)
        pushed(feed, reply, ping, due_ms)

      {:DOWN, _ref, :process, ^feed, _reason} ->
        exit({:shutdown, :no_feed})
    after
      max(due_ms - Hal.Clock.now_ms(), 0) ->
        written(ping.())
        pushed(feed, reply, ping, due_ms + @ping_ms)
    end
  end

  defp written(:ok), do: :ok
  defp written(error), do: exit({:shutdown, error})

  defp hear(frames, s, reply) do
    Door.note(s.door, :live)
    Enum.each(frames, &line(&1, s, reply))
    s
  end

  # A line is heard here, and what it orders waits elsewhere, so that a stop waits for nothing.
  defp line("", _s, _reply), do: :ok

  defp line(text, s, reply) do
    heard_us = System.monotonic_time(:microsecond)

    case readable(text) do
      :ok -> text |> Line.given(heard_us) |> order(heard_us, s, reply)
      error -> reply.(State.answer("", error))
    end
  end

  defp order({line, given_us}, heard_us, s, reply) do
    case Line.order(line, given_us, s.robots.(), s.source) do
      {:ok, order} -> Orders.give(s.orders, %{order | given_us: given_us || heard_us})
      {:look, robot} -> Client.look(s.client, robot)
      {:watch, what, on?} -> Client.watch(s.client, what, on?)
      error -> reply.(State.answer(line, error))
    end
  end

  defp readable(text) do
    if byte_size(text) <= Line.most_bytes() and String.printable?(text),
      do: :ok,
      else: {:error, "this is no line of text of at most #{Prompt.most_bytes()} bytes"}
  end
end
