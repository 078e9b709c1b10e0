defmodule Console.HttpsProxy do
  @moduledoc "A proxy for tests: HTTPS on a port of the loopback, HTTP behind it, a prefix of the path taken away."

  @doc "Starts it before a port; `host` replaces the browser's `Host`, if it is given. Returns its own port."
  @spec start(:inet.port_number(), keyword()) :: :inet.port_number()
  def start(behind, options \\ []) do
    {:ok, _apps} = Application.ensure_all_started(:ssl)
    key = [key: {:namedCurve, :secp256r1}, digest: :sha256]
    chain = %{root: key, intermediates: [], peer: key}

    %{server_config: certified} =
      :public_key.pkix_test_data(%{server_chain: chain, client_chain: chain})

    {:ok, listen} =
      :ssl.listen(0, [:binary, active: false, reuseaddr: true, ip: {127, 0, 0, 1}] ++ certified)

    {:ok, {_address, port}} = :ssl.sockname(listen)
    _acceptor = spawn_link(fn -> accept(listen, behind, options) end)
    port
  end

  defp accept(listen, behind, options) do
    {:ok, socket} = :ssl.transport_accept(listen)
    one = spawn(fn -> receive(do: (:go -> serve(socket, behind, options))) end)
    :ok = :ssl.controlling_process(socket, one)
    send(one, :go)
    accept(listen, behind, options)
  end

  defp serve(socket, behind, options) do
    with {:ok, browser} <- :ssl.handshake(socket, 10_000),
         {:ok, page} <- :gen_tcp.connect({127, 0, 0, 1}, behind, [:binary, active: true]) do
      :ok = :ssl.setopts(browser, active: true)
      pass(browser, page, options)
    end
  end

  defp pass(browser, page, options) do
    receive do
      {:ssl, ^browser, bytes} ->
        :ok = :gen_tcp.send(page, changed(bytes, options))
        pass(browser, page, options)

      {:tcp, ^page, bytes} ->
        :ok = :ssl.send(browser, bytes)
        pass(browser, page, options)

      _closed ->
        :ssl.close(browser)
        :gen_tcp.close(page)
    end
  end

  # Requests of browsers come whole.
  defp changed("GET " <> _ = request, options) do
    request = String.replace(request, "GET #{options[:prefix]}/", "GET /", global: false)

    if host = options[:host],
      do: Regex.replace(~r/\r\nHost: [^\r]*/i, request, "\r\nHost: #{host}", global: false),
      else: request
  end

  defp changed(bytes, _options), do: bytes
end
