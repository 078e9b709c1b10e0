defmodule Player.Connection do
  @moduledoc """
  Speaks with one client of one robot (`Player.Session`), in a process of its own: it hears, and has orders carried out. A process
  beside it writes, as fast as the client reads, so that one that does not read keeps nobody waiting, not even its own stop; what
  waits meanwhile is bounded by `Player.Queue`. All end together.

  Its orders are those of a person (`Console.Orders`), and its address stands in the log beside each.
  """
  require Logger
  alias Bridge.Hub
  alias Console.Orders
  alias Console.Page.Line
  alias Mesh.Distribution.Access.Bucket
  alias Player.{Queue, Session, Source, Wire}
  alias Swarm.Camera

  # A word of driving lasts so long; then the robot stands.
  @drive_ms 500
  # Orders and texts at once, and in the long run; a stop is always heard.
  @at_once 20
  @per_minute 600
  # Of a drive its beginning is told.
  @pause_ms 2_000
  @pictures_hz 5

  @doc """
  Serves the client of this socket until it goes. `claim` is asked, with its name, whether it may drive the robot now; the error is
  the name of the client that does.
  """
  @spec run(:gen_tcp.socket(), %{
          required(:robot) => atom(),
          required(:page) => map(),
          required(:claim) => (who :: String.t() -> :ok | {:error, who :: String.t()}),
          optional(atom()) => term()
        }) :: no_return()
  def run(socket, %{robot: robot, claim: claim, page: page}) do
    {:ok, {address, port}} = ok!(:inet.sockname(socket))
    {:ok, {peer, from}} = ok!(:inet.peername(socket))
    who = "player #{:inet.ntoa(peer)}:#{from}"
    hub = Hub.of(page.page)
    _ref = Process.monitor(hub)
    {source, _channels} = Hub.join(hub)
    me = self()
    {:ok, orders} = Orders.start_link(who, &send(me, {:answer, &1, &2}))
    writer = spawn_link(fn -> write(socket, me) end)
    {_module, live} = source

    s = %{
      socket: socket,
      robot: robot,
      claim: claim,
      page: page,
      who: who,
      hub: hub,
      source: source,
      orders: orders,
      writer: writer,
      ready?: false,
      session: Session.new(robot, Source.body(live, robot), address, port),
      pictures: nil,
      bucket: nil,
      drove_ms: nil,
      stood_ms: nil,
      refused_ms: nil
    }

    # One that reads the banner reads at least 32 bytes at once.
    send(writer, {:write, Wire.banner()})
    :ok = Hub.next(hub, self())
    loop(s)
  end

  defp ok!({:ok, _value} = ok), do: ok
  defp ok!({:error, reason}), do: exit({:shutdown, reason})

  defp write(socket, client) do
    receive do
      {:write, bytes} ->
        with {:error, reason} <- :gen_tcp.send(socket, bytes), do: exit({:shutdown, reason})
        send(client, :written)
        write(socket, client)
    end
  end

  @spec loop(map()) :: no_return()
  defp loop(s) do
    with {:error, reason} <- :inet.setopts(s.socket, active: :once),
         do: exit({:shutdown, reason})

    s |> await() |> loop()
  end

  # Until it has heard.
  defp await(s) do
    receive do
      {:tcp, _socket, bytes} -> heard(s, bytes)
      {:tcp_closed, _socket} -> exit({:shutdown, :closed})
      {:tcp_error, _socket, reason} -> exit({:shutdown, reason})
      :written -> %{s | ready?: true} |> flush() |> await()
      {:messages, messages} -> s |> read(messages) |> flush() |> await()
      {:answer, line, answer} -> s |> tap(&told(&1, line, answer)) |> await()
      {:picture, ref, picture} -> s |> picture(ref, picture) |> flush() |> await()
      {:DOWN, ref, :process, pid, _reason} -> s |> down(ref, pid) |> await()
    end
  end

  defp heard(s, bytes) do
    case Session.hear(s.session, bytes, now_s()) do
      {:ok, session, effects} ->
        s = effects |> Enum.reduce(%{s | session: session}, &effect/2) |> flush()
        if Queue.full?(s.session.queue), do: exit({:shutdown, :reads_nothing}), else: s

      :error ->
        exit({:shutdown, :no_player})
    end
  end

  defp read(s, messages) do
    :ok = Hub.next(s.hub, self())

    session =
      for {device, {_ns, bytes}} when device != :channels <- messages, reduce: s.session do
        session -> Session.data(session, device, bytes)
      end

    %{s | session: session}
  end

  defp flush(%{ready?: false} = s), do: s

  defp flush(s) do
    case Session.take(s.session) do
      {[], session} ->
        %{s | session: session}

      {bytes, session} ->
        send(s.writer, {:write, bytes})
        %{s | session: session, ready?: false}
    end
  end

  defp effect({:ask, {:camera, 0}}, s) do
    case Camera.subscribe(s.robot, rate: @pictures_hz) do
      {:ok, ref} -> %{s | pictures: ref}
      {:error, line} -> tap(s, &told(&1, "camera", {:error, line}))
    end
  end

  defp effect({:drop, {:camera, 0}}, s) do
    if s.pictures, do: Camera.unsubscribe(s.robot, s.pictures)
    %{s | pictures: nil}
  end

  defp effect({:ask, device}, s),
    do: tap(s, &Hub.ask(&1.hub, self(), {&1.robot, device}, device))

  defp effect({:drop, device}, s), do: tap(s, &Hub.drop(&1.hub, self(), {&1.robot, device}))

  defp effect({:scene, message}, s) do
    {module, live} = s.source
    %{s | session: Session.scene(s.session, message, module.scene(live), now_s())}
  end

  # To stand still is no client's privilege. One that drove is not silent by that, and keeps the robot.
  defp effect({:drive, ahead, left}, s) when ahead == 0 and left == 0 do
    drive(s, {0.0, 0.0})
    _may_drive = s.drove_ms && s.claim.(s.who)
    begun(s, :stood_ms, "#{s.robot} stands", {:ok, "begins"})
  end

  defp effect({:drive, ahead, left}, s) do
    case s.claim.(s.who) do
      :ok ->
        drive(s, {ahead, left})
        begun(s, :drove_ms, "drives #{s.robot}", {:ok, "begins"})

      {:error, by} ->
        begun(s, :refused_ms, "drives #{s.robot}", {:error, "#{by} drives it"})
    end
  end

  defp effect({:order, line}, s) do
    given_us = System.monotonic_time(:microsecond)
    order = Line.order(line, given_us, s.page.robots.(), s.source)

    case {order, bucket(s)} do
      {{:ok, %{kind: :stop} = stop}, _bucket} ->
        tap(s, &Orders.give(&1.orders, stop))

      {_order, :error} ->
        tap(s, &told(&1, line, {:error, "too many orders: ten a second are heard"}))

      {{:ok, order}, {:ok, bucket}} ->
        tap(%{s | bucket: bucket}, &Orders.give(&1.orders, order))

      {{:error, _line} = error, {:ok, bucket}} ->
        tap(%{s | bucket: bucket}, &told(&1, line, error))
    end
  end

  defp effect({:say, text}, s) do
    case bucket(s) do
      {:ok, bucket} -> tap(%{s | bucket: bucket}, &told(&1, "#{s.robot} says", {:ok, text}))
      :error -> s
    end
  end

  defp drive(s, speeds) do
    given_us = System.monotonic_time(:microsecond)
    Orders.give(s.orders, Orders.of_speed(s.robot, speeds, @drive_ms, s.source, given_us))
  end

  defp bucket(s), do: Bucket.take(s.bucket, @at_once, @per_minute, Hal.Clock.now_ms())

  # Words come ten times a second.
  defp begun(s, what, line, answer) do
    now_ms = Hal.Clock.now_ms()
    before_ms = Map.fetch!(s, what)
    if before_ms == nil or now_ms - before_ms >= @pause_ms, do: told(s, line, answer)
    Map.replace!(s, what, now_ms)
  end

  # JPEG of red, green and blue, eight bits each.
  defp picture(%{pictures: ref} = s, ref, picture) do
    _asked = Camera.next(s.robot, ref)

    values = %{
      width: picture.width,
      height: picture.height,
      bpp: 24,
      format: 5,
      fdiv: 1,
      compression: 1,
      image: picture.jpeg
    }

    bytes = Wire.encode({:camera, 0}, :data, 1, values, now_s())
    %{s | session: Session.data(s.session, {:camera, 0}, bytes)}
  end

  # One that was under way when the client closed its camera.
  defp picture(s, _ref, _picture), do: s

  defp down(%{pictures: ref} = s, ref, _view), do: %{s | pictures: nil}
  defp down(%{hub: hub}, _ref, hub), do: exit({:shutdown, :no_hub})
  defp down(s, _ref, _pid), do: s

  defp told(s, line, {ok?, text}) do
    Logger.log(if(ok? == :ok, do: :info, else: :warning), fn ->
      "#{s.who}: #{line}: #{text |> List.wrap() |> Enum.join("; ")}"
    end)
  end

  defp now_s, do: System.os_time(:millisecond) / 1_000
end
