defmodule Hal.RFlex.Protocol.Decoder do
  @moduledoc """
  Extracts frames from a stream of bytes; the same bytes give the same packets however they are
  split. Pure.

  A beginning that does not lead to a valid frame is given up, and the search continues **one byte
  after** it, so that a damaged frame does not take a valid one with it.

  ## Ghost bytes

  The controller seems to treat `1B` specially: infrared reports of two banks (N = 27 = `1B`) come
  with one extra byte right after N, which neither N nor the checksum counts. So if a frame does
  not fit as it is and has a `1B` between its port and its checksum, these readings of it are
  tried, in this order:

    * every `1B` is followed by a ghost; only those in N and data; only those in N, data and
      checksum; all but the one in the checksum
    * the report is one of two infrared banks, and N is followed by a ghost of any value
    * a single `1B` somewhere is followed by a ghost

  A ghost is another `1B`, until two such frames in a row had the same other byte after N: from
  then on it is that byte.

  ## Bounds

  At most #{2 * 255 + 20} bytes are kept. A report whose greatest length is roughly known is given
  up as soon as its N is above it, so that a damaged N does not hold up what follows; and `idle/1`
  gives up what is unfinished, for a line that has been silent.
  """
  alias Hal.RFlex.Protocol.Packet

  # Whether the header, N and data, and the checksum have ghosts.
  @ways [{true, true, true}, {false, true, false}, {false, true, true}, {true, true, false}]
  # The greatest N of the known reports, with some room, by {port, opcode}.
  @longest %{{1, 1} => 64, {2, 33} => 64, {3, 0} => 64, {5, 1} => 64, {6, 1} => 105}

  defstruct rest: <<>>, ghost: 0x1B, seen: nil, packets: 0, given_up: 0, ghosts: 0, skipped: 0

  @typedoc """
  Counters: `packets` found, beginnings `given_up`, frames with `ghosts`, bytes `skipped`.
  """
  @type t :: %__MODULE__{
          rest: binary(),
          ghost: byte(),
          seen: byte() | nil,
          packets: non_neg_integer(),
          given_up: non_neg_integer(),
          ghosts: non_neg_integer(),
          skipped: non_neg_integer()
        }

  @doc "A decoder that has received nothing yet."
  @spec new() :: t()
  def new, do: %__MODULE__{}

  @doc """
  The packets that these bytes complete, in their order.

      iex> alias Hal.RFlex.Protocol.Decoder
      iex> {[], decoder} = Decoder.feed(Decoder.new(), <<7, 0x1B, 2, 2, 0, 12>>)
      iex> {[packet], _decoder} = Decoder.feed(decoder, <<0, 14, 0x1B, 3>>)
      iex> {packet.port, packet.opcode}
      {2, 12}
  """
  @spec feed(t(), binary()) :: {[Packet.t()], t()}
  def feed(%__MODULE__{} = decoder, bytes) when is_binary(bytes),
    do: run(%{decoder | rest: <<>>}, decoder.rest <> bytes, false, [])

  @doc "Gives up an unfinished frame; returns the packets that are complete within it."
  @spec idle(t()) :: {[Packet.t()], t()}
  def idle(%__MODULE__{} = decoder), do: run(%{decoder | rest: <<>>}, decoder.rest, true, [])

  @doc "Whether a frame is unfinished."
  @spec waiting?(t()) :: boolean()
  def waiting?(%__MODULE__{rest: rest}), do: rest != <<>>

  defp run(decoder, bytes, idle?, packets) do
    case :binary.match(bytes, <<0x1B, 0x02>>) do
      :nomatch -> done(skip(decoder, bytes, idle?), packets)
      {at, 2} -> start(%{decoder | skipped: decoder.skipped + at}, bytes, at, idle?, packets)
    end
  end

  defp start(decoder, bytes, at, idle?, packets) do
    {_before, <<0x1B, 0x02, body::binary>>} = :erlang.split_binary(bytes, at)

    case frame(body, decoder, idle?) do
      {:ok, packet, rest, decoder} ->
        run(%{decoder | packets: decoder.packets + 1}, rest, idle?, [packet | packets])

      :more ->
        # A copy, so that a long binary is not kept for the sake of its end.
        rest = :binary.copy(<<0x1B, 0x02, body::binary>>)
        done(%{decoder | rest: rest}, packets)

      :no ->
        {_, <<_, rest::binary>>} = :erlang.split_binary(bytes, at)
        decoder = %{decoder | given_up: decoder.given_up + 1, skipped: decoder.skipped + 1}
        run(decoder, rest, idle?, packets)
    end
  end

  # The last byte may be the first half of a frame's beginning.
  defp skip(decoder, bytes, false) when bytes != <<>> do
    if :binary.last(bytes) == 0x1B,
      do: %{decoder | rest: <<0x1B>>, skipped: decoder.skipped + byte_size(bytes) - 1},
      else: %{decoder | skipped: decoder.skipped + byte_size(bytes)}
  end

  defp skip(decoder, bytes, _idle?), do: %{decoder | skipped: decoder.skipped + byte_size(bytes)}

  defp done(decoder, packets), do: {Enum.reverse(packets), decoder}

  defp frame(body, decoder, idle?) do
    with :no <- plain(body) |> unless_idle(idle?),
         true <- ghostly?(body) || :no,
         :no <- ghosts(@ways, body, decoder.ghost, idle?),
         :no <- after_length(body) |> unless_idle(idle?),
         :no <- single(body, decoder.ghost) |> unless_idle(idle?) do
      :no
    else
      {:plain, packet, rest} -> {:ok, packet, rest, decoder}
      {:ghost, packet, rest} -> {:ok, packet, rest, %{decoder | ghosts: decoder.ghosts + 1}}
      {:after_length, ghost, packet, rest} -> {:ok, packet, rest, learn(decoder, ghost)}
      other -> other
    end
  end

  defp unless_idle(:more, true), do: :no
  defp unless_idle(result, _idle?), do: result

  defp learn(decoder, ghost) do
    known = if decoder.seen == ghost, do: ghost, else: decoder.ghost
    %{decoder | ghosts: decoder.ghosts + 1, seen: ghost, ghost: known}
  end

  defp plain(<<port, id, opcode, n, rest::binary>>) do
    if possible?(port, opcode, n),
      do: finish(:plain, {port, id, opcode}, n, rest),
      else: :no
  end

  defp plain(_short), do: :more

  defp finish(_tag, _head, n, rest) when byte_size(rest) < n + 3, do: :more

  defp finish(tag, {port, id, opcode} = head, n, rest) do
    case :erlang.split_binary(rest, n) do
      {data, <<sum, 0x1B, 0x03, rest::binary>>} ->
        if sum(head, n, data) == sum,
          do: {tag, packet(port, id, opcode, data), rest},
          else: :no

      _other ->
        :no
    end
  end

  defp possible?(port, opcode, n), do: n <= Map.get(@longest, {port, opcode}, 255)

  defp sum({port, id, opcode}, n, data),
    do: Packet.checksum(<<port, id, opcode, n, data::binary>>)

  defp packet(port, id, opcode, data),
    do: %Packet{port: port, id: id, opcode: opcode, data: :binary.copy(data)}

  defp ghostly?(<<_port, _id, _opcode, n, _::binary>> = body) do
    part = binary_part(body, 0, min(byte_size(body), n + 5))
    :binary.match(part, <<0x1B>>) != :nomatch
  end

  # A frame that is too short to have an N gets here only when the line is idle.
  defp ghostly?(_short), do: false

  defp ghosts([], _body, _ghost, _idle?), do: :no

  defp ghosts([{head?, data?, sum?} | ways], body, ghost, idle?) do
    found =
      with {:ok, <<port, id, opcode>>, rest} <- take(body, 3, where(head?, ghost), <<>>),
           {:ok, <<n>>, rest} <- take(rest, 1, where(data?, ghost), <<>>),
           true <- possible?(port, opcode, n) || :no,
           {:ok, data, rest} <- take(rest, n, where(data?, ghost), <<>>),
           {:ok, <<sum>>, rest} <- take(rest, 1, where(sum?, ghost), <<>>),
           do: finish(:ghost, {port, id, opcode}, n, <<data::binary, sum, rest::binary>>)

    case unless_idle(found, idle?) do
      :no -> ghosts(ways, body, ghost, idle?)
      found -> found
    end
  end

  defp where(true, ghost), do: ghost
  defp where(false, _ghost), do: nil

  # Takes `count` bytes without the ghosts after each 1B. Without a ghost where one belongs, it is
  # not such a frame.
  defp take(rest, 0, _ghost, taken), do: {:ok, taken, rest}

  defp take(<<0x1B, ghost, rest::binary>>, count, ghost, taken),
    do: take(rest, count - 1, ghost, <<taken::binary, 0x1B>>)

  defp take(<<0x1B>>, _count, ghost, _taken) when is_integer(ghost), do: :more
  defp take(<<0x1B, _::binary>>, _count, ghost, _taken) when is_integer(ghost), do: :no

  defp take(<<byte, rest::binary>>, count, ghost, taken),
    do: take(rest, count - 1, ghost, <<taken::binary, byte>>)

  defp take(<<>>, _count, _ghost, _taken), do: :more

  # Only for infrared reports whose first byte says that there are two banks: if a ghost of any
  # value could be anywhere, every byte that came twice would count as one.
  defp after_length(<<6, id, 1, 0x1B, rest::binary>>) do
    case rest do
      <<ghost, 2, _::binary>> ->
        <<_ghost, rest::binary>> = rest

        with {:plain, packet, rest} <- finish(:plain, {6, id, 1}, 0x1B, rest),
             do: {:after_length, ghost, packet, rest}

      <<_ghost, _other, _::binary>> ->
        :no

      _short ->
        :more
    end
  end

  defp after_length(_other), do: :no

  # One ghost after any 1B of N, data or checksum: its position does not change the checksum.
  defp single(
         <<port, id, opcode, n, data::binary-size(n), extra, sum, 0x1B, 0x03, rest::binary>>,
         ghost
       ) do
    body = <<n, data::binary, extra, sum>>

    with true <- Packet.checksum(<<port, id, opcode, body::binary>>) == ghost || :no,
         {at, 2} <- :binary.match(body, <<0x1B, ghost>>) do
      {before, <<0x1B, _ghost, behind::binary>>} = :erlang.split_binary(body, at)
      <<_n, clean::binary>> = <<before::binary, 0x1B, behind::binary>>
      {:ghost, packet(port, id, opcode, binary_part(clean, 0, n)), rest}
    else
      _none -> :no
    end
  end

  defp single(<<port, _id, opcode, n, rest::binary>>, _ghost) when byte_size(rest) < n + 4,
    do: if(possible?(port, opcode, n), do: :more, else: :no)

  defp single(_body, _ghost), do: :no
end
