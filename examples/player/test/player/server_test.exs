defmodule Player.ServerTest do
  @moduledoc "Player's protocol against a simulated fleet in real time, by a client that knows nothing of our codec."
  use ExUnit.Case, async: false
  import Player.Client, except: [open: 1]
  alias Console.{Live, Page}
  alias Player.{Client, Server}
  @moduletag :realtime
  @moduletag :capture_log
  @moduletag skip: Console.PageCase.no_server() || false

  @position2d {4, 0}
  @simulation {31, 0}

  setup do
    options = %{robots: [:mag1, :mag2], mission: false, seed: 5, map: "hall"}
    live = start_supervised!(%{id: :fleet, start: {Live.Fleet, :start_link, [options]}})
    port = free_ports()

    page = [
      module: Live.Fleet,
      live: live,
      robots: [:mag1, :mag2],
      service: Server,
      port: port
    ]

    {:ok, _page, url} = start_supervised(%{id: :page, start: {Page, :start_link, [page]}})
    assert url == "player://127.0.0.1:#{port}/"
    %{live: live, port: port}
  end

  # Two that are free, one after the other.
  defp free_ports do
    {:ok, one} = :gen_tcp.listen(0, ip: {127, 0, 0, 1})
    {:ok, port} = :inet.port(one)
    next = :gen_tcp.listen(port + 1, ip: {127, 0, 0, 1})
    :gen_tcp.close(one)

    case next do
      {:ok, two} ->
        :gen_tcp.close(two)
        port

      {:error, _taken} ->
        free_ports()
    end
  end

  defp driver(port) do
    client = port |> Client.open() |> pull()
    {{:ack, 1, "convoy\0"}, client} = subscribe(client, @position2d)
    client
  end

  defp true_pose(client, name) do
    name = name <> <<0>>
    size = byte_size(name)
    padding = :binary.copy(<<0>>, rem(4 - rem(size, 4), 4))
    # The pose of a question has not been written.
    asked = <<size::32, size::32, name::binary, padding::binary, -1::192>>
    {answer, payload, client} = request(client, @simulation, 1, asked)

    case {answer, payload} do
      {:ack,
       <<^size::32, ^size::32, _name::binary-size(size + byte_size(padding)), x::float, y::float,
         _yaw::float>>} ->
        {{x, y}, client}

      {:nack, ""} ->
        {:nack, client}
    end
  end

  test "begins as libplayerc does, and every device says what it should", %{port: port} do
    {devices, client} = port |> Client.open() |> pull() |> devices()
    assert {4, 0} in devices and {5, 0} in devices and {2, 0} in devices and {14, 0} in devices
    assert {8, 0} in devices and {7, 0} in devices and {62, 0} in devices and {25, 0} in devices

    client =
      Enum.reduce(devices, client, fn {interface, index} = device, client ->
        info = <<0::64, interface::32, index::32, 0::32, 0::32>>
        {:ack, answer, client} = request(client, {1, 0}, 2, info)

        assert <<_host::32, ^port::32, ^interface::32, ^index::32, 7::32, 7::32, "convoy", 0, 0>> =
                 answer

        {{:ack, 1, "convoy\0"}, client} = subscribe(client, device)
        client
      end)

    rule = <<-1::signed-32, -1::signed-32, 1::signed-32, -1::signed-32, 1::signed-32>>
    {:ack, "", client} = request(client, {1, 0}, 10, rule)

    {:ack, <<0::64, 0::64, 0::64, 0::64, 0::64, 0::64, 0.4::float, 0.4::float, _height::float>>,
     client} = request(client, @position2d, 1)

    for_each = fn client, device, subtype, bytes ->
      {:ack, <<16::32, 16::32, poses::binary>>, client} = request(client, device, subtype)
      assert byte_size(poses) == 16 * bytes
      client
    end

    client = for_each.(client, {5, 0}, 1, 48)
    # Simulated bases report no infrareds.
    {:nack, "", client} = request(client, {22, 0}, 1)
    client = for_each.(client, {14, 0}, 1, 56)

    {:ack,
     <<_geometry::binary-size(72), 16::32, 16::32, _poses::binary-size(768), 16::32, 16::32,
       _sizes::binary-size(384)>>, client} = request(client, {62, 0}, 1)

    {{_x, _y}, client} = await(client, @position2d, &{position(&1).x, position(&1).y})

    {ranges, client} =
      await(client, {5, 0}, fn <<16::32, 16::32, ranges::binary>> ->
        for(<<range::float-32 <- ranges>>, do: range)
      end)

    assert length(ranges) == 16 and Enum.all?(ranges, &(&1 > 0.1 and &1 < 5.2))

    {{count, bytes}, client} =
      await(client, {62, 0}, fn <<count::32, count::32, ranges::binary>> ->
        {count, byte_size(ranges)}
      end)

    assert {count, bytes} == {16, 128}

    {bumpers, client} =
      await(client, {14, 0}, fn <<16::32, 16::32, pressed::binary-size(16)>> -> pressed end)

    assert bumpers == <<0::128>>

    {{1, volts}, client} =
      await(client, {2, 0}, fn <<valid::32, volts::float-32, _rest::binary-size(16)>> ->
        {valid, volts}
      end)

    assert volts > 5.0

    {{pan, zoom}, client} =
      await(client, {8, 0}, fn <<pan::float-32, _tilt::float-32, zoom::float-32,
                                 _rest::binary-size(12)>> ->
        {pan, zoom}
      end)

    assert abs(pan) < 2.0 and zoom > 0.1

    {{320, 240}, client} =
      await(client, {7, 0}, fn <<width::32, height::32, count::32, count::32,
                                 blobs::binary-size(count * 40)>>
                               when is_binary(blobs) ->
        {width, height}
      end)

    {{0, 1.0}, client} =
      await(client, {25, 0}, fn <<pending::32, _time::float, 1::32, 1::32, _mean::binary-size(24),
                                  _cov::binary-size(48), alpha::float>> ->
        {pending, alpha}
      end)

    {place, client} = true_pose(client, "mag2")
    assert {_x, _y} = place
    assert {:nack, _client} = true_pose(client, "mag9")
  end

  test "the map comes in tiles", %{port: port} do
    client = port |> Client.open() |> pull()

    {:ack, <<scale::float-32, width::32, height::32, x::float, y::float, 0::64>>, client} =
      request(client, {42, 0}, 1)

    assert_in_delta x, -width * scale / 2, scale
    assert_in_delta y, -height * scale / 2, scale
    tile = <<0::32, 0::32, width::32, 2::32, 0::32, 0::32, 0::32>>
    {:ack, answer, client} = request(client, {42, 0}, 2, tile)

    <<0::32, 0::32, ^width::32, 2::32, size::32, 1::32, size::32, packed::binary-size(size),
      _zeros::binary>> = answer

    cells = :zlib.uncompress(packed)
    assert byte_size(cells) == 2 * width
    assert Enum.uniq(:binary.bin_to_list(cells)) -- [1, 255] == []
    beyond = <<0::32, 0::32, width + 1::32, 2::32, 0::32, 0::32, 0::32>>
    assert {:nack, "", _client} = request(client, {42, 0}, 2, beyond)
  end

  test "drives while it is told to, stands half a second after, and one client drives at a time",
       %{port: port} do
    {start, client} = port |> driver() |> await(@position2d, &position/1)
    client = velocity(client, 0.2, 0.0)
    moving = fn client -> velocity(client, 0.2, 0.0) end

    {at, client} =
      Enum.reduce_while(1..100, client, fn _nth, client ->
        {at, client} = client |> moving.() |> await(@position2d, &position/1)
        if at.vx > 0.1, do: {:halt, {at, client}}, else: {:cont, client}
      end)

    assert at.stall == 0

    # Another one may look, not drive.
    other = driver(port)
    other = velocity(other, -0.5, 0.0)
    {at, client} = client |> moving.() |> await(@position2d, &position/1)
    assert at.vx > 0.0
    {_at, other} = await(other, @position2d, &position/1)

    # Silence is a stop.
    {stood, client} = await(client, @position2d, &if(position(&1).vx < 0.01, do: position(&1)))
    assert :math.sqrt((stood.x - start.x) ** 2 + (stood.y - start.y) ** 2) > 0.05

    other = velocity(other, 0.0, 0.5)

    {turning, other} =
      other
      |> velocity(0.0, 0.5)
      |> await(@position2d, &if(position(&1).va > 0.1, do: position(&1)))

    assert turning.va > 0.1

    # Each may stop it.
    {still, _clients} =
      Enum.reduce_while(1..100, {nil, {client, other}}, fn _nth, {_at, {client, other}} ->
        other = velocity(other, 0.0, 0.5)
        {at, client} = client |> velocity(0.0, 0.0) |> await(@position2d, &position/1)
        if at.va < 0.05, do: {:halt, {at, nil}}, else: {:cont, {at, {client, other}}}
      end)

    assert still.va < 0.05
  end

  test "the camera turns where it is told, no farther than it can", %{port: port} do
    ptz = {8, 0}
    client = port |> Client.open() |> pull()
    {{:ack, 1, "convoy\0"}, client} = subscribe(client, ptz)

    looks = fn client, pan, seen ->
      client = command(client, ptz, 1, <<pan::float-32, 0::128>>)

      {_pan, client} =
        await(client, ptz, fn <<now::float-32, _rest::binary>> ->
          if abs(now - seen) < 0.05, do: now
        end)

      client
    end

    client |> looks.(0.6, 0.6) |> looks.(-9.0, -1.74)
  end

  test "a client that drove, and now says that it stands, is not silent: no other drives", %{
    port: port
  } do
    client = port |> driver() |> velocity(0.0, 0.2)
    {_at, client} = await(client, @position2d, &if(position(&1).va > 0.1, do: position(&1)))
    now_ms = fn -> System.monotonic_time(:millisecond) end
    until_ms = now_ms.() + 1_500

    turned =
      fn -> nil end
      |> Stream.repeatedly()
      |> Stream.transform({client, driver(port)}, fn _nil, {client, other} ->
        if now_ms.() < until_ms do
          {at, client} = client |> velocity(0.0, 0.0) |> await(@position2d, &position/1)
          {[at.va], {client, velocity(other, 0.0, -0.5)}}
        else
          {:halt, nil}
        end
      end)
      |> Enum.to_list()

    assert length(turned) >= 10
    assert Enum.min(turned) > -0.05
  end

  test "goes to a place, in its own odometry", %{port: port} do
    client = driver(port)
    {:ack, "", client} = request(client, @position2d, 6)
    {at, client} = await(client, @position2d, &position/1)
    assert abs(at.x) < 0.1 and abs(at.y) < 0.1 and abs(at.yaw) < 0.1
    goal = <<0.5::float, 0::64, 0::64, 0::64, 0::64, 0::64, 1::32>>
    client = command(client, @position2d, 2, goal)

    {_at, _client} =
      await(client, @position2d, fn payload ->
        if abs(position(payload).x - 0.5) < 0.15, do: :there
      end)
  end

  test "the emergency stop is obeyed and told", %{port: port} do
    client = port |> driver() |> velocity(0.2, 0.0)
    :ok = Swarm.estop()

    {%{stall: 1}, client} =
      await(client, @position2d, &if(position(&1).stall == 1, do: position(&1)))

    {at, client} =
      Enum.map_reduce(1..10, client, fn _nth, client ->
        client |> velocity(0.3, 0.0) |> await(@position2d, &position/1)
      end)

    assert List.last(at).vx < 0.02
    :ok = Swarm.reset()

    {%{stall: 0}, _client} =
      await(client, @position2d, &if(position(&1).stall == 0, do: position(&1)))
  end

  test "what it does not know is refused, and what no client says ends its connection alone", %{
    port: port
  } do
    client = port |> Client.open() |> pull()
    {{:nack, 3, ""}, client} = subscribe(client, {6, 9})
    {:nack, "", client} = request(client, {6, 9}, 1)
    {:nack, "", client} = request(client, @position2d, 7, <<0::96>>)
    {:nack, "", client} = request(client, {1, 0}, 8)
    {:nack, "", client} = request(client, {8, 0}, 254, <<0::32>>)
    {:nack, "", client} = request(client, @position2d, 5, <<1, 2>>)

    {:ok, socket} = :gen_tcp.connect({127, 0, 0, 1}, port, [:binary, active: false])
    {:ok, _banner} = :gen_tcp.recv(socket, 32, 5_000)
    :ok = :gen_tcp.send(socket, "GET / HTTP/1.1\r\nHost: 127.0.0.1:#{port}\r\n\r\n")
    assert {:error, :closed} = :gen_tcp.recv(socket, 0, 5_000)

    assert {[_ | _], _client} = devices(client)
  end

  test "PUSH says it as it comes; each robot has its port, and pictures are JPEG", %{port: port} do
    client = Client.open(port + 1)
    {{:ack, 1, _driver}, client} = subscribe(client, @position2d)
    assert {%{type: 1, device: @position2d}, client} = next(client)
    assert {%{type: 1, device: @position2d, at: at}, client} = next(client)
    assert abs(at - System.os_time(:second)) < 60
    {devices, client} = devices(client)

    if {40, 0} in devices and System.find_executable("ffmpeg") do
      {{:ack, 1, _driver}, client} = subscribe(client, {40, 0})
      jpeg = picture(client)
      assert <<0xFF, 0xD8, _jpeg::binary>> = jpeg
    end
  end

  defp picture(client) do
    case next(client) do
      {%{device: {40, 0}, payload: payload}, _client} ->
        assert <<320::32, 240::32, 24::32, 5::32, 1::32, 1::32, size::32, size::32, jpeg::binary>> =
                 payload

        binary_part(jpeg, 0, size)

      {_other, client} ->
        picture(client)
    end
  end

  test "is served on this machine alone", %{live: live} do
    options = [module: Live.Fleet, live: live, robots: [:mag1], service: Server]
    assert {:error, line} = Page.start_link([address: {0, 0, 0, 0}, token: "12345678"] ++ options)
    assert line =~ "this machine alone"
  end
end
