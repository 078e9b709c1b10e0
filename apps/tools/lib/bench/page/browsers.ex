defmodule Bench.Page.Browsers do
  @moduledoc "Connections to the page's WebSocket, or to one in its place, that read all they are sent, or nothing at all."

  # A busy machine takes long to let a hundred in.
  @patience_ms 60_000

  @doc "Opens so many to this port of the loopback; returns when the page has taken all, and each has said these words."
  @spec start(:inet.port_number(), non_neg_integer(), :nobody | :readers | :deaf, [String.t()]) ::
          pid()
  def start(port, count, who, words) do
    caller = self()

    browsers =
      spawn(fn ->
        sockets = for _browser <- 1..count//1, do: call(port, who)
        Enum.each(sockets, &taken(&1, who, words))
        send(caller, {:open, self()})
        run(sockets, who)
      end)

    receive(do: ({:open, ^browsers} -> browsers))
  end

  @doc "Closes them."
  @spec stop(pid()) :: :ok
  def stop(browsers) do
    send(browsers, {:stop, self()})
    receive(do: ({:stopped, ^browsers} -> :ok))
  end

  # One who reads nothing has a small buffer, so that the page soon waits for it.
  defp call(port, who) do
    options = if who == :deaf, do: [recbuf: 2_048], else: []

    {:ok, socket} = :gen_tcp.connect({127, 0, 0, 1}, port, [:binary, active: false] ++ options)

    :ok =
      :gen_tcp.send(socket, [
        "GET /live HTTP/1.1\r\nHost: 127.0.0.1:#{port}\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n",
        "Sec-WebSocket-Protocol: foxglove.websocket.v1\r\n",
        "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
      ])

    socket
  end

  defp taken(socket, who, words) do
    {:ok, "HTTP/1.1 101" <> _rest} = :gen_tcp.recv(socket, 0, @patience_ms)
    :ok = :gen_tcp.send(socket, Enum.map(words, &frame/1))
    if who == :readers, do: :ok = :inet.setopts(socket, active: true)
  end

  # A mask of zeros leaves the text as it is.
  defp frame(text) when byte_size(text) < 126,
    do: <<0x81, 1::1, byte_size(text)::7, 0::32, text::bytes>>

  defp frame(text), do: <<0x81, 0xFE, byte_size(text)::16, 0::32, text::bytes>>

  defp run(sockets, who) do
    receive do
      {:stop, from} ->
        Enum.each(sockets, &:gen_tcp.close/1)
        send(from, {:stopped, self()})

      {:tcp_closed, _socket} ->
        exit({:shutdown, :closed})

      {:tcp, _socket, _bytes} ->
        run(sockets, who)
    end
  end
end
