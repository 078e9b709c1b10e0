defmodule Bridge.Client do
  @moduledoc "A client of a WebSocket by a raw socket, which knows nothing of our frames."
  import ExUnit.Assertions

  defstruct [:socket, :headers, buffer: <<>>]

  @doc "Asks for a WebSocket; returns the client, or the status and body of a refusal."
  def open(url, headers \\ [], path \\ "/") do
    %URI{host: host, port: port} = URI.parse(url)

    {:ok, socket} =
      :gen_tcp.connect(to_charlist(host), port, [:binary, active: false, nodelay: true])

    headers = Keyword.merge([Host: "#{host}:#{port}"], headers)

    :ok =
      :gen_tcp.send(socket, [
        "GET #{path} HTTP/1.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n",
        "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n",
        for({name, value} <- headers, do: "#{name}: #{value}\r\n"),
        "\r\n"
      ])

    {head, rest} = head(socket, "")
    [status | lines] = String.split(head, "\r\n")
    ["HTTP/1.1", status | _] = String.split(status, " ")

    if status == "101" do
      # The answer of RFC 6455, 1.3, to this key.
      assert head =~ ~r/sec-websocket-accept: s3pPLMBiTxaQ9kYGzzhZRbK\+xOo=/i
      %__MODULE__{socket: socket, headers: lines, buffer: rest}
    else
      {String.to_integer(status), String.trim(rest)}
    end
  end

  defp head(socket, read) do
    case String.split(read, "\r\n\r\n", parts: 2) do
      [head, rest] ->
        {head, rest}

      _part ->
        {:ok, more} = :gen_tcp.recv(socket, 0, 10_000)
        head(socket, read <> more)
    end
  end

  @doc "Sends JSON, or bytes, each as one masked frame."
  def say(client, %{} = said), do: frame(client, 1, Hal.Json.encode!(said))
  def say(client, bytes), do: frame(client, 2, bytes)

  @doc "Sends a frame of any opcode."
  def frame(client, opcode, payload) do
    :ok = :gen_tcp.send(client.socket, bytes(opcode, payload))
    client
  end

  @doc "The bytes of a masked frame."
  def bytes(opcode, payload, fin \\ 1) do
    mask = <<0x37, 0xFA, 0x21, 0x3D>>
    size = byte_size(payload)

    length =
      cond do
        size < 126 -> <<1::1, size::7>>
        size < 65_536 -> <<1::1, 126::7, size::16>>
        true -> <<1::1, 127::7, size::64>>
      end

    masked =
      for {byte, n} <- Enum.with_index(:binary.bin_to_list(payload)),
          into: <<>>,
          do: <<Bitwise.bxor(byte, :binary.at(mask, rem(n, 4)))>>

    <<fin::1, 0::3, opcode::4, length::bits, mask::bytes, masked::bytes>>
  end

  @doc "The next frame, `{opcode, payload}`, or `:closed`; pings are answered."
  def next(client, timeout \\ 10_000) do
    case client.buffer do
      <<1::1, 0::3, opcode::4, 0::1, 127::7, size::64, payload::bytes-size(size), rest::bytes>> ->
        heard(%{client | buffer: rest}, opcode, payload)

      <<1::1, 0::3, opcode::4, 0::1, 126::7, size::16, payload::bytes-size(size), rest::bytes>> ->
        heard(%{client | buffer: rest}, opcode, payload)

      <<1::1, 0::3, opcode::4, 0::1, size::7, payload::bytes-size(size), rest::bytes>>
      when size < 126 ->
        heard(%{client | buffer: rest}, opcode, payload)

      _part ->
        case :gen_tcp.recv(client.socket, 0, timeout) do
          {:ok, more} -> next(%{client | buffer: client.buffer <> more}, timeout)
          {:error, :closed} -> {:closed, client}
          {:error, reason} -> flunk("nothing came: #{inspect(reason)}")
        end
    end
  end

  defp heard(client, 9, payload), do: client |> frame(10, payload) |> next()
  defp heard(client, opcode, payload), do: {{opcode, payload}, client}

  @doc "The next frame that a function takes, as what it returns; others are passed over."
  def await(client, take) do
    {frame, client} = next(client)
    if frame == :closed, do: flunk("the connection was closed")

    case take.(frame) do
      nil -> await(client, take)
      taken -> {taken, client}
    end
  end

  @doc "The next text frame with this op."
  def op(client, op) do
    await(client, fn
      {1, text} ->
        {:ok, said} = Bridge.Json.decode(text)
        if said["op"] == op, do: said

      _bytes ->
        nil
    end)
  end
end
