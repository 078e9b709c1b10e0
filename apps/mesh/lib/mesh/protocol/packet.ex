defmodule Mesh.Protocol.Packet do
  @moduledoc """
  One signed datagram. Pure.

      "CVY" | version | kind | length of name | name | session | sequence | payload | signature
        3        1       1          1                     8         8                    16      bytes

  The name is that of the sending node, the session a random number that it draws at its start,
  the sequence grows with every datagram. The signature is the first half of HMAC-SHA256 with the
  fleet's key, over everything before it: a datagram without a valid signature is not processed
  further.

  Kinds: `:beacon` (who I am, whom I know), `:message` (of a robot, read by the node's
  `Mesh.Consumer`), `:service` (`Mesh.cast/2`). Payloads are terms in the external format, decoded
  without creating atoms.
  """

  @enforce_keys [:sender, :session, :sequence, :kind, :payload]
  defstruct @enforce_keys

  @type kind :: :beacon | :message | :service
  @type t :: %__MODULE__{
          sender: String.t(),
          session: non_neg_integer(),
          sequence: non_neg_integer(),
          kind: kind(),
          payload: binary()
        }
  @type refusal :: :not_ours | :version | :unsigned | :payload

  @version 1
  @mac 16
  @kinds [beacon: 1, message: 2, service: 3]

  # More than any payload unpacks to; otherwise a small datagram could unpack to gigabytes.
  @most 262_144
  @largest 60_000
  @frame 1_200

  @doc "The largest payload of a datagram, in bytes."
  @spec largest() :: pos_integer()
  def largest, do: @largest

  @doc """
  Signs a packet.

      iex> alias Mesh.Protocol.Packet
      iex> packet = %Packet{sender: "mag1@lab", session: 7, sequence: 1, kind: :beacon, payload: "hello"}
      iex> {:ok, ^packet} = packet |> Packet.seal("the fleet's key") |> Packet.open("the fleet's key")
      iex> packet |> Packet.seal("another key") |> Packet.open("the fleet's key")
      {:error, :unsigned}
  """
  @spec seal(t(), key :: binary()) :: binary()
  def seal(%__MODULE__{} = packet, key) do
    body =
      <<"CVY", @version, @kinds[packet.kind], byte_size(packet.sender), packet.sender::binary,
        packet.session::64, packet.sequence::64, packet.payload::binary>>

    body <> mac(key, body)
  end

  @doc """
  Opens a datagram from anywhere.

      iex> Mesh.Protocol.Packet.open("garbage", "the fleet's key")
      {:error, :not_ours}
  """
  @spec open(binary(), key :: binary()) :: {:ok, t()} | {:error, refusal()}
  def open(
        <<"CVY", @version, kind, size, sender::binary-size(size), session::64, sequence::64,
          rest::binary>> = datagram,
        key
      )
      when byte_size(rest) >= @mac do
    with {:ok, kind} <- kind(kind),
         :ok <- signed(datagram, key) do
      payload = binary_part(rest, 0, byte_size(rest) - @mac)

      # Copied, so that a small part of it does not keep the whole datagram in memory.
      {:ok,
       %__MODULE__{
         sender: :binary.copy(sender),
         session: session,
         sequence: sequence,
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
