defmodule Swarm.LocalDns do
  @moduledoc """
  A name server on loopback for tests: whatever it is asked, it answers with one address record. It ends with the
  process that started it.
  """

  @doc "Starts it; the UDP port that it listens on."
  @spec start(:inet.ip4_address()) :: :inet.port_number()
  def start(address) do
    caller = self()

    spawn_link(fn ->
      {:ok, socket} = :gen_udp.open(0, [:binary, ip: {127, 0, 0, 1}, active: true])
      {:ok, port} = :inet.port(socket)
      send(caller, {__MODULE__, port})
      serve(socket, address)
    end)

    receive do: ({__MODULE__, port} -> port)
  end

  @doc "What `Cluster.Strategy.DNSPoll` asks with: Erlang's resolver, and this server."
  @spec resolver(:inet.port_number()) :: (String.t() -> [:inet.ip4_address()])
  def resolver(port) do
    fn query ->
      :inet_res.lookup(to_charlist(query), :in, :a, nameservers: [{{127, 0, 0, 1}, port}])
    end
  end

  # One question; the answer points to its name (RFC 1035, 4.1.4).
  defp serve(socket, {a, b, c, d} = address) do
    receive do
      {:udp, ^socket, ip, port, <<id::16, _flags::16, 1::16, _counts::48, rest::binary>>} ->
        size = question_size(rest, 0)
        <<question::binary-size(size), _extensions::binary>> = rest
        header = <<id::16, 0x8580::16, 1::16, 1::16, 0::32>>
        answer = <<0xC00C::16, 1::16, 1::16, 1::32, 4::16, a, b, c, d>>
        :ok = :gen_udp.send(socket, ip, port, [header, question, answer])
    end

    serve(socket, address)
  end

  # Labels up to an empty one, then type and class.
  defp question_size(<<0, _::binary>>, before), do: before + 5

  defp question_size(<<size, _label::binary-size(size), rest::binary>>, before),
    do: question_size(rest, before + 1 + size)
end
