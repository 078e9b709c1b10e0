defmodule Bridge.Connection do
  @moduledoc """
  Speaks a protocol (`Bridge.Dialect`) with one program, in the process in which its request was answered: it hears, and has
  orders carried out. A process of its own writes what the hub has (`Bridge.Hub`), as fast as the program takes it, so a program that does
  not read keeps nobody waiting, not even its own stop. All end together.

  Its orders are those of a person (`Console.Orders`), and its address stands in the log beside each.
  """
  # Debian's package; without it there is no server.
  @compile {:no_warn_undefined, [:mochiweb_socket]}
  require Logger
  import Console.Page.Http
  alias Bridge.{Frames, Hub}
  alias Console.Orders
  alias Console.Page.{Door, Line}
  alias Mesh.Distribution.Access.Bucket

  # As browsers of the page are asked for a sign of life, which they give by themselves.
  @ping_ms 5_000
  # A word of driving lasts so long; then the robot stands.
  @drive_ms 500
  # Orders at once, and in the long run; a stop is always heard.
  @at_once 20
  @per_minute 600
  # Of a drive its beginning is told.
  @pause_ms 2_000

  @doc "Answers a request: by a WebSocket, if it may and wants one. `name` is what the protocol is called."
  @spec answer(term(), map(), module(), name :: String.t()) :: term()
  def answer(request, page, dialect, name) do
    key = header(request, "Sec-WebSocket-Key")

    with :ok <- admitted(request, page, &dialect.origin?/1),
         {:key, true} <- {:key, key != nil},
         {:ok, protocol} <- request |> offered() |> dialect.subprotocol() do
      chosen = if protocol, do: [{"Sec-WebSocket-Protocol", protocol}], else: []

      respond(
        request,
        101,
        [
          {"Connection", "Upgrade"},
          {"Upgrade", "websocket"},
          {"Sec-WebSocket-Accept", Frames.accept(key)} | chosen
        ],
        ""
      )

      Door.note(page.door, :live)
      start(get(request, :socket), page, dialect, name)
    else
      {:key, false} -> say(request, 426, "a WebSocket lives here, which speaks #{name}")
      {:error, line} -> say(request, 400, line)
      {status, line} -> say(request, status, line)
    end
  end

  @doc """
  Whether a page was served on this machine.

      iex> for origin <- ["http://localhost:8080", "http://127.0.0.1", "http://localhost.evil.example", "null"],
      ...>     do: Bridge.Connection.here?(origin)
      [true, true, false, false]
  """
  @spec here?(origin :: String.t()) :: boolean()
  def here?(origin), do: origin =~ ~r/\Ahttp:\/\/(localhost|127\.0\.0\.1)(:\d+)?\z/

  defp offered(request) do
    (header(request, "Sec-WebSocket-Protocol") || "")
    |> String.split(",", trim: true)
    |> Enum.map(&String.trim/1)
  end

  defp start(socket, page, dialect, name) do
    me = self()
    hub = Hub.of(page.page)
    {source, channels} = Hub.join(hub)
    who = "#{name} #{peer(socket)}"
    {:ok, orders} = Orders.start_link(who, &send(me, {:answer, &1, &2}))
    _writer = spawn_link(fn -> write(hub, me, socket, dialect) end)
    {state, effects} = dialect.new(channels)

    s = %{
      socket: socket,
      page: page,
      dialect: dialect,
      who: who,
      hub: hub,
      source: source,
      orders: orders,
      frames: %Frames{},
      state: state,
      calls: [],
      bucket: nil,
      drives: %{}
    }

    s |> effects(effects) |> loop()
  end

  # Ends with the connection, and the connection with the hub.
  defp write(hub, client, socket, dialect) do
    _ref = Process.monitor(hub)
    :ok = Hub.next(hub, client)
    written(hub, client, socket, dialect, Hal.Clock.now_ms() + @ping_ms)
  end

  defp written(hub, client, socket, dialect, due_ms) do
    receive do
      {:messages, messages} ->
        for {:channels, channels} <- messages, do: send(client, {:channels, channels})

        frames =
          for {tag, message} <- messages,
              frame = dialect.message(tag, message),
              do: Frames.write(frame)

        send!(socket, frames)
        :ok = Hub.next(hub, client)
        written(hub, client, socket, dialect, due_ms)

      {:DOWN, _ref, :process, ^hub, _reason} ->
        exit({:shutdown, :no_hub})
    after
      max(due_ms - Hal.Clock.now_ms(), 0) ->
        send!(socket, Frames.write({:ping, ""}))
        written(hub, client, socket, dialect, due_ms + @ping_ms)
    end
  end

  defp send!(socket, bytes) do
    with error when error != :ok <- :mochiweb_socket.send(socket, bytes),
         do: exit({:shutdown, error})
  end

  defp loop(s) do
    :ok = :mochiweb_socket.exit_if_closed(:mochiweb_socket.setopts(s.socket, active: :once))
    s |> await() |> loop()
  end

  # Until it has heard.
  defp await(s) do
    receive do
      {:tcp, _socket, bytes} -> heard(s, bytes)
      {:tcp_closed, _socket} -> exit({:shutdown, :closed})
      {:tcp_error, _socket, reason} -> exit({:shutdown, reason})
      {:answer, line, answer} -> s |> answered(line, answer) |> await()
      {:values, ref, values} -> s |> does(&s.dialect.values(ref, values, &1)) |> await()
      {:channels, channels} -> await(%{s | state: s.dialect.channels(channels, s.state)})
    end
  end

  defp heard(s, bytes) do
    Door.note(s.page.door, :live)

    case Frames.read(s.frames, bytes) do
      {:ok, messages, frames} -> Enum.reduce(messages, %{s | frames: frames}, &said(&2, &1))
      {:error, status} -> close(s, status)
    end
  end

  defp said(s, {:ping, data}), do: tap(s, &send!(&1.socket, Frames.write({:pong, data})))
  defp said(s, :pong), do: s
  defp said(s, :close), do: close(s, 1000)
  defp said(s, message), do: does(s, &s.dialect.hear(message, s.page.robots.(), &1))

  @spec close(map(), 1000..1009) :: no_return()
  defp close(s, status) do
    send!(s.socket, Frames.write({:close, status}))
    :mochiweb_socket.close(s.socket)
    exit({:shutdown, status})
  end

  defp does(s, step) do
    {state, effects} = step.(s.state)
    effects(%{s | state: state}, effects)
  end

  defp effects(s, effects), do: Enum.reduce(effects, s, &effect/2)

  defp effect({:say, frame}, s), do: tap(s, &send!(&1.socket, Frames.write(frame)))

  defp effect({:ask, key, tag, every_ms}, s),
    do: tap(s, &Hub.ask(&1.hub, self(), key, tag, every_ms))

  defp effect({:drop, key}, s), do: tap(s, &Hub.drop(&1.hub, self(), key))
  defp effect({:values, ref}, s), do: tap(s, &Hub.values(&1.hub, ref))

  defp effect({:order, line, call}, s) do
    given_us = System.monotonic_time(:microsecond)
    order = Line.order(line, given_us, s.page.robots.(), s.source)

    case {order, Bucket.take(s.bucket, @at_once, @per_minute, Hal.Clock.now_ms())} do
      {{:ok, %{kind: :stop} = stop}, _bucket} ->
        given(s, stop, call)

      {_order, :error} ->
        does(s, &s.dialect.answer(call, {:error, "too many orders: ten a second are heard"}, &1))

      {{:ok, order}, {:ok, bucket}} ->
        given(%{s | bucket: bucket}, order, call)

      {{:error, _line} = error, {:ok, bucket}} ->
        told(s, line, error)
        does(%{s | bucket: bucket}, &s.dialect.answer(call, error, &1))
    end
  end

  defp effect({:drive, robot, ahead, left}, s) do
    given_us = System.monotonic_time(:microsecond)
    Orders.give(s.orders, Orders.of_speed(robot, {ahead, left}, @drive_ms, s.source, given_us))

    now_ms = Hal.Clock.now_ms()
    before_ms = s.drives[robot]

    if before_ms == nil or now_ms - before_ms >= @pause_ms,
      do: told(s, "drives #{robot}", {:ok, "begins"})

    %{s | drives: Map.put(s.drives, robot, now_ms)}
  end

  defp given(s, order, call) do
    Orders.give(s.orders, order)
    %{s | calls: s.calls ++ [{order.line, order.kind, call}]}
  end

  defp answered(s, "drive", {:error, line}), do: does(s, &s.dialect.refused(line, &1))

  # A stop that was given while one like it was under way is answered with it (`Console.Orders`).
  defp answered(s, line, answer) do
    told(s, line, answer)
    {same, others} = Enum.split_with(s.calls, &match?({^line, _kind, _call}, &1))

    {now, later} =
      case same do
        [{_line, :stop, _call} | _] -> {same, []}
        _orders -> Enum.split(same, 1)
      end

    Enum.reduce(now, %{s | calls: others ++ later}, fn {_line, _kind, call}, s ->
      does(s, &s.dialect.answer(call, answer, &1))
    end)
  end

  defp told(s, line, {ok?, text} = answer) do
    Logger.log(if(ok? == :ok, do: :info, else: :warning), fn ->
      "#{s.who}: #{line}: #{text |> List.wrap() |> Enum.join("; ")}"
    end)

    Hub.ordered(s.hub, s.who, line, answer)
  end
end
