defmodule Mesh.Protocol.Packet do
  @moduledoc """
  Encodes one signed datagram. Pure.

      "CVY" | version | kind | length of name | name | session | sequence | time | count | addresses | payload | signature
        3        1       1          1                     8         8        8       1      6 each                 16     bytes

  The name is that of the sending node, the session a random number that it draws at its start,
  the sequence grows with every datagram. The time is the sender's monotonic one in ms, which only
  means something together with the session (`Mesh.Protocol.ClockOffset`). The addresses are those
  that the sender has now: what arrives from any other was forwarded. The signature is the first
  half of HMAC-SHA256 with the fleet's key, over everything before it: a datagram without a valid
  signature is not processed further.

  Kinds: `:beacon` (the sender, the nodes that it knows), `:message` (of a robot, read by the node's
  `Mesh.Consumer`), `:service` (`Mesh.cast/2`), `:challenge` and `:answer`
  (`Mesh.Protocol.Challenge`). Payloads of the first three are terms in the external format,
  decoded without creating atoms.
  """

  @enforce_keys [:sender, :session, :sequence, :time_ms, :addresses, :kind, :payload]
  defstruct @enforce_keys

  @type kind :: :beacon | :message | :service | :challenge | :answer
  @type t :: %__MODULE__{
          sender: String.t(),
          session: non_neg_integer(),
          sequence: non_neg_integer(),
          time_ms: integer(),
          addresses: [Mesh.Strategy.address()],
          kind: kind(),
          payload: binary()
        }
  @type refusal :: :not_ours | :version | :unsigned | :payload

  @version 2
  @mac 16
  @kinds [beacon: 1, message: 2, service: 3, challenge: 4, answer: 5]
  @most_addresses 16
  # With a name of 90 letters and all addresses.
  @challenge 256

  # More than any payload unpacks to; otherwise a small datagram could unpack to gigabytes.
  @most 262_144
  @largest 60_000
  @frame 1_200

  @doc "The largest payload of a datagram, in bytes."
  @spec largest() :: pos_integer()
  def largest, do: @largest

  @doc "How many addresses of its sender a datagram may name."
  @spec most_addresses() :: pos_integer()
  def most_addresses, do: @most_addresses

  @doc "The zeros that make a challenge or an answer as large as any other."
  @spec padding(t()) :: binary()
  def padding(packet),
    do: <<0::size(max(@challenge - byte_size(body(packet)) - @mac, 0))-unit(8)>>

  @doc """
  Signs a packet.

      iex> alias Mesh.Protocol.Packet
      iex> packet = %Packet{sender: "mag1@lab", session: 7, sequence: 1, time_ms: -99, kind: :beacon,
      ...>   addresses: [{{10, 0, 0, 7}, 4370}], payload: "hello"}
      iex> {:ok, ^packet} = packet |> Packet.seal("the fleet's key") |> Packet.open("the fleet's key")
      iex> packet |> Packet.seal("another key") |> Packet.open("the fleet's key")
      {:error, :unsigned}
  """
  @spec seal(t(), key :: binary()) :: binary()
  def seal(%__MODULE__{} = packet, key) do
    body = body(packet)
    body <> mac(key, body)
  end

  defp body(packet) do
    addresses =
      for {{a, b, c, d}, port} <- packet.addresses, into: <<>>, do: <<a, b, c, d, port::16>>

    <<"CVY", @version, @kinds[packet.kind], byte_size(packet.sender), packet.sender::binary,
      packet.session::64, packet.sequence::64, packet.time_ms::signed-64,
      length(packet.addresses), addresses::binary, packet.payload::binary>>
  end

  @doc """
  Opens a datagram from anywhere.

      iex> Mesh.Protocol.Packet.open("garbage", "the fleet's key")
      {:error, :not_ours}
  """
  @spec open(binary(), key :: binary()) :: {:ok, t()} | {:error, refusal()}
  def open(
        <<"CVY", @version, kind, size, sender::binary-size(size), session::64, sequence::64,
          time_ms::signed-64, count, addresses::binary-size(count)-unit(48),
          rest::binary>> = datagram,
        key
      )
      when byte_size(rest) >= @mac and count <= @most_addresses do
    with {:ok, kind} <- kind(kind),
         :ok <- signed(datagram, key) do
      payload = binary_part(rest, 0, byte_size(rest) - @mac)

      # Copied, so that a small part of it does not keep the whole datagram in memory.
      {:ok,
       %__MODULE__{
         sender: :binary.copy(sender),
         session: session,
         sequence: sequence,
         time_ms: time_ms,
         addresses: for(<<a, b, c, d, port::16 <- addresses>>, do: {{a, b, c, d}, port}),
         kind: kind,
         payload: payload
       }}
    end
  end

  def open(<<"CVY", version, _rest::binary>>, _key) when version != @version,
    do: {:error, :version}

  def open(_datagram, _key), do: {:error, :not_ours}

  @doc """
  The claimed sender, session and sequence of a datagram, not verified: only for dropping it
  unread.

      iex> Mesh.Protocol.Packet.peek("garbage")
      :error
  """
  @spec peek(binary()) ::
          {:ok, {String.t(), session :: non_neg_integer(), sequence :: non_neg_integer()}}
          | :error
  def peek(
        <<"CVY", @version, _kind, size, sender::binary-size(size), session::64, sequence::64,
          _rest::binary>>
      ),
      do: {:ok, {sender, session, sequence}}

  def peek(_datagram), do: :error

  @doc """
  Encodes a term as a payload; `unpack/1` is the reverse. What would create an atom, or unpack to
  more than 256 KiB, is refused.

      iex> {:mag1, [1, 2.5]} |> Mesh.Protocol.Packet.pack() |> Mesh.Protocol.Packet.unpack()
      {:ok, {:mag1, [1, 2.5]}}
      iex> Mesh.Protocol.Packet.unpack(<<131, 119, 7, "unheard">>)
      {:error, :payload}
  """
  @spec pack(term()) :: binary()
  def pack(term) do
    # Compressing what fits a frame of the network is not worth the time.
    case :erlang.term_to_binary(term, minor_version: 2) do
      payload when byte_size(payload) <= @frame -> payload
      _large -> :erlang.term_to_binary(term, compressed: 1, minor_version: 2)
    end
  end

  @doc "The other way round."
  @spec unpack(binary()) :: {:ok, term()} | {:error, :payload}
  def unpack(<<131, 80, size::32, _deflated::binary>>) when size > @most, do: {:error, :payload}

  def unpack(payload) do
    {:ok, :erlang.binary_to_term(payload, [:safe])}
  rescue
    ArgumentError -> {:error, :payload}
  end

  for {name, number} <- @kinds, do: defp(kind(unquote(number)), do: {:ok, unquote(name)})
  defp kind(_other), do: {:error, :version}

  defp signed(datagram, key) do
    {body, mac} = :erlang.split_binary(datagram, byte_size(datagram) - @mac)
    if :crypto.hash_equals(mac, mac(key, body)), do: :ok, else: {:error, :unsigned}
  end

  defp mac(key, body), do: :crypto.macN(:hmac, :sha256, key, body, @mac)
end
