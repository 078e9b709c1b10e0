defmodule Hal.RPLidar.Nodes do
  @moduledoc """
  Cuts the stream of an RPLIDAR's scan into measurements. Pure. An angle is in 1/64 of a degree, clockwise; a distance in
  millimetres, 0 if nothing was measured; the first of a turn is marked.

  | answer | a packet is |
  |---|---|
  | 0x81, scan | 5 bytes, one measurement; two bits that differ and one that is set are all that tells where it begins |
  | 0x82, express scan | 84 bytes, 32 measurements, with a checksum; decoded when the next one tells where it ends |
  | 0x85, dense express scan | the same with 40 |

  After a byte that does not fit, one is dropped at a time, until three measurements in a row are near each other. Between two
  packets of which one was lost nothing is interpolated.
  """
  import Bitwise
  alias Hal.RPLidar

  @turn 360 * 64
  # Between two measurements that follow each other (1/64 degree); between two packets.
  @step 8 * 64
  @gap 90 * 64
  @sure 3

  @enforce_keys [:type]
  defstruct @enforce_keys ++ [buffer: <<>>, pending: [], locked?: false, last: nil, held: nil]

  @type t :: %__MODULE__{}
  @type measured :: {first? :: boolean(), angle :: 0..23_039, mm :: 0..65_535}

  @doc "The types of answers that are understood."
  @spec types() :: [byte()]
  def types, do: [0x81, 0x82, 0x85]

  @doc "A stream of this type that begins."
  @spec new(0x81 | 0x82 | 0x85) :: t()
  def new(type) when type in [0x81, 0x82, 0x85], do: %__MODULE__{type: type}

  @doc """
  Takes bytes; returns the measurements, the oldest first.

      iex> node = fn first, angle, mm -> <<0x3C + first, 1 + 2 * rem(angle * 64, 128), div(angle * 64, 128), 4 * mm::16-little>> end
      iex> stream = "?" <> node.(1, 358, 900) <> node.(2, 359, 901) <> node.(2, 0, 902)
      iex> {measured, _nodes} = Hal.RPLidar.Nodes.take(Hal.RPLidar.Nodes.new(0x81), stream)
      iex> for {first?, angle, mm} <- measured, do: {first?, div(angle, 64), mm}
      [{true, 358, 900}, {false, 359, 901}, {false, 0, 902}]
  """
  @spec take(t(), binary()) :: {[measured()], t()}
  def take(%__MODULE__{type: 0x81} = nodes, bytes),
    do: standard(%{nodes | buffer: <<>>}, nodes.buffer <> bytes, [])

  def take(%__MODULE__{} = nodes, bytes),
    do: express(%{nodes | buffer: <<>>}, nodes.buffer <> bytes, [])

  defp standard(
         nodes,
         <<_quality::6, a::1, b::1, low::7, 1::1, high, distance::16-little, rest::binary>>,
         done
       )
       when a != b do
    node = {b == 1, rem(low + (high <<< 7), @turn), distance >>> 2}

    if near?(nodes.last, node),
      do: follow(%{nodes | last: node}, node, rest, done),
      else: standard(%{nodes | locked?: false, pending: [node], last: node}, rest, done)
  end

  defp standard(nodes, <<_odd, rest::binary>> = bytes, done) when byte_size(bytes) >= 5,
    do: standard(%{nodes | locked?: false, pending: [], last: nil}, rest, done)

  defp standard(nodes, rest, done), do: {Enum.reverse(done), %{nodes | buffer: rest}}

  defp follow(%{locked?: true} = nodes, node, rest, done),
    do: standard(nodes, rest, [node | done])

  defp follow(%{pending: pending} = nodes, node, rest, done) do
    pending = [node | pending]

    if length(pending) >= @sure,
      do: standard(%{nodes | locked?: true, pending: []}, rest, pending ++ done),
      else: standard(%{nodes | pending: pending}, rest, done)
  end

  defp near?(nil, _node), do: true

  defp near?({_first?, before, _mm}, {_, angle, _}) do
    step = Integer.mod(angle - before, @turn)
    step <= @step or step >= @turn - @step
  end

  defp express(
         nodes,
         <<0xA::4, low::4, 0x5::4, high::4, body::binary-size(82), rest::binary>> = bytes,
         done
       ) do
    if RPLidar.xor(body) == low + (high <<< 4) do
      <<angle::16-little, cabins::binary>> = body
      start = rem(angle &&& 0x7FFF, @turn)
      # A stream that begins: what is held is of another one.
      held = if angle >= 0x8000, do: nil, else: nodes.held
      done = if held, do: Enum.reverse(decode(nodes.type, held, start)) ++ done, else: done
      express(%{nodes | held: {start, cabins}}, rest, done)
    else
      <<_odd, bytes::binary>> = bytes
      express(%{nodes | held: nil}, bytes, done)
    end
  end

  defp express(nodes, <<_odd, rest::binary>> = bytes, done) when byte_size(bytes) >= 84,
    do: express(%{nodes | held: nil}, rest, done)

  defp express(nodes, rest, done), do: {Enum.reverse(done), %{nodes | buffer: rest}}

  defp decode(type, {start, cabins}, next) do
    way = Integer.mod(next - start, @turn)
    if way > @gap, do: [], else: spread(measurements(type, cabins), start, way)
  end

  # In 1/65536 of a degree where they lie between.
  defp spread(measurements, start, way) do
    count = length(measurements)
    increment = div(way <<< 10, count)
    turn = @turn <<< 10

    for {{offset, mm}, i} <- Enum.with_index(measurements) do
      raw = rem((start <<< 10) + i * increment, turn)
      angle = Integer.mod(raw - (offset <<< 13), turn) >>> 10
      {rem(raw + increment, turn) < increment, angle, mm}
    end
  end

  # The offset of each in 1/8 of a degree, and its distance.
  defp measurements(0x82, cabins) do
    for <<one::16-little, two::16-little, high2::4, high1::4 <- cabins>>,
        {word, high} <- [{one, high1}, {two, high2}],
        do: {high + ((word &&& 3) <<< 4), word >>> 2}
  end

  defp measurements(0x85, cabins), do: for(<<mm::16-little <- cabins>>, do: {0, mm})
end
