defmodule Player.Client do
  @moduledoc "A client of Player's protocol by a raw socket, which knows nothing of our codec: bytes as the protocol has them."
  import ExUnit.Assertions

  defstruct [:socket, :port, buffer: "", data: []]

  @doc "Connects, and reads the banner."
  def open(port) do
    {:ok, socket} =
      :gen_tcp.connect({127, 0, 0, 1}, port, [:binary, active: false, nodelay: true])

    {:ok, banner} = :gen_tcp.recv(socket, 32, 10_000)
    assert <<"Player v.3", _version::binary>> = banner
    %__MODULE__{socket: socket, port: port}
  end

  @doc "A message of a client: host, robot and time are 0."
  def message({interface, index}, type, subtype, payload) do
    <<0::32, 0::32, interface::32, index::32, type::32, subtype::32, 0::64, 0::32,
      byte_size(payload)::32, payload::binary>>
  end

  @doc "Sends a command, which has no answer."
  def command(client, device, subtype, payload) do
    :ok = :gen_tcp.send(client.socket, message(device, 2, subtype, payload))
    client
  end

  @doc "Sends a request, and waits for its answer, `:ack` or `:nack`, with its payload; data that comes before it is kept."
  def request(client, device, subtype, payload \\ "") do
    :ok = :gen_tcp.send(client.socket, message(device, 3, subtype, payload))
    answer(client, device, subtype)
  end

  defp answer(client, {interface, index} = device, subtype) do
    case next(client) do
      {%{type: type, device: {^interface, ^index}, subtype: ^subtype, payload: payload}, client}
      when type in [4, 6] ->
        {if(type == 4, do: :ack, else: :nack), payload, client}

      {message, client} ->
        answer(%{client | data: [message | client.data]}, device, subtype)
    end
  end

  @doc "The next message, of any kind."
  def next(client) do
    case client.buffer do
      <<host::32, robot::32, interface::32, index::32, type::32, subtype::32, at::float-64, 0::32,
        size::32, payload::binary-size(size), rest::binary>> ->
        assert host == 0x0100007F or {type, interface} == {5, 1}
        assert robot == client.port or {type, interface} == {5, 1}

        message = %{
          device: {interface, index},
          type: type,
          subtype: subtype,
          at: at,
          payload: payload
        }

        {message, %{client | buffer: rest}}

      _part ->
        case :gen_tcp.recv(client.socket, 0, 10_000) do
          {:ok, bytes} -> next(%{client | buffer: client.buffer <> bytes})
          {:error, reason} -> flunk("no message came: #{inspect(reason)}")
        end
    end
  end

  @doc "Says PULL, as libplayerc does at first."
  def pull(client) do
    {:ack, "", client} = request(client, {1, 0}, 5, <<2::32>>)
    client
  end

  @doc "The devices that there are, as `{interface, index}`."
  def devices(client) do
    {:ack, <<count::32, count::32, devices::binary>>, client} = request(client, {1, 0}, 1)
    assert byte_size(devices) == 16 * count

    found =
      for <<0x0100007F::32, robot::32, interface::32, index::32 <- devices>> do
        assert robot == client.port
        {interface, index}
      end

    {found, client}
  end

  @doc "Opens a device; `:ack` with the access that was granted, and the driver's name."
  def subscribe(client, {interface, index}, access \\ 1) do
    payload = <<0::32, 0::32, interface::32, index::32, access::32, 0::32, 0::32>>
    {answer, payload, client} = request(client, {1, 0}, 3, payload)

    <<_host::32, _robot::32, ^interface::32, ^index::32, granted::32, size::32, size::32,
      driver::binary>> = payload

    assert rem(byte_size(driver), 4) == 0
    {{answer, granted, binary_part(driver, 0, size)}, client}
  end

  @doc "A round of PULL: all data up to the SYNCH, as `{device, payload}`, and what the SYNCH says."
  def a_round(client) do
    {:ack, "", client} = request(client, {1, 0}, 4)
    collect(client, [])
  end

  defp collect(client, data) do
    case next(client) do
      {%{type: 5, device: {1, 0}} = synch, client} ->
        {Enum.reverse(data), {synch.subtype, synch.payload}, client}

      {%{type: 1, subtype: 1} = message, client} ->
        collect(client, [{message.device, message.payload} | data])
    end
  end

  @doc "Rounds until a function of the payload of a device returns something."
  def await(client, device, look, rounds \\ 300) do
    if rounds == 0, do: flunk("it never came")
    {data, _synch, client} = a_round(client)

    case for({^device, payload} <- data, found = look.(payload), do: found) do
      [] -> await(client, device, look, rounds - 1)
      [found | _] -> {found, client}
    end
  end

  @doc "A reading of position2d."
  def position(
        <<x::float-64, y::float-64, yaw::float-64, vx::float-64, 0::64, va::float-64, stall::32>>
      ),
      do: %{x: x, y: y, yaw: yaw, vx: vx, va: va, stall: stall}

  @doc "A velocity, as `playerc_position2d_set_cmd_vel` sends it."
  def velocity(client, ahead, left),
    do: command(client, {4, 0}, 1, <<ahead::float-64, 0::64, left::float-64, 1::32>>)
end
