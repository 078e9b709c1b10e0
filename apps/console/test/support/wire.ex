defmodule Console.Wire do
  @moduledoc "Talks to the page byte by byte, as no browser would."

  @doc "A connection to the page of this address that has said these bytes."
  @spec connect(url :: String.t(), iodata()) :: :gen_tcp.socket()
  def connect(url, said \\ "") do
    %URI{port: port} = URI.parse(url)
    {:ok, socket} = :gen_tcp.connect({127, 0, 0, 1}, port, [:binary, active: false])
    :ok = :gen_tcp.send(socket, said)
    socket
  end

  @doc "A request: its first line, without the version, and its headers; `nil` leaves one of the usual ones out."
  @spec request(url :: String.t(), String.t(), [{String.t(), String.t() | nil}]) :: iodata()
  def request(url, line, headers \\ []) do
    %URI{port: port} = URI.parse(url)

    headers =
      Map.merge(%{"Host" => "127.0.0.1:#{port}", "Connection" => "close"}, Map.new(headers))

    lines = for {name, value} <- headers, value != nil, do: "#{name}: #{value}\r\n"
    [line, " HTTP/1.1\r\n", lines, "\r\n"]
  end

  @doc "The status, the head and the body of an answer."
  @spec ask(url :: String.t(), String.t(), [{String.t(), String.t() | nil}]) ::
          {100..599, String.t(), String.t()}
  def ask(url, line, headers \\ []) do
    socket = connect(url, request(url, line, headers))
    [head, body] = socket |> all("") |> String.split("\r\n\r\n", parts: 2)
    [_all, status] = Regex.run(~r/^HTTP\/1.1 (\d+)/, head)
    {String.to_integer(status), head, body}
  end

  defp all(socket, said) do
    case :gen_tcp.recv(socket, 0, 10_000) do
      {:ok, more} -> all(socket, said <> more)
      {:error, :closed} -> said
    end
  end

  @doc "A WebSocket of the page that says nothing."
  @spec websocket(url :: String.t()) :: :gen_tcp.socket()
  def websocket(url) do
    upgrade = [
      {"Connection", "Upgrade"},
      {"Upgrade", "websocket"},
      {"Sec-WebSocket-Key", "dGhlIHNhbXBsZSBub25jZQ=="},
      {"Sec-WebSocket-Version", "13"}
    ]

    connect(url, request(url, "GET /live", upgrade))
  end
end
